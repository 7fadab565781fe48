"""Rayleigh scattering against its own formula and against the pressure of the column."""

import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.bands import BANDS, GRASSO2013, Band
from abi_operator.constants import STANDARD_PRESSURE
from abi_operator.optics import rayleigh
from abi_operator.optics.rayleigh import BETA2, STANDARD_DEPTH

# Half-power points of GOES-16's response (NOAA CWG, 2016). [um]
HALF_POWER = {
    "C01": (0.45052, 0.49058),
    "C02": (0.59623, 0.68214),
    "C03": (0.84685, 0.88204),
    "C06": (2.21976, 2.26600),
}
SQUARE_RESPONSE = 0.007  # a box between half-power points and a flat sun in place of the true ones


def king_factor(wavelength_um, co2=3.6e-4):
    """Depolarisation of dry air, Bodhaine et al. (1999), eqs 5, 6 and 23. [-]"""
    inverse2 = wavelength_um**-2.0
    nitrogen = 1.034 + 3.17e-4 * inverse2
    oxygen = 1.096 + 1.385e-3 * inverse2 + 1.448e-4 * inverse2**2
    weighted = 78.084 * nitrogen + 20.946 * oxygen + 0.934 + 100 * co2 * 1.15
    return weighted / (78.084 + 20.946 + 0.934 + 100 * co2)


def optical_depth(wavelength_um, co2=3.6e-4):
    """Full form of Bodhaine et al. (1999) at 1013.25 hPa and 45 degrees of latitude. [-]"""
    inverse2 = wavelength_um**-2.0
    refractivity = 8060.51 + 2480990 / (132.274 - inverse2) + 17455.7 / (39.32957 - inverse2)
    n2 = (1 + 1e-8 * refractivity * (1 + 0.54 * (co2 - 3e-4))) ** 2
    molecules, wavelength_cm = 2.546899e19, 1e-4 * wavelength_um
    cross_section = (24 * np.pi**3 * (n2 - 1) ** 2 * king_factor(wavelength_um, co2)) / (
        wavelength_cm**4 * molecules**2 * (n2 + 2) ** 2
    )
    pressure, avogadro, molar_mass, gravity = 1013250.0, 6.0221367e23, 28.9649, 978.91  # cgs
    return cross_section * pressure * avogadro / (molar_mass * gravity)


@pytest.mark.parametrize("band", GRASSO2013)
def test_standard_depth_follows_bodhaine(band):
    wavelengths = np.linspace(*HALF_POWER[band], 101)
    np.testing.assert_allclose(
        STANDARD_DEPTH[band], optical_depth(wavelengths).mean(), rtol=SQUARE_RESPONSE
    )


@pytest.mark.parametrize("band", GRASSO2013)
def test_beta2_has_the_depolarisation_of_the_king_factor(band):
    king = king_factor(BANDS[band].wavelength_um)
    depolarisation = 6 * (king - 1) / (3 + 7 * king)
    gamma = depolarisation / (2 - depolarisation)
    np.testing.assert_allclose(BETA2[band], 0.5 * (1 - gamma) / (1 + 2 * gamma), rtol=1e-4)


@pytest.mark.parametrize("band", GRASSO2013)
def test_depth_is_proportional_to_the_mass_of_air(make_atmosphere, band):
    atmosphere = make_atmosphere()
    optics = rayleigh(atmosphere, BANDS[band])
    pressure = atmosphere.pressure[-1] - atmosphere.pressure[0]
    np.testing.assert_allclose(
        optics.tau.sum(), STANDARD_DEPTH[band] * pressure / STANDARD_PRESSURE, rtol=1e-13
    )
    assert optics.tau.shape == (1, 10)
    np.testing.assert_array_equal(optics.ssa, 1)
    np.testing.assert_array_equal(optics.weight, [1])
    expected = np.tile([1, 0, BETA2[band] / 5, 0], (10, 1))
    np.testing.assert_allclose(optics.moments(4), expected, rtol=1e-15)


def test_unknown_band_is_named(make_atmosphere):
    with pytest.raises(ValueError, match="no Rayleigh depth for band 'C13'"):
        rayleigh(make_atmosphere(), Band("C13", 10.34))


@pytest.mark.float32
def test_float32_stays(make_atmosphere):
    optics = rayleigh(make_atmosphere(dtype=jnp.float32), BANDS["C01"])
    assert optics.tau.dtype == optics.moments(3).dtype == jnp.float32
