"""Columns with values in chunks of a few sizes: few programs, whatever the number of columns."""

import threading

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from heard import Heard

from abi_operator.machine.chunks import begin_chunks, map_chunks
from abi_operator.machine.cutting import cut
from abi_operator.machine.listening import listening
from abi_operator.machine.processor import usable_cores
from abi_operator.solver import toa_brf

WIDTHS = 8, 64, 512


@pytest.mark.parametrize("num_cores", [1, 2, 3])
def test_chunks_cover_all_columns_and_few_twice(num_cores):
    for size in [*range(1, 1200), 2048, 4999, 100_000]:
        chunks = cut(size, WIDTHS, num_cores)
        solved = np.concatenate([np.arange(s, s + w) for s, w in chunks])
        np.testing.assert_array_equal(np.unique(solved), np.arange(max(size, solved.max() + 1)))
        assert all(width in WIDTHS and start >= 0 for start, width in chunks)
        # Only fewer columns than one chunk has are filled up; else the last chunk begins earlier.
        assert len(chunks) == 1 or solved.max() == size - 1
        assert solved.size - size < max(64, 0.07 * size)
        assert len({width for _, width in chunks}) <= 2


def test_cores_share_the_columns_evenly():
    for size in (WIDTHS[-1], 1000, 2048, 5000, 100_000):
        # Each takes the next chunk as soon as it is done.
        busy = np.zeros(2)
        for _, width in cut(size, WIDTHS, 2):
            busy[np.argmin(busy)] += width
        assert busy.max() < 1.1 * size / 2


def test_few_columns_are_shared_and_not_filled_up():
    """A chunk begins and ends in the time of half of 64 columns: rounds of two are counted so."""
    for size, width in ((5, 8), (20, 8), (40, 64), (100, 64), (300, 64), (600, 64), (1000, 512)):
        assert cut(size, WIDTHS, 2) == [
            (max(0, min(k, size - width)), width) for k in range(0, size, width)
        ]


@pytest.mark.parametrize("size", [1, 3, 8, 11, 64, 65, 130, 700])
def test_results_are_those_of_all_columns_at_once(size):
    x = np.arange(2.0 * size).reshape(size, 2)
    seen = set()

    def function(arrays):
        mine, shared = arrays
        seen.add(len(mine))
        return {"sum": jnp.asarray(mine).sum(axis=1) + shared[0], "all": jnp.asarray(mine)}

    found = map_chunks(function, "key", [x, np.ones(1)], [True, False], (size,), WIDTHS)
    np.testing.assert_array_equal(found["sum"], x.sum(axis=1) + 1)
    np.testing.assert_array_equal(found["all"], x)
    assert seen <= set(WIDTHS)


def test_columns_of_two_chunks_are_those_of_the_later_one(monkeypatch):
    """Whichever is done last: chunks of a new width are solved first, one of each width.

    And of a pool of threads the last one may be the first to be done.
    """

    def function(arrays):
        return jnp.broadcast_to(arrays[0][0], arrays[0].shape)

    size = 128 * usable_cores() + 5  # more chunks than cores
    chunks = cut(size, (8, 64), usable_cores())
    call = function, "later", [np.arange(1.0 * size)], [True], (size,), (8, 64)
    firsts = [start for start, _ in chunks]
    expected = np.repeat(1.0 * np.array(firsts), np.diff([*firsts, size]))
    assert chunks[-1] == (size - 8, 8) and sum(width for _, width in chunks) > size
    np.testing.assert_array_equal(map_chunks(*call), expected)
    monkeypatch.setattr("abi_operator.machine.chunks.threads", Backwards)
    np.testing.assert_array_equal(map_chunks(*call), expected)


class Backwards:
    """Threads of which the last is done first."""

    def map(self, function, items):
        return [function(x) for x in reversed(items)][::-1]


def test_the_batch_has_its_shape_again():
    found = map_chunks(
        lambda x: 2 * jnp.asarray(x[0]), "key", [np.arange(6.0)], [True], (2, 3), (4,)
    )
    np.testing.assert_array_equal(found, 2 * np.arange(6.0).reshape(2, 3))


@pytest.mark.parametrize("size", [1, 8, 11, 64, 128])
def test_what_is_begun_is_not_what_the_caller_goes_on_with(size):
    x, seen = np.arange(2.0 * size).reshape(size, 2), []

    def function(arrays):
        seen.append(arrays)
        return jnp.asarray(arrays[0]).sum(axis=1) + arrays[1][0]

    shared = np.ones(1)
    begun = begin_chunks(function, "begun", [x, shared], [True, False], (size,), (8, 64))
    if begun is None:  # fewer cores than chunks
        assert size >= 64
        return
    counts, found = begun
    columns = np.concatenate([np.asarray(part)[:n] for n, part in zip(counts, found, strict=True)])
    np.testing.assert_array_equal(columns, x.sum(axis=1) + 1)
    assert not any(np.shares_memory(a, b) for a in (x, shared) for some in seen for b in some)


def arguments(size):
    rng = np.random.default_rng(size)
    tau, ssa = rng.uniform(0.01, 1, (size, 3)), rng.uniform(0.5, 1, (size, 3))
    moments = rng.uniform(0.3, 0.8, (size, 3, 1)) ** np.arange(3)
    return tau, ssa, moments, 0.1, rng.uniform(0.2, 1, size), 0.6, rng.uniform(0, 3, size)


OPTIONS = {"num_streams": 2, "num_modes": 1, "num_doublings": 0}


def test_another_number_of_columns_is_no_other_program():
    compiled = []
    name = "/jax/core/compile/backend_compile_duration"

    def listen(event, _, **__):
        if event == name:
            compiled.append(event)

    # It stays: older JAX has no function to take one away.
    jax.monitoring.register_event_duration_secs_listener(listen)
    for size in (5, 64, 512 * usable_cores(), 1024 * usable_cores()):
        toa_brf(*arguments(size), **OPTIONS)
    before = len(compiled)
    for size in (1, 2, 7, 9, 100, 511, 512, 513, 700, 1030, 2000):
        assert toa_brf(*arguments(size), **OPTIONS).shape == (size,)
    assert before >= 4 and len(compiled) == before


def total(weight, *columns):
    return jnp.sum(weight * toa_brf(*columns, **OPTIONS))


PLACES = tuple(range(1, 8))
MOST = 600
# One program for any number of columns: those that are not there weigh nothing.
inside_jit = jax.jit(jax.value_and_grad(total, argnums=PLACES))


@pytest.mark.parametrize(
    "size", [*(pytest.param(n, marks=pytest.mark.slow) for n in (5, 100)), MOST]
)
def test_values_and_slopes_are_those_inside_jit(size):
    every = [jnp.asarray(x) for x in arguments(MOST)]
    columns = [x[:size] if x.ndim else x for x in every]
    outside = jax.value_and_grad(total, argnums=PLACES)(jnp.ones(size), *columns)
    inside = inside_jit(jnp.asarray(np.arange(MOST) < size, float), *every)
    for ours, theirs in zip(*map(jax.tree.leaves, (outside, inside)), strict=True):
        own = theirs[:size] if theirs.ndim else theirs
        # Vectors of another width are summed in another order.
        np.testing.assert_allclose(ours, own, rtol=1e-11, atol=1e-13)


def test_threads_of_the_caller_get_the_same_numbers():
    columns = arguments(700)
    expected = np.asarray(toa_brf(*columns, **OPTIONS))
    found = {}

    def solve(k):
        # Precision is a setting of a thread.
        with jax.enable_x64(expected.dtype == np.float64):
            found[k] = np.asarray(toa_brf(*columns, **OPTIONS))

    threads = [threading.Thread(target=solve, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4
    for values in found.values():
        np.testing.assert_array_equal(values, expected)


def test_nothing_is_cut_where_the_caller_says_what_runs_where():
    columns = arguments(20)
    with jax.default_device(jax.local_devices()[0]):
        found = toa_brf(*columns, **OPTIONS)
    np.testing.assert_allclose(found, toa_brf(*columns, **OPTIONS), rtol=1e-12)


@pytest.mark.parametrize("size", [5, 64, 3000])
def test_a_listener_is_told_of_every_column_and_of_what_is_compiled(size):
    """Of those that are solved twice, once."""
    heard, later = Heard(), Heard()
    call = (
        lambda x: jnp.asarray(x[0]),
        f"told of {size}",
        [np.arange(1.0 * size)],
        [True],
        (size,),
    )
    with listening(heard):
        map_chunks(*call, WIDTHS)
    with listening(later):
        map_chunks(*call, WIDTHS)
    map_chunks(*call, WIDTHS)
    assert sum(heard.columns) == size and len(heard.columns) == len(later.columns)
    assert set(heard.compiled) == {True, False} and later.compiled == []
