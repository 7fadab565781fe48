"""Effective radius from mass and number."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.atmosphere import LiquidCloud
from abi_operator.constants import WATER_DENSITY
from abi_operator.optics import effective_radius
from abi_operator.optics.droplets import LARGEST_RADIUS, NU, SMALLEST_RADIUS


def cloud(mass, number, dtype=float):
    return LiquidCloud(jnp.asarray(mass, dtype), jnp.asarray(number, dtype))


def test_effective_radius_of_the_gamma_distribution():
    mass, number = 0.05, 2e10
    slope = math.pi / 6 * WATER_DENSITY * number * math.gamma(NU + 4) / (mass * math.gamma(NU + 1))
    slope = slope ** (1 / 3)
    np.testing.assert_allclose(
        effective_radius(cloud([mass], [number])), (NU + 3) / (2 * slope), rtol=1e-14
    )
    diameter = np.geomspace(1e-8, 2e-4, 4000)
    weight = diameter ** (NU + 1) * np.exp(-slope * diameter)
    moments = [np.sum(weight * diameter**power) for power in (0, 2, 3)]
    np.testing.assert_allclose(
        number * moments[2] / moments[0] * WATER_DENSITY * math.pi / 6, mass, rtol=1e-10
    )
    np.testing.assert_allclose(
        moments[2] / moments[1] / 2, effective_radius(cloud([mass], [number]))[0], rtol=1e-10
    )


def test_clear_and_doubtful_layers():
    mass = [0.0, 0.0, 1e-3, -1e-9, 1e-12, 1.0]
    number = [0.0, 1e9, 0.0, 1e9, 1e10, 1.0]
    # Far beyond the limits half of the logarithm of size is left, from each.
    ends = SMALLEST_RADIUS * math.exp(-0.5), LARGEST_RADIUS * math.exp(0.5)
    found = effective_radius(cloud(mass, number))
    np.testing.assert_array_equal(found[:4], 0)
    np.testing.assert_allclose(found[4:], ends, rtol=1e-3)


@pytest.mark.parametrize("limit", [SMALLEST_RADIUS, LARGEST_RADIUS])
def test_size_goes_beyond_its_limits_without_a_kink(limit):
    """Value and slope against the logarithm of mass are continuous; size still rises beyond."""
    number = 1e9
    mass = 4 / 3 * math.pi * WATER_DENSITY * limit**3 * number * 0.72  # 0.72 for the variance 0.1
    step = np.concatenate([[-1.0, -1e-6], [1e-6, 1.0]])  # of the logarithm of radius

    def radius(log_step):
        return effective_radius(cloud(mass * jnp.exp(3 * log_step)[None], [number]))[0]

    found = np.array([radius(x) for x in step])
    slope = np.array([jax.grad(radius)(x) for x in step])
    np.testing.assert_allclose(found[1:3], limit, rtol=2e-6)
    np.testing.assert_allclose(slope[1:3], limit, rtol=2e-5)
    outer, inner = (0, 3) if limit == SMALLEST_RADIUS else (3, 0)
    assert found[inner] == pytest.approx(limit * math.exp(step[inner]), rel=1e-12)
    assert np.all(np.diff(found) > 0) and 0 < slope[outer] < slope[inner] * math.exp(-step[inner])


@pytest.mark.float32
@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_derivative_is_finite_everywhere(mode, dtype):
    if dtype == "float64" and not jax.config.jax_enable_x64:
        dtype = "float32"
    values = [0.0, 1e-30, 1e-18, 1e-6, 1.0, 1e10]
    mass, number = (grid.ravel() for grid in np.meshgrid(values, values))
    liquid = cloud(mass, number, dtype)
    derivative = mode(lambda one: effective_radius(one).sum())(liquid)
    assert effective_radius(liquid).dtype == dtype
    for leaf in (effective_radius(liquid), derivative.mass_path, derivative.number_path):
        assert np.all(np.isfinite(leaf))


def test_a_batch_is_as_one_column():
    mass, number = np.full((2, 3), 0.01), np.array([[0, 1e9, 1e10], [1e8, 1e9, 1e11]])
    batch = effective_radius(cloud(mass, number))
    np.testing.assert_array_equal(batch[1], effective_radius(cloud(mass[1], number[1])))
