"""Quadratures over azimuth, against functions whose modes are known."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import ive

from abi_operator.surface.azimuth import azimuth_mode, gauss_azimuths, glint_azimuths

ORDERS = range(16)


def modes_of(function, azimuth, weight):
    mode = jax.vmap(lambda m: azimuth_mode(m, function(azimuth), azimuth, weight))
    return jax.jit(mode)(jnp.arange(16))


def test_gauss_takes_a_cusp_in_backscatter():
    """|phi| has the modes pi / 2 and, for odd m, -2 / (pi m^2)."""
    expected = [np.pi / 2] + [-2 / (np.pi * m**2) if m % 2 else 0.0 for m in ORDERS if m]
    nodes = gauss_azimuths(32, jnp.asarray(1.0))
    # Rounding: 32 nodes are exact for 16 modes of any polynomial on [0, pi].
    np.testing.assert_allclose(modes_of(lambda x: x, *nodes), expected, atol=1e-14)


@pytest.mark.parametrize("sharpness", [0.0, 1.0, 1e2, 1e4, 1e6])
def test_crowded_nodes_take_a_glint_of_any_width(sharpness):
    """exp(-k (1 + cos phi)) has the modes (-1)^m exp(-k) I_m(k)."""
    expected = [(-1) ** m * ive(m, sharpness) for m in ORDERS]
    width = 1 / jnp.sqrt(1 + 0.1 * jnp.asarray(sharpness))
    nodes = glint_azimuths(24, width)
    found = modes_of(lambda x: jnp.exp(-2 * sharpness * jnp.cos(x / 2) ** 2), *nodes)
    np.testing.assert_allclose(found, expected, atol=1e-12 * expected[0])


def test_nodes_differ_between_pairs_of_directions():
    width = jnp.asarray([[1.0, 0.1], [0.1, 0.01]])
    azimuth, weight = glint_azimuths(48, width)
    assert azimuth.shape == weight.shape == (48, 2, 2)
    np.testing.assert_allclose(azimuth[:, 0, 0], np.pi * (1 - (np.arange(48) + 0.5) / 48))
    np.testing.assert_array_equal(azimuth[:, 0, 1], azimuth[:, 1, 0])
    # Weights of a plain mean; what is smooth on the circle but not on the nodes falls off slowly.
    np.testing.assert_allclose(jnp.sum(weight, axis=0)[:, 0], 1, rtol=1e-3)
