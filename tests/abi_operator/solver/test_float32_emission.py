"""Light that is emitted, in single precision against double, of the same numbers.

Errors are of the strongest source, a level's Planck function: the light itself may be all but none,
where what is warm absorbs nothing.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.solver import toa_radiance

STREAMS, COLUMNS = 4, 128
# Some ten roundings of numbers of order 1, of 6e-8 each.
ROUNDED = 2e-6


def columns(seed, tau, ssa, g):
    """Columns between levels of all temperatures, and no sun."""
    rng = np.random.default_rng(seed)
    levels = 10 ** rng.uniform(0, 4, (COLUMNS, tau.shape[1] + 1))
    albedo = np.where(rng.random(COLUMNS) < 0.5, 1, rng.random(COLUMNS))
    given = {
        "tau": tau,
        "ssa": ssa,
        "moments": g[..., None] ** np.arange(STREAMS + 1),
        "albedo": albedo,
        "mu0": np.full(COLUMNS, 0.6),
        "mu": rng.uniform(0.05, 1, COLUMNS),
        "relative_azimuth": np.zeros(COLUMNS),
        "planck_levels": levels,
        "surface_emission": (1 - albedo) * levels[:, -1],
        "solar_irradiance": np.zeros(COLUMNS),
    }
    return {name: np.asarray(x, np.float32) for name, x in given.items()}


def next_to_conservative(seed=20261128):
    """Layers up to 1e3 thick, of which most absorb nothing and the others next to nothing."""
    rng = np.random.default_rng(seed)
    shape = COLUMNS, 4
    little = np.where(rng.random(shape) < 0.6, 0, 10 ** rng.uniform(-7, -3, shape))
    return columns(seed, 10 ** rng.uniform(-3, 3, shape), 1 - little, rng.uniform(-0.8, 0.9, shape))


def deep_and_absorbing(seed=20261129):
    """A thin layer over one of up to 2e5."""
    rng = np.random.default_rng(seed)
    shape = COLUMNS, 1
    tau = np.concatenate([np.ones(shape), 10 ** rng.uniform(4, 5.3, shape)], axis=1)
    ssa = np.concatenate([np.full(shape, 0.5), rng.uniform(0.05, 0.98, shape)], axis=1)
    g = np.concatenate([np.full(shape, 0.5), rng.uniform(-0.8, 0.9, shape)], axis=1)
    return columns(seed, tau, ssa, g)


def value_and_slopes(given):
    def total(given):
        value = toa_radiance(**given, num_streams=STREAMS)
        return value.sum(), value

    (_, value), slopes = jax.value_and_grad(total, has_aux=True)(given)
    return np.asarray(value), {name: np.asarray(x) for name, x in slopes.items()}


def in_both(function, given):
    single = function({name: jnp.asarray(x) for name, x in given.items()})
    with jax.enable_x64(True):
        return single, function({name: jnp.asarray(x, float) for name, x in given.items()})


@pytest.mark.float32
def test_what_absorbs_nothing_emits_nothing():
    """By the program of a value, by that of slopes, and by that of several views."""
    given = next_to_conservative()
    strongest = given["planck_levels"].max(axis=1)
    alone, exact = in_both(lambda x: np.asarray(toa_radiance(**x, num_streams=STREAMS)), given)
    assert alone.dtype == np.float32 and exact.dtype == np.float64
    (beside, slopes), (_, exact_slopes) = in_both(value_and_slopes, given)
    assert (np.abs(alone - exact) / strongest).max() < ROUNDED
    assert (np.abs(beside - exact) / strongest).max() < ROUNDED
    views = given | {
        name: np.stack([given[name], given[name]], axis=1) for name in ("mu", "relative_azimuth")
    }
    several = np.asarray(toa_radiance(**views, num_streams=STREAMS, multiple_views=True))
    assert (np.abs(several - exact[:, None]) / strongest[:, None]).max() < ROUNDED
    of_levels = [x["planck_levels"] * given["planck_levels"] for x in (slopes, exact_slopes)]
    assert (np.abs(of_levels[0] - of_levels[1]).max(axis=1) / strongest).max() < ROUNDED
    # What little absorption would emit comes through layers of 1e3: depth times rounding.
    wrong = np.abs(slopes["ssa"] - exact_slopes["ssa"]).max(axis=1)
    assert (wrong / np.abs(exact_slopes["ssa"]).max(axis=1)).max() < 1e-2


@pytest.mark.float32
def test_slopes_in_deep_layers_that_absorb():
    """Rounding that is not symmetric would double with every doubling of a layer, up to 1e-2."""
    given = deep_and_absorbing()
    strongest = given["planck_levels"].max(axis=1)
    (_, single), (_, double) = in_both(value_and_slopes, given)
    for name in ("ssa", "moments", "albedo", "planck_levels"):
        wrong = np.abs(single[name] - double[name]).reshape(COLUMNS, -1).max(axis=1)
        assert (wrong / strongest).max() < ROUNDED
