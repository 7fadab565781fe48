"""Thermal light of a ground, a part of which burns."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.surface import (
    EMISSIVITY_3900NM,
    emissivity_3900nm,
    ocean,
    surface_emission,
)
from abi_operator.surface.ocean import fresnel_reflectance

# Planck function at 3.9 um of 300, 400, 600 and 1000 K, in the response of C07. [W m-2 sr-1 um-1]
PLANCK = [jnp.asarray(x) for x in (0.598, 12.95, 282.0, 3391.0)]


def test_without_a_fire_it_is_kirchhoffs_law():
    albedo = jnp.asarray([0.0, 0.06, 1.0])
    np.testing.assert_allclose(surface_emission(albedo, PLANCK[0]), PLANCK[0] * (1 - albedo))
    np.testing.assert_array_equal(surface_emission(albedo, PLANCK[0], PLANCK[3]), [
        *surface_emission(albedo, PLANCK[0])
    ])  # fmt: skip


def test_a_fire_mixes_by_its_share():
    """Dozier's two-component pixel, by hand; a hundredth at 1000 K outshines the rest."""
    share = jnp.asarray([0.0, 0.01, 0.5, 1.0])
    result = surface_emission(jnp.asarray(0.06), PLANCK[0], PLANCK[3], share)
    expected = 0.94 * (share * PLANCK[3] + (1 - share) * PLANCK[0])
    # 1 - (1 - p) costs the last digit where the ground is all fire.
    np.testing.assert_allclose(result, expected, rtol=1e-15)
    assert result[1] > 50 * result[0]


def test_two_bands_give_back_share_and_temperature():
    """What the equation is for: at 2.2 and 3.9 um the same share of the same fire."""
    fires = jnp.asarray([[47.7, 282.0], [3440.0, 3391.0]])  # 600 and 1000 K
    grounds = jnp.asarray([0.0011, 0.598])
    share = 0.004
    seen = surface_emission(jnp.zeros(2), grounds, fires[1], share)
    found = (seen - grounds) / (fires - grounds)
    np.testing.assert_allclose(found[1], share, rtol=1e-12)  # one share fits both bands
    assert abs(found[0, 0] / found[0, 1] - 1) > 0.5  # at the wrong temperature none does


def test_derivatives():
    inputs = tuple(jnp.asarray(x) for x in (0.06, 0.598, 3391.0, 0.01))
    slopes = jax.grad(surface_emission, argnums=(0, 1, 2, 3))(*inputs)
    albedo, background, fire, share = inputs
    mixed = background + share * (fire - background)
    expected = (-mixed, 0.94 * 0.99, 0.94 * share, 0.94 * (fire - background))
    np.testing.assert_allclose(slopes, expected, rtol=1e-14)


def test_float32_stays():
    result = surface_emission(jnp.float32(0.1), jnp.float32(0.6), jnp.float32(300), 0.01)
    assert result.dtype == jnp.float32


def test_emissivity_of_water_is_fresnels():
    sea = ocean(jnp.asarray(5.0), "C07")
    mirror = fresnel_reflectance(jnp.asarray(1.0), sea.refractive_index, sea.absorption_index)
    # To the last printed digit.
    np.testing.assert_allclose(emissivity_3900nm("water"), 1 - mirror, rtol=0, atol=5e-4)


def test_emissivities_are_shares_and_unknown_types_are_named():
    assert all(0.5 < x <= 1 for x in EMISSIVITY_3900NM.values())
    with pytest.raises(ValueError, match="no emissivity for surface type 'moon'"):
        emissivity_3900nm("moon")
