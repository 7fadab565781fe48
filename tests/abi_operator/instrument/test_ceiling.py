"""Saturation, hard and smooth."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.instrument import hard_ceiling, range_ceiling, smooth_ceiling
from abi_operator.planck import brightness_temperature
from abi_operator.satellites import SATELLITES

CEILING = 16.9
RADIANCE = jnp.array([1e-3, 1.0, 10.0, 16.0, 17.5, 40.0, 3000.0])


def test_ranges():
    # Largest radiances of GOES-16's files, four digits; C07 is 25.59 mW m-2 sr-1 (cm-1)-1.
    expected = {"C01": 804.0, "C02": 629.0, "C03": 373.2, "C04": 140.2, "C05": 94.85}
    for band, radiance in (expected | {"C06": 29.79, "C07": 16.9}).items():
        assert range_ceiling(band) == pytest.approx(radiance, rel=1e-3)
    for satellite in SATELLITES:
        temperature = brightness_temperature(jnp.asarray(range_ceiling("C07", satellite)), "C07")
        assert float(temperature) == pytest.approx(411.9, abs=0.4)


def test_the_scene_of_400_kelvin():
    ceiling = range_ceiling("C07", saturation_temperature=jnp.asarray(400.0))
    np.testing.assert_allclose(ceiling, 12.95, rtol=1e-3)  # integral over the response: 12.9506


def test_there_is_no_green_band():
    with pytest.raises(ValueError, match="no band 'green'; choose from.*'C07'"):
        range_ceiling("green")


def test_hard_ceiling_and_its_derivative():
    both = jax.jit(jax.vmap(jax.value_and_grad(lambda x: hard_ceiling(x, CEILING))))
    value, derivative = both(RADIANCE)
    np.testing.assert_array_equal(value, np.minimum(RADIANCE, CEILING))
    np.testing.assert_array_equal(derivative, np.asarray(RADIANCE) < CEILING)
    assert np.isnan(hard_ceiling(jnp.array(jnp.nan), CEILING))


@pytest.mark.parametrize("width", [0.3, 0.03, 1e-3])
def test_smooth_ceiling_converges_to_the_hard_one(width):
    smooth = jax.jit(smooth_ceiling)(RADIANCE, CEILING, width)
    hard = hard_ceiling(RADIANCE, CEILING)
    assert (smooth <= hard * (1 + 1e-15)).all()
    np.testing.assert_array_less(hard * 2.0**-width * (1 - 1e-12), smooth)
    at_edge = jax.jit(smooth_ceiling)(jnp.asarray(CEILING), CEILING, width)
    np.testing.assert_allclose(at_edge, CEILING * 2.0**-width, rtol=1e-14)


@pytest.mark.parametrize(("width", "expected"), [(0.1, 5e-4), (0.2, 1.5e-2)])
def test_smooth_ceiling_lets_a_derivative_through(width, expected):
    slope = jax.jit(jax.vmap(jax.grad(lambda x: smooth_ceiling(x, 1.0, width))))
    near, far = slope(jnp.array([2.0, 20.0]))
    np.testing.assert_allclose(near, expected, rtol=0.03)
    # Far above: (C / L)^(1 + 1/w).
    np.testing.assert_allclose(far, 20.0 ** (-1 - 1 / width), rtol=1e-5)


def test_derivatives_of_the_smooth_ceiling():
    ceiling, width = jnp.asarray(CEILING), jnp.asarray(0.15)

    @jax.jit
    def function(scale, ceiling, width):
        return smooth_ceiling(scale * RADIANCE, ceiling, width)

    point = (jnp.asarray(1.0), ceiling, width)
    tangent = (jnp.asarray(0.3), jnp.asarray(2.0), jnp.asarray(0.02))
    forward = jax.jit(lambda: jax.jvp(function, point, tangent)[1])()
    h = 1e-5
    ends = [
        function(*(p + s * h * t for p, t in zip(point, tangent, strict=True))) for s in (1, -1)
    ]
    np.testing.assert_allclose(forward, (ends[0] - ends[1]) / (2 * h), rtol=1e-6, atol=1e-9)
    back = jax.jit(jax.grad(lambda *p: function(*p).sum(), (0, 1, 2)))(*point)
    dot = sum(b * t for b, t in zip(back, tangent, strict=True))
    np.testing.assert_allclose(dot, forward.sum(), rtol=1e-13)


@pytest.mark.float32
@pytest.mark.parametrize("width", [0.2, 1e-3])
def test_finite_everywhere_in_float32(width):
    radiance = jnp.array([-2.0, 0.0, 1e-30, 1.0, 1e6, 1e30], jnp.float32)
    function = jax.jit(jax.vmap(jax.value_and_grad(lambda x: smooth_ceiling(x, CEILING, width))))
    value, derivative = function(radiance)
    assert value.dtype == jnp.float32
    assert jnp.isfinite(value).all() and jnp.isfinite(derivative).all()
    np.testing.assert_array_equal(value[:2], radiance[:2])
    np.testing.assert_array_equal(derivative[:2], 1)
    np.testing.assert_allclose(value[4:], CEILING, rtol=1e-5)
    assert hard_ceiling(radiance, CEILING).dtype == jnp.float32
