"""Arguments of the solver's door in any shapes that broadcast, empty ones too."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn import REPEATABLE
from hypothesis import given, settings, strategies

from abi_operator.solver import toa_brf

LAYERS, STREAMS = 2, 2
OWN = {"tau": (LAYERS,), "ssa": (LAYERS,), "moments": (LAYERS, STREAMS + 1), "albedo": ()}
OWN |= {"mu0": (), "mu": (), "relative_azimuth": ()}
solve = partial(toa_brf, num_streams=STREAMS)


@strategies.composite
def shapes(draw):
    """Of each argument what is left of one batch, axes of which may be 1 or, leading, missing."""
    batch = draw(strategies.lists(strategies.integers(0, 3), max_size=3))
    kept = {name: [1 if draw(strategies.booleans()) else x for x in batch] for name in OWN}
    return {name: tuple(x[draw(strategies.integers(0, len(batch))) :]) for name, x in kept.items()}


def columns(batch, seed):
    """Numbers of these shapes."""
    rng = np.random.default_rng(seed)
    found = {name: rng.uniform(0.1, 1, batch[name] + own) for name, own in OWN.items()}
    return found | {"moments": found["moments"][..., :1] ** np.arange(STREAMS + 1)}


def total(given):
    """Of which every column's slope is another."""
    return jnp.sum(jnp.sin(3 * solve(**given)))


def summed(slope, shape):
    """A slope of all columns as that of an argument which several of them share."""
    slope = slope.sum(axis=tuple(range(slope.ndim - len(shape))))
    shared = tuple(i for i, size in enumerate(shape) if size == 1)
    return slope.sum(axis=shared, keepdims=True)


@pytest.mark.slow
def test_shapes_that_broadcast_give_what_each_column_gives(scale):
    @given(shapes(), strategies.integers(0, 2**31))
    @settings(REPEATABLE, max_examples=max(10, round(300 * scale)))
    def of(batch, seed):
        given, whole = columns(batch, seed), np.broadcast_shapes(*batch.values())
        one_each = {
            name: np.broadcast_to(x, whole + OWN[name]).reshape(-1, *OWN[name])
            for name, x in given.items()
        }
        found, slopes = solve(**given), jax.grad(total)(given)
        expected, each = solve(**one_each), jax.grad(total)(one_each)
        assert found.shape == whole
        # What columns share is compiled otherwise, and rounded otherwise.
        np.testing.assert_allclose(np.ravel(found), expected, rtol=1e-13)
        for name, x in given.items():
            right = summed(np.reshape(each[name], whole + OWN[name]), x.shape)
            np.testing.assert_allclose(slopes[name], right, rtol=1e-10, atol=1e-13)

    of()
