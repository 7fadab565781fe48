"""Asymmetry factor of rain against Mie theory and against geometric optics."""

import functools

import jax
import jax.numpy as jnp
import miepython
import numpy as np
import pytest

from abi_operator.bands import BANDS
from abi_operator.optics.rain import ASYMMETRY, EFFECTIVE_RADIUS_UM, rain_asymmetry
from abi_operator.optics.water import REFRACTIVE_INDEX, droplet_asymmetry

MIE = 1.5e-3  # of the sums over 400 sizes here, and of interpolation


@functools.cache
def spheres(band):
    diameter = np.geomspace(4.0, 2400.0, 400)
    x = np.pi * diameter / BANDS[band].wavelength_um
    _, q_sca, _, asymmetry = miepython.efficiencies_mx(REFRACTIVE_INDEX[band], x)
    return diameter, q_sca, asymmetry


def mie(band, radius_um, nu):
    diameter, q_sca, asymmetry = spheres(band)
    slope = (nu + 3) / (2 * radius_um)
    area = np.exp((nu + 3) * np.log(slope * diameter) - slope * diameter)
    return (area @ (q_sca * asymmetry)) / (area @ q_sca)


@pytest.mark.parametrize("band", ["C04", "C07"])
@pytest.mark.parametrize("radius_um", [22.0, 40.0, 85.0, 130.0])
def test_asymmetry_against_mie(band, radius_um):
    value = rain_asymmetry(jnp.asarray(radius_um), band)
    np.testing.assert_allclose(value, mie(band, radius_um, 0.0), rtol=0, atol=MIE)
    # A narrower distribution of the same effective radius differs by little.
    np.testing.assert_allclose(value, mie(band, radius_um, 2.0), rtol=0, atol=0.01)


@pytest.mark.parametrize("band", BANDS)
def test_rain_goes_on_from_droplets(band):
    """At 30 um, where both tables hold, the width of the distribution alone is between them."""
    radius = jnp.asarray(30.0)
    difference = rain_asymmetry(radius, band) - droplet_asymmetry(radius, band)
    assert abs(difference) < 0.016


def test_large_transparent_drops_follow_geometric_optics():
    """Half is diffracted with g = 1; of spheres of n = 1.33 the other half has g of 0.77."""
    value = rain_asymmetry(jnp.asarray(1500.0), "C02")
    np.testing.assert_allclose(value, (1 + 0.77) / 2, rtol=0, atol=0.005)


@pytest.mark.parametrize("band", BANDS)
def test_table_is_monotone_and_constant_beyond(band):
    assert np.all(np.diff(ASYMMETRY[band]) > 0)
    values = rain_asymmetry(jnp.asarray([1.0, *EFFECTIVE_RADIUS_UM, 1e5]), band)
    table = ASYMMETRY[band]
    np.testing.assert_allclose(values, [table[0], *table, table[-1]], rtol=1e-14)


def test_slope_is_zero_at_the_ends():
    slope = jax.jit(jax.vmap(jax.grad(lambda radius: rain_asymmetry(radius, "C06"))))
    np.testing.assert_allclose(slope(jnp.asarray([1.0, 10.0, 2000.0, 1e5])), 0, atol=1e-15)
