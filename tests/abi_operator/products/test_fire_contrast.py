"""Contrast of a fire against its background."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator import Fire, Geometry, State, radiance, standard_atmosphere
from abi_operator.planck import in_band_radiance
from abi_operator.products import fire_contrast, surrounding_mean
from abi_operator.satellites import solar_irradiance

ROUNDING = 1e-12


def test_reflectance_and_radiance_have_the_same_contrast():
    """A fire that adds 0.23 to a background of 0.15, by either quantity (E0 = 76.8 by pi)."""
    observed, background = np.array([0.38, 0.15]), 0.15
    contrast = fire_contrast(observed, background)
    np.testing.assert_allclose(contrast, [0.23 / 0.15, 0], rtol=ROUNDING)
    np.testing.assert_allclose(
        fire_contrast(24.4 * observed, 24.4 * background), contrast, rtol=ROUNDING, atol=1e-15
    )
    slope = jax.grad(fire_contrast)(0.38, 0.15)
    np.testing.assert_allclose(slope, 1 / 0.15, rtol=ROUNDING)


def test_contrast_in_c06_depends_on_the_albedo_of_the_background():
    """A fire of 4 % at 600 K in grounds of five albedos, without air and under a standard one.

    Without air the ground sends back mu0 E0 a / pi and the fire adds p (1 - a) [B(T_f) - B(T_s)].
    """
    albedo, part, hot, ground = jnp.array([0.05, 0.1, 0.2, 0.3, 0.5]), 0.04, 600.0, 300.0
    air = standard_atmosphere("midlatitude_summer", np.linspace(30e3, 0.0, 9))
    nothing = replace(air, pressure=0 * air.pressure, gases=jax.tree.map(jnp.zeros_like, air.gases))

    def state(air, albedo, fraction):
        geometry = Geometry(jnp.asarray(0.6), jnp.asarray(0.5), jnp.asarray(1.0))
        fire = Fire(fraction, jnp.asarray(hot))
        return State(air, {"C06": albedo}, geometry, jnp.asarray(ground), fire)

    columns = [
        state(x, a, jnp.asarray(p)) for x in (nothing, air) for p in (part, 0.0) for a in albedo
    ]
    batch = jax.tree.map(lambda *x: np.stack(x), *columns)
    seen = radiance(batch, ("C06",), num_streams=2, num_modes=1, num_doublings=0).reshape(
        2, 2, albedo.size
    )
    clear, under_air = fire_contrast(seen[:, 0], seen[:, 1])

    flames, earth = (in_band_radiance(jnp.asarray(t), "C06") for t in (hot, ground))
    sunlit = np.cos(0.6) * solar_irradiance("C06") / np.pi * albedo
    expected = part * (1 - albedo) * (flames - earth) / (sunlit + (1 - albedo) * earth)
    np.testing.assert_allclose(clear, expected, rtol=1e-10)
    # Air dims the background twice, on the way down and up, and the fire once; what it sends back
    # itself, 1e-4, shows over the darkest ground.
    assert (under_air > clear).all() and (np.diff(under_air) < 0).all()
    np.testing.assert_allclose(under_air[0] / under_air[-1], clear[0] / clear[-1], rtol=0.01)
    assert under_air[0] / under_air[-1] > 15


def test_background_leaves_the_fire_out():
    field = np.full((9, 11), 0.2)
    fire = np.zeros(field.shape, bool)
    fire[4, 5:7] = True
    field[fire] = 3.0
    background = surrounding_mean(field, fire, 2)
    np.testing.assert_allclose(background, 0.2, rtol=ROUNDING)
    contrast = fire_contrast(field, background)
    np.testing.assert_allclose(contrast[fire], 14, rtol=ROUNDING)
    np.testing.assert_allclose(contrast[~fire], 0, atol=ROUNDING)


def test_mean_is_that_of_a_loop():
    rng = np.random.default_rng(2)
    field, fire = rng.uniform(0.1, 0.4, (2, 7, 8)), rng.uniform(size=(2, 7, 8)) < 0.3
    field[0, 0, 0] = np.nan
    fire[1, :3, :3] = True
    found = surrounding_mean(field, fire, 1)
    for b, y, x in np.ndindex(field.shape):
        box = (b, slice(max(y - 1, 0), y + 2), slice(max(x - 1, 0), x + 2))
        values = field[box][~fire[box] & ~np.isnan(field[box])]
        expected = values.mean() if values.size else np.nan
        np.testing.assert_allclose(found[b, y, x], expected, rtol=ROUNDING)
    assert np.isnan(found[1, 0, 0])
    np.testing.assert_allclose(
        jax.jit(surrounding_mean, static_argnums=2)(field, fire, 1), found, rtol=ROUNDING
    )


def test_derivatives_are_finite_where_all_burns():
    field, fire = jnp.full((3, 3), 0.2, jnp.float32), jnp.ones((3, 3), bool).at[0, 0].set(False)
    slope = jax.jit(jax.grad(lambda x: jnp.nansum(surrounding_mean(x, fire, 1))))(field)
    assert slope.dtype == jnp.float32 and np.isfinite(slope).all()
    assert slope[0, 0] == 4  # seen from four pixels


def test_wrong_arguments_are_refused():
    with pytest.raises(ValueError, match="half_width=0"):
        surrounding_mean(np.zeros((2, 2)), np.zeros((2, 2), bool), 0)
    with pytest.raises(ValueError, match=r"axes y and x; got a field of shape \(2,\)"):
        surrounding_mean(np.zeros(2), np.zeros(2, bool))


@pytest.mark.parametrize("kind", [np.uint8, np.int8, np.int64])
def test_a_mask_of_numbers_is_one_of_truths(kind):
    rng = np.random.default_rng(5)
    field, fire = rng.uniform(0.1, 0.3, (6, 7)), rng.random((6, 7)) < 0.3
    expected = surrounding_mean(field, fire, 1)
    np.testing.assert_array_equal(surrounding_mean(field, fire.astype(kind), 1), expected)
