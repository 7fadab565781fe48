"""Refractive index of water against its source, asymmetry of droplets against Mie theory."""

from importlib.resources import files

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.bands import BANDS, several_bands
from abi_operator.optics.water import (
    ASYMMETRY,
    EFFECTIVE_RADIUS_UM,
    REFRACTIVE_INDEX,
    droplet_asymmetry,
)

MIE = 1e-3  # of interpolation between the radii of the table, and of the sums over sizes
ENDS = (EFFECTIVE_RADIUS_UM[0], EFFECTIVE_RADIUS_UM[-1])


@pytest.mark.parametrize("band", BANDS)
def test_refractive_index_is_segelsteins(band):
    table = files("miepython").joinpath("data/segelstein81_index.txt").read_text()
    wavelength, n, k = np.loadtxt(table.splitlines()[4:]).T
    centroid, index = BANDS[band].wavelength_um, REFRACTIVE_INDEX[band]
    np.testing.assert_allclose(index.real, np.interp(centroid, wavelength, n), atol=1e-4)
    log_k = np.interp(np.log(centroid), np.log(wavelength), np.log(k))
    # The two copies of the table differ in their last digits, by 2e-3 in k at most (C05).
    np.testing.assert_allclose(-index.imag, np.exp(log_k), rtol=2.5e-3)


def in_every_band(function, radii):
    """A function of radius and name of the band, (band, radius)."""
    of_band = jax.vmap(function, in_axes=(0, None))
    mapped = jax.jit(lambda bands, radii: jax.vmap(of_band, in_axes=(None, 0))(radii, bands))
    bands = several_bands(tuple(BANDS), float).name
    return np.asarray(mapped(bands, jnp.asarray(radii, float)))


def test_asymmetry_against_mie(droplet_mie):
    radii = [2.5, 2.7, 3.2, 4.0, 4.25, 5.5, 7.5, 10.0, 13.5, 25.0, 35.0, 40.0]
    expected = [[droplet_mie(band, radius)[2] for radius in radii] for band in BANDS]
    values = in_every_band(droplet_asymmetry, radii)
    np.testing.assert_allclose(values, expected, rtol=0, atol=MIE)


def test_asymmetry_passes_through_the_table_and_is_constant_beyond():
    values = in_every_band(droplet_asymmetry, [0.5, *EFFECTIVE_RADIUS_UM, 200.0])
    for band, value in zip(BANDS, values, strict=True):
        table = ASYMMETRY[band]
        np.testing.assert_allclose(value, [table[0], *table, table[-1]], rtol=1e-14)
        alone = droplet_asymmetry(jnp.asarray(EFFECTIVE_RADIUS_UM, float), band)
        np.testing.assert_allclose(alone, table, rtol=1e-14)


def test_slope_is_continuous_and_zero_at_the_ends():
    nodes, nearby = np.asarray(EFFECTIVE_RADIUS_UM, float), 1e-9
    radii = np.concatenate([nodes * (1 - nearby), nodes * (1 + nearby), [1.0, *ENDS, 100.0]])
    slope = in_every_band(jax.grad(droplet_asymmetry), radii)
    below, above, ends = np.split(slope, [len(nodes), 2 * len(nodes)], axis=1)
    # The second derivative times the distance between the two points is what may differ.
    np.testing.assert_allclose(below, above, rtol=0, atol=1e-8)
    np.testing.assert_allclose(ends, 0, atol=1e-15)


@pytest.mark.float32
@pytest.mark.parametrize("band", BANDS)
def test_float32_stays(band):
    value = droplet_asymmetry(jnp.asarray(EFFECTIVE_RADIUS_UM, jnp.float32), band)
    assert value.dtype == jnp.float32
    np.testing.assert_allclose(value, ASYMMETRY[band], rtol=3e-7)
