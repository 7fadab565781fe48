"""Means over footprints."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.instrument import footprint_mean, image_mean, overlap_lengths

EDGES = jnp.arange(0.0, 11.0) * 400  # cells of 400 m
PIXELS = jnp.arange(0.0, 5.0) * 1000  # pixels of 1 km: two and a half cells each


def test_lengths_share_each_cell_among_pixels():
    lengths = overlap_lengths(EDGES, PIXELS)
    np.testing.assert_array_equal(lengths[0, :4], [400, 400, 200, 0])
    np.testing.assert_array_equal(lengths[1, :6], [0, 0, 200, 400, 400, 0])
    np.testing.assert_array_equal(lengths.sum(axis=0), np.full(10, 400))
    np.testing.assert_array_equal(lengths.sum(axis=1), np.full(4, 1000))


def test_mean_is_weighted_by_area():
    radiance, weights = jnp.array([1.0, 5.0, 7.0]), jnp.array([2.0, 1.0, 0.0])
    np.testing.assert_allclose(footprint_mean(radiance, weights), 7 / 3, rtol=1e-15)
    np.testing.assert_allclose(footprint_mean(radiance, 1e6 * weights), 7 / 3, rtol=1e-15)
    gradient = jax.grad(footprint_mean)(radiance, weights)
    np.testing.assert_allclose(gradient, [2 / 3, 1 / 3, 0], rtol=1e-15)


def test_uniform_radiance_stays():
    assert footprint_mean(jnp.full(25, 3.5), jnp.linspace(0.1, 2.0, 25)) == pytest.approx(3.5)


def test_image_is_the_mean_of_each_pixel():
    radiance = jnp.asarray(np.random.default_rng(1).uniform(1, 9, (10, 10)))
    lengths = overlap_lengths(EDGES, PIXELS)
    image = image_mean(radiance, lengths, lengths)

    def pixel(wy, wx):
        return footprint_mean(radiance.ravel(), jnp.outer(wy, wx).ravel())

    loop = jax.jit(jax.vmap(jax.vmap(pixel, (None, 0)), (0, None)))(lengths, lengths)
    assert image.shape == (4, 4)
    np.testing.assert_allclose(image, loop, rtol=1e-14)
    np.testing.assert_allclose(image.mean(), radiance.mean(), rtol=1e-14)  # no light is lost


def test_a_footprint_without_cells_has_no_mean_and_no_derivative():
    both = jax.jit(jax.value_and_grad(footprint_mean, (0, 1)))
    value, gradient = both(jnp.ones(3), jnp.zeros(3))
    assert jnp.isnan(value)
    np.testing.assert_array_equal(gradient, np.zeros((2, 3)))
    # A pixel outside the cells leaves the derivatives of the others alone.
    lengths = overlap_lengths(EDGES, jnp.array([0.0, 4000.0, 8000.0]))
    assert jnp.isnan(image_mean(jnp.ones((10, 10)), lengths, lengths)[1, 1])
    corner = jax.jit(jax.grad(lambda x: image_mean(x, lengths, lengths)[0, 0]))
    gradient = corner(jnp.ones((10, 10)))
    np.testing.assert_allclose(gradient, 0.01, rtol=1e-14)


def test_a_cell_without_a_value_spoils_the_pixels_that_see_it_and_no_other():
    lengths = overlap_lengths(EDGES, PIXELS)
    cells = jnp.ones((10, 10)).at[9, 0].set(jnp.nan)
    mean = np.asarray(image_mean(cells, lengths, lengths))
    expected = np.ones((4, 4))
    expected[3, 0] = np.nan
    np.testing.assert_allclose(mean, expected, rtol=1e-14)
    both = jax.jit(jax.value_and_grad(footprint_mean, (0, 1)))
    weights, radiance = jnp.array([1.0, 2.0, 0.0]), jnp.array([3.0, 6.0, jnp.nan])
    value, gradient = both(radiance, weights)
    assert value == 5
    np.testing.assert_allclose(gradient[0], [1 / 3, 2 / 3, 0])
    assert np.isnan(both(radiance, weights.at[2].set(1e-9))[0])


@pytest.mark.float32
def test_float32_stays():
    @jax.jit
    def means(radiance, edges, pixels):
        lengths = overlap_lengths(edges, pixels)
        return image_mean(radiance, lengths, lengths), footprint_mean(radiance[0], lengths[0])

    low = [x.astype(jnp.float32) for x in (jnp.ones((10, 10)), EDGES, PIXELS)]
    for mean in means(*low):
        assert mean.dtype == jnp.float32
        np.testing.assert_allclose(mean, 1, rtol=1e-6)
