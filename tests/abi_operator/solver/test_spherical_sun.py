"""A sun through a sphere in single precision, and within a budget that is spent on it.

What isotropic light would lose in a layer is its co-albedo but at the sun, whose secant there is
not 1 / mu0 (`solver.method.absorption`).
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.solver import slant_path_secant, toa_albedo, toa_brf, toa_radiance

STREAMS, LAYERS, COLUMNS = 6, 4, 48
# Some ten roundings of numbers of order 1, of 6e-8 each; slopes of heat in what hardly absorbs are
# as many times as large as its depth of 1e3.
VALUE, SLOPES = 5e-6, 5e-4
FLOOR = 1e-2


def columns(bent=True):
    """Half of them thick and next to conservative; suns from 88 degrees up. Rounded to single."""
    rng = np.random.default_rng(20261130)
    shape = COLUMNS, LAYERS
    deep = (np.arange(COLUMNS) % 2 == 0)[:, None]
    tau = 10 ** np.where(deep, rng.uniform(0, 3, shape), rng.uniform(-3, 0.5, shape))
    little = np.where(rng.random(shape) < 0.5, 0, 10 ** rng.uniform(-6, -3, shape))
    g = rng.uniform(-0.5, 0.85, shape)
    mu0 = np.cos(np.deg2rad(rng.uniform(0, 88, COLUMNS)))
    height = -np.sort(-rng.uniform(0, 1e5, (COLUMNS, LAYERS + 1)))
    with jax.enable_x64(True):
        secant = slant_path_secant(jnp.asarray(height), jnp.asarray(mu0))
    given = {
        "tau": tau,
        "ssa": np.where(deep, 1 - little, rng.uniform(0.5, 1, shape)),
        "moments": g[..., None] ** np.arange(STREAMS + 1),
        "albedo": rng.choice([0, 0.3, 1], COLUMNS),
        "mu0": mu0,
        "mu": rng.uniform(0.05, 1, COLUMNS),
        "relative_azimuth": rng.uniform(0, np.pi, COLUMNS),
        "secant": secant if bent else 1 / mu0[:, None] + 0 * tau,
    }
    return {name: np.asarray(x, np.float32) for name, x in given.items()}


def brf(given, **how):
    return toa_brf(**given, num_streams=STREAMS, **how)


def radiance(given, **how):
    """Of the sun and of warm layers, all of order 1."""
    levels = jnp.linspace(1, 2, LAYERS + 1, dtype=given["tau"].dtype)
    heat = {"planck_levels": levels, "surface_emission": 1 - given["albedo"]}
    given = given | heat | {"solar_irradiance": jnp.asarray(3, levels.dtype)}
    return toa_radiance(**given, num_streams=STREAMS, **how)


def albedo(given):
    """The sun's, through the program that is differentiated by JAX alone."""
    names = ("tau", "ssa", "moments", "albedo", "mu0", "secant")
    return toa_albedo(**{name: given[name] for name in names}, num_streams=STREAMS)


def value_and_slopes(door, given, **how):
    def total(given):
        value = door(given, **how)
        return jnp.sum(value), value

    (_, value), slopes = jax.value_and_grad(total, has_aux=True)(given)
    return np.asarray(value), {name: np.asarray(x) for name, x in slopes.items()}


def doubled(given):
    return {name: np.asarray(x, np.float64) for name, x in given.items()}


def assert_slopes(found, wanted, light, within):
    """Of the largest in an argument, or of the light where that is more."""
    for name, right in wanted.items():
        wrong, size = (abs(x).reshape(COLUMNS, -1) for x in (found[name] - right, right))
        assert np.max(wrong.max(axis=1) / np.maximum(size.max(axis=1), light)) < within, name


@pytest.mark.float32
@pytest.mark.parametrize("door", [brf, radiance, albedo])
@pytest.mark.parametrize("bent", [True, False])
def test_single_precision_is_as_near_as_on_a_plane(door, bent):
    given = columns(bent)
    alone = np.asarray(door(given))
    value, slopes = value_and_slopes(door, given)
    assert alone.dtype == value.dtype == np.float32
    with jax.enable_x64(True):
        right, wanted = value_and_slopes(door, doubled(given))
    light = np.maximum(right, FLOOR)
    for found in (alone, value):
        assert np.max(abs(found - right) / light) < VALUE
    assert_slopes(slopes, wanted, light, SLOPES)


def test_a_budget_is_kept():
    """It is solved in single precision, with layers merged."""
    given = doubled(columns())
    right, wanted = value_and_slopes(brf, given)
    within, slopes = value_and_slopes(brf, given, error_budget=1e-3)
    light = np.maximum(right, FLOOR)
    for found in (np.asarray(brf(given, error_budget=1e-3)), within):
        assert np.max(abs(found - right) / light) < 1e-3
    of_all = [
        np.concatenate([x.reshape(COLUMNS, -1) for x in y.values()], axis=1)
        for y in (slopes, wanted)
    ]
    wrong = np.linalg.norm(of_all[0] - of_all[1], axis=1) / np.linalg.norm(of_all[1], axis=1)
    assert np.max(wrong) < 0.01


def cold(given, **how):
    """Reflectances, by the program of columns that emit."""
    sun = np.pi / given["mu0"]
    levels = np.zeros((COLUMNS, LAYERS + 1))
    how = how | {"num_streams": STREAMS, "planck_levels": levels}
    return toa_radiance(**given, solar_irradiance=sun, **how)


@pytest.mark.parametrize("door", [brf, cold])
def test_layers_are_merged_as_a_sun_sees_them_that_is_higher(door):
    """A hundred times as much of its light, over mu0, is scattered as of one that is on the horizon
    of a plane, and as much of that is lost by as large a mistake."""
    rng = np.random.default_rng(5)
    upper = 10 ** rng.uniform(-0.5, 0.5, (COLUMNS, 1))
    given = doubled(columns()) | {
        "tau": np.hstack([upper, 10 ** rng.uniform(-2, 0.5, (COLUMNS, LAYERS - 1))]),
        "ssa": rng.uniform(0.5, 1, (COLUMNS, LAYERS)),
        "moments": rng.uniform(0, 0.8, (COLUMNS, LAYERS, 1)) ** np.arange(STREAMS + 1),
        "phase_function": np.full((COLUMNS, LAYERS), 40.0),
        "mu0": 10 ** rng.uniform(-3, -2, COLUMNS),
        "mu": rng.uniform(0.02, 0.1, COLUMNS),
        "secant": rng.uniform(6, 8, (COLUMNS, 1)) * np.linspace(1, 2, LAYERS),
    }
    right, within = (np.asarray(door(given, error_budget=x)) for x in (None, 1e-3))
    wrong = abs(within / right - 1)
    assert 0 < np.max(wrong) < 1e-3
