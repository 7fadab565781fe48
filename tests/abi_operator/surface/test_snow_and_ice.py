"""Albedo of snow and sea ice: against theory, and against means that others found."""

import jax.numpy as jnp
import miepython
import numpy as np
import pytest

from abi_operator.bands import BANDS
from abi_operator.optics.ice_tables import ICE_INDEX
from abi_operator.solver import toa_albedo
from abi_operator.surface import SNOW_AND_ICE_ALBEDO, emissivity_3900nm, snow_and_ice_albedo

RADIUS_UM = {"new snow": 100.0, "old snow": 500.0}
SOLAR = ("C01", "green", "C02", "C03", "C04", "C05", "C06")

# Last digit of the table, and what a single sphere's resonances are from the mean about its radius.
PRINTED, RESONANCES = 5e-4, 4e-3


def grain(name, band):
    """Co-albedo and asymmetry factor of one sphere of ice."""
    size = 2 * np.pi * RADIUS_UM[name] / BANDS[band].wavelength_um
    extinction, scattering, _, asymmetry = miepython.efficiencies_mx(ICE_INDEX[band], size)
    return 1 - scattering / extinction, asymmetry


def test_all_bands_of_sunlight_have_one():
    assert all(tuple(by_band) == SOLAR for by_band in SNOW_AND_ICE_ALBEDO.values())
    assert all(0 < x < 1 for by_band in SNOW_AND_ICE_ALBEDO.values() for x in by_band.values())


@pytest.mark.parametrize("name", RADIUS_UM)
@pytest.mark.parametrize("band", ["C01", "green", "C02", "C03"])
def test_bright_snow_is_that_of_asymptotic_theory(name, band):
    """Kokhanovsky and Zege (2004), to 0.003 where less than a quarter is absorbed."""
    coalbedo, asymmetry = grain(name, band)
    expected = np.exp(-4 * np.sqrt(coalbedo / (3 * (1 - asymmetry))))
    np.testing.assert_allclose(snow_and_ice_albedo(name, band), expected, atol=RESONANCES)


@pytest.mark.parametrize("name", RADIUS_UM)
def test_snow_is_what_the_solver_makes_of_deep_layers_of_grains(name):
    bands = ("C03", "C04", "C05", "C06")
    nodes, weights = np.polynomial.legendre.leggauss(8)
    mu0, weights = (nodes + 1) / 2, weights * (nodes + 1) / 2
    coalbedo, asymmetry = np.array([grain(name, band) for band in bands]).T[:, :, None, None]
    shape = (len(bands), len(mu0), 1)
    moments = np.broadcast_to(asymmetry[..., None] ** np.arange(65), (*shape, 65))
    ssa = jnp.asarray(np.broadcast_to(1 - coalbedo, shape))
    plane = toa_albedo(jnp.full(shape, 1e5), ssa, moments, 0.0, mu0, num_streams=8)
    expected = [snow_and_ice_albedo(name, band) for band in bands]
    np.testing.assert_allclose(plane @ weights, expected, atol=PRINTED + RESONANCES)


def test_new_snow_is_as_in_models_of_sea_ice():
    """Ebert and Curry (1993), dry snow: 0.975 below 0.69 um, 0.832 to 1.19 um, 0.25 to 2.38 um."""
    new = SNOW_AND_ICE_ALBEDO["new snow"]
    assert abs(np.mean([new[band] for band in ("C01", "green", "C02")]) - 0.975) < 0.015
    assert abs(new["C03"] - 0.832) < 0.06
    assert abs(np.mean([new[band] for band in ("C04", "C05", "C06")]) - 0.25) < 0.05


def test_bare_ice_over_the_suns_spectrum_is_what_was_measured():
    """Brandt et al. (2005), table 1: 0.49 under a clear, 0.54 under a cloudy sky."""
    ice = SNOW_AND_ICE_ALBEDO["bare sea ice"]
    # Shares of sunlight at the ground in 0.25-0.69, 0.69-1.19, 1.19-2.38 um; the rest is beyond.
    shares = {"C02": 0.49, "C03": 0.32, "C05": 0.17}
    assert 0.49 <= sum(share * ice[band] for band, share in shares.items()) <= 0.54


def test_emissivity_of_snow_leaves_what_grains_do():
    """Deep snow reflects 0.007 to 0.011 in C07; flat ice, by Fresnel's law, 0.024."""
    n = ICE_INDEX["C07"]
    flat = abs((n - 1) / (n + 1)) ** 2
    assert 0.005 < 1 - emissivity_3900nm("snow") < flat


@pytest.mark.parametrize(
    ("name", "band", "message"),
    [("slush", "C01", "no albedo for surface type 'slush'"), ("old snow", "C07", "in band 'C07'")],
)
def test_what_is_not_known_is_named(name, band, message):
    with pytest.raises(ValueError, match=message):
        snow_and_ice_albedo(name, band)
