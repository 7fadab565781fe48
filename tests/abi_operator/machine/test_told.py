"""Columns whose value is told at once, and the others, which are put together and solved."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.machine.batching import map_tiles, tile_by_tile

WIDTH = 8


def glance(columns):
    """Tells the first number of columns whose second is below 0."""
    return {"light": columns[0], "twice": 2 * columns[:1]}, columns[1] < 0


def solved(columns):
    """What a glance does not tell apart: 100 more."""
    light = columns[0] + 100
    return {"light": light, "twice": 2 * light[None]}


def columns(size, share):
    """So many columns, of which about that share is told."""
    rng = np.random.default_rng(size)
    return np.stack([np.arange(1.0, size + 1), rng.random(size) - share])


@partial(jax.jit, static_argnums=1)
def told_or_solved(given, in_order):
    return map_tiles(solved, given, WIDTH, (lambda x: -x[0]) if in_order else None, glance)


@pytest.mark.parametrize("size", [5, 8, 9, 64, 100])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 1.0])
@pytest.mark.parametrize("in_order", [False, True])
def test_columns_that_are_told_keep_their_value(size, share, in_order):
    given = columns(size, share)
    found = told_or_solved(given, in_order)
    wanted = given[0] + np.where(given[1] < 0, 0, 100)
    np.testing.assert_array_equal(found["light"], wanted)
    np.testing.assert_array_equal(found["twice"], 2 * wanted[None])


def test_only_the_others_are_solved():
    """As many tiles as they fill, by what each tile says of itself; two of them for 11 of 64."""
    given = np.stack([np.zeros(64), np.where(np.arange(64) % 6 == 1, 1.0, -1.0)])
    others = int(np.sum(given[1] > 0))
    tiles = []

    def counted(x):
        jax.debug.callback(lambda: tiles.append(1))
        return x[0] + 1

    found = jax.jit(lambda x: map_tiles(counted, x, WIDTH, None, lambda x: (x[0], x[1] < 0)))(given)
    jax.effects_barrier()
    assert int(found.sum()) == others
    assert len(tiles) == -(-others // WIDTH)


@pytest.mark.parametrize("size", [WIDTH, 3 * WIDTH])
def test_neighbours_in_need_are_solved_together(size):
    """Each column gets the largest number of its tile: in order that is a near one."""
    given = np.random.default_rng(0).permutation(size).astype(float)

    @jax.jit
    def solve(given):
        def largest(x):
            return jnp.max(x) + 0 * x

        return map_tiles(largest, given, WIDTH, lambda x: x, lambda x: (x, x < 0))

    found = solve(given)
    np.testing.assert_array_equal(found, WIDTH * (given // WIDTH) + WIDTH - 1)


@jax.jit
def those_in_need(given):
    return map_tiles(
        lambda x: 0 * x[1] + 5, given, WIDTH, lambda x: x[0], lambda x: (x[1], x[1] < 0)
    )


@pytest.mark.parametrize("need", [np.nan, np.inf])
def test_what_is_not_told_is_solved_whatever_it_needs(need):
    told = np.arange(5 * WIDTH) % 7 != 0
    given = np.stack([np.where(told, 1.0, need), np.where(told, -1.0, 1.0)])
    found = those_in_need(given)
    np.testing.assert_array_equal(found, np.where(told, -1, 5))


def test_derivatives_of_a_tile_are_those_of_what_is_solved():
    def light(x):
        return jnp.sum(tile_by_tile(lambda x: x[0] ** 2, [x], [0], WIDTH, at_once=told))

    def told(leaves):
        return leaves[0], leaves[0] > 0

    x = jnp.arange(1.0, WIDTH)
    assert light(x) == x.sum()
    np.testing.assert_array_equal(jax.grad(light)(x), 2 * x)
