"""Rayleigh scattering against its own formula and against the pressure of the column."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.atmosphere import LiquidCloud
from abi_operator.bands import BANDS, Band
from abi_operator.constants import STANDARD_PRESSURE
from abi_operator.optics import rayleigh
from abi_operator.optics.rayleigh import BETA2, STANDARD_DEPTH, bodhaine1999, king_factor

# Half-power points of GOES-16's response (NOAA CWG, 2016); green is one wavelength. [um]
HALF_POWER = {
    "C01": (0.45052, 0.49058),
    "green": (0.555, 0.555),
    "C02": (0.59623, 0.68214),
    "C03": (0.84685, 0.88204),
    "C04": (1.36626, 1.38027),
    "C05": (1.58739, 1.63257),
    "C06": (2.21976, 2.26600),
    "C07": (3.80261, 3.99221),
}
# A box between half-power points and a sun of 5778 K in place of the true ones: 0.48 % in C01.
SQUARE_RESPONSE = 0.005
SHORT_FORM = 1e-4  # by which the short form departs from the full one in 0.25-0.85 um (its authors)


def independent_king_factor(wavelength_um, co2):
    """Depolarisation of dry air, Bodhaine et al. (1999), eqs 5, 6 and 23. [-]"""
    inverse2 = wavelength_um**-2.0
    nitrogen = 1.034 + 3.17e-4 * inverse2
    oxygen = 1.096 + 1.385e-3 * inverse2 + 1.448e-4 * inverse2**2
    weighted = 78.084 * nitrogen + 20.946 * oxygen + 0.934 + 100 * co2 * 1.15
    return weighted / (78.084 + 20.946 + 0.934 + 100 * co2)


def gravity(latitude_deg, height):
    """Gravity at a height above sea level, eqs 10 and 11. [cm s-2], [m]"""
    c = np.cos(np.radians(2 * latitude_deg))
    sea = 980.6160 * (1 - 0.0026373 * c + 0.0000059 * c**2)
    linear = (3.085462e-4 + 2.27e-7 * c) * height
    return (
        sea - linear + (7.254e-11 + 1.0e-13 * c) * height**2 - (1.517e-17 + 6e-20 * c) * height**3
    )


def independent_depth(wavelength_um, co2=3.6e-4):
    """Full form of Bodhaine et al. (1999) at 1013.25 hPa and 45 degrees of latitude. [-]"""
    inverse2 = wavelength_um**-2.0
    refractivity = 8060.51 + 2480990 / (132.274 - inverse2) + 17455.7 / (39.32957 - inverse2)
    n2 = (1 + 1e-8 * refractivity * (1 + 0.54 * (co2 - 3e-4))) ** 2
    molecules, wavelength_cm = 2.546899e19, 1e-4 * wavelength_um
    king = independent_king_factor(wavelength_um, co2)
    cross_section = 24 * np.pi**3 * (n2 - 1) ** 2 * king
    cross_section = cross_section / (wavelength_cm**4 * molecules**2 * (n2 + 2) ** 2)
    molar_mass = 15.0556 * co2 + 28.9595
    centre_of_mass = 5517.56  # of the air above sea level, eq. 26 [m]
    weight = molar_mass * gravity(45.0, centre_of_mass)
    return cross_section * 1013250.0 * 6.0221367e23 / weight


def planck(wavelength_um, temperature):
    return wavelength_um**-5 / np.expm1(14387.77 / (wavelength_um * temperature))


@pytest.mark.parametrize("co2", [300e-6, 360e-6, 420e-6])
def test_full_form_of_bodhaine(co2):
    wavelengths = np.linspace(0.25, 4.1, 300)
    expected = independent_depth(wavelengths, co2)
    np.testing.assert_allclose(bodhaine1999(jnp.asarray(wavelengths), co2), expected, rtol=1e-6)


def test_short_form_of_bodhaine():
    """Eq. 30 of the paper, which its authors fitted to what they had computed."""
    w2 = np.linspace(0.25, 0.85, 61) ** 2
    short = 1.0455996 - 341.29061 / w2 - 0.90230850 * w2
    short = 0.0021520 * short / (1 + 0.0027059889 / w2 - 85.968563 * w2)
    np.testing.assert_allclose(bodhaine1999(jnp.sqrt(w2)), short, rtol=SHORT_FORM)


@pytest.mark.parametrize("band", BANDS)
def test_standard_depth_follows_bodhaine(band):
    wavelengths = np.linspace(*HALF_POWER[band], 1001)
    sun = planck(wavelengths, 5778.0)
    expected = np.sum(sun * bodhaine1999(jnp.asarray(wavelengths))) / sun.sum()
    np.testing.assert_allclose(STANDARD_DEPTH[band], expected, rtol=SQUARE_RESPONSE)


@pytest.mark.parametrize("band", BANDS)
def test_beta2_has_the_depolarisation_of_the_king_factor(band):
    king = independent_king_factor(BANDS[band].wavelength_um, 3.6e-4)
    ours = king_factor(jnp.asarray(BANDS[band].wavelength_um))
    np.testing.assert_allclose(ours, king, rtol=1e-14)
    depolarisation = 6 * (king - 1) / (3 + 7 * king)
    gamma = depolarisation / (2 - depolarisation)
    last_digit = 5e-6
    expected = 0.5 * (1 - gamma) / (1 + 2 * gamma)
    np.testing.assert_allclose(BETA2[band], expected, atol=1.5 * last_digit, rtol=0)


@pytest.mark.parametrize("band", BANDS)
def test_depth_is_proportional_to_the_mass_of_air(make_atmosphere, band):
    atmosphere = make_atmosphere()
    optics = rayleigh(atmosphere, BANDS[band])
    pressure = atmosphere.pressure[-1]
    np.testing.assert_allclose(
        optics.tau.sum(), STANDARD_DEPTH[band] * pressure / STANDARD_PRESSURE, rtol=1e-13
    )
    assert optics.tau.shape == (1, 10)
    np.testing.assert_array_equal(optics.ssa, 1)
    np.testing.assert_array_equal(optics.weight, [1])
    expected = np.tile([1, 0, BETA2[band] / 5, 0], (10, 1))
    np.testing.assert_allclose(optics.moments(4), expected, rtol=1e-15)


def test_air_above_the_first_level_counts(make_atmosphere):
    """In the uppermost layer, wherever levels begin; that level's own pressure moves nothing."""
    whole = make_atmosphere()
    assert whole.pressure[0] > 1000  # there is air above
    cut = dataclasses.replace(
        whole,
        pressure=whole.pressure[3:],
        height=whole.height[3:],
        liquid=LiquidCloud(whole.liquid.mass_path[3:], whole.liquid.number_path[3:]),
    )
    depth, of_rest = (rayleigh(a, BANDS["C01"]).tau[0] for a in (whole, cut))
    np.testing.assert_allclose(of_rest[0], depth[:4].sum(), rtol=1e-13)
    np.testing.assert_allclose(of_rest[1:], depth[4:], rtol=1e-13)
    slope = jax.jit(jax.jacrev(lambda a: rayleigh(a, BANDS["C01"]).tau[0]))(whole).pressure
    per_pascal = STANDARD_DEPTH["C01"] / STANDARD_PRESSURE
    np.testing.assert_allclose(slope[0], per_pascal * np.eye(11)[1], rtol=1e-13)


def test_wavelength_and_pressure_differentiate(make_atmosphere):
    tau, slope = jax.value_and_grad(bodhaine1999)(jnp.asarray(0.5))
    np.testing.assert_allclose(slope, -4 * tau / 0.5, rtol=0.05)  # Rayleigh's fourth power
    atmosphere = make_atmosphere()
    total = jax.grad(lambda a: rayleigh(a, BANDS["C05"]).tau.sum())(atmosphere)
    expected = STANDARD_DEPTH["C05"] / STANDARD_PRESSURE
    np.testing.assert_allclose(total.pressure[-1], expected, rtol=1e-13)


def test_unknown_band_is_named(make_atmosphere):
    with pytest.raises(ValueError, match="no Rayleigh depth for band 'C13'"):
        rayleigh(make_atmosphere(), Band("C13", 10.34))


@pytest.mark.float32
def test_float32_stays(make_atmosphere):
    optics = rayleigh(make_atmosphere(dtype=jnp.float32), BANDS["C01"])
    assert optics.tau.dtype == optics.moments(3).dtype == jnp.float32
    depth = bodhaine1999(jnp.asarray(0.5, jnp.float32))
    assert depth.dtype == jnp.float32
    np.testing.assert_allclose(depth, independent_depth(0.5), rtol=2e-6)
