"""Chunks on another device than a CPU: the same way, taken by this CPU."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from heard import Heard

from abi_operator.machine import sizes
from abi_operator.machine.chunks import map_chunks
from abi_operator.machine.listening import listening
from abi_operator.solver import toa_brf

OPTIONS = {"num_streams": 2, "num_modes": 1, "num_doublings": 0}
PLACES = tuple(range(1, 8))


@pytest.fixture
def elsewhere(monkeypatch):
    """A device that takes 64 columns at once."""
    monkeypatch.setattr(sizes, "_SOLVER_ELSEWHERE", {8: 64})
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")


def arguments(size):
    rng = np.random.default_rng(size)
    tau, ssa = rng.uniform(0.01, 1, (size, 3)), rng.uniform(0.5, 1, (size, 3))
    moments = rng.uniform(0.3, 0.8, (size, 3, 1)) ** np.arange(3)
    return tau, ssa, moments, 0.1, rng.uniform(0.2, 1, size), 0.6, rng.uniform(0, 3, size)


MOST = 130
EVERY = arguments(MOST)


def total(weight, *columns):
    brf = toa_brf(*columns, **OPTIONS)
    return jnp.sum(weight * brf), brf


values_and_slopes = jax.value_and_grad(total, argnums=PLACES, has_aux=True)


@pytest.mark.parametrize("size", [3, pytest.param(64, marks=pytest.mark.slow), MOST])
@pytest.mark.parametrize("given", [np.asarray, jnp.asarray])
def test_values_and_slopes_are_those_of_a_cpu(size, given, request):
    """Of a CPU by one program: columns that are not there weigh nothing."""
    weight = np.arange(1.0, MOST + 1)

    def first(columns):
        return jax.tree.map(lambda x: x[:size] if np.ndim(x) else x, columns)

    expected = first(values_and_slopes(np.where(weight <= size, weight, 0), *map(given, EVERY)))
    request.getfixturevalue("elsewhere")
    found = values_and_slopes(weight[:size], *map(given, first(EVERY)))
    for ours, theirs in zip(*map(jax.tree.leaves, (found, expected)), strict=True):
        # Kernels are fused otherwise, and sums taken in another order.
        np.testing.assert_allclose(ours, theirs, rtol=1e-11, atol=1e-13)


def test_a_batch_has_its_shape_again(elsewhere):
    columns = [jnp.asarray(x) for x in arguments(6)]
    inside = [x.reshape(2, 3, *x.shape[1:]) if x.ndim else x for x in columns]
    np.testing.assert_array_equal(
        toa_brf(*inside, **OPTIONS), toa_brf(*columns, **OPTIONS).reshape(2, 3)
    )


def test_another_number_of_columns_is_no_other_program_of_the_solver(elsewhere):
    """To put chunks together is one, which is small."""
    seen = set()

    def solve(arrays):
        seen.add(arrays[0].shape)
        return jnp.asarray(arrays[0])

    for size in (1, 4, 5, 16, 17, 60, 64, 100, 1000):
        widths = sizes.chunks_of_columns(8, np.float64)
        x = np.arange(1.0 * size)
        np.testing.assert_array_equal(map_chunks(solve, "key", [x], [True], (size,), widths), x)
    assert seen == {(4,), (16,), (64,)}


def test_a_listener_is_told_of_every_column(elsewhere):
    heard = Heard()
    with listening(heard):
        map_chunks(lambda x: jnp.asarray(x[0]), "told", [np.ones(77)], [True], (77,), (4, 16))
    assert sum(heard.columns) == 77
