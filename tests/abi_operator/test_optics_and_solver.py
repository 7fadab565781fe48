"""Optics and solver in one program: tiles, doublings by what can be read, second derivatives."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from programs import programs_anew
from states import column

from abi_operator import bands_of_states, brf
from abi_operator.machine import batching, sizes

BANDS = ("C01",)
OPTIONS = {"num_streams": 2, "num_modes": 1}


def varied(s):
    """What of a state differs from column to column."""
    return s.atmosphere.plumes["smoke"].brightness, s.albedo["C01"]


def columns(count=20):
    """Columns of two layers whose smoke and ground differ."""
    state = column(num_layers=2)
    smoke = {"smoke": state.atmosphere.plumes["smoke"]}
    state = replace(state, atmosphere=replace(state.atmosphere, plumes=smoke))
    state = jax.tree.map(lambda x: np.stack([np.asarray(x, float)] * count), state)
    vary = np.linspace(0.1, 1.0, count)
    return eqx.tree_at(varied, state, (vary, 0.5 * vary[::-1]))


def test_tiles_do_not_show(monkeypatch):
    """Values and slopes of 20 columns in three tiles of one program are those of one tile.

    And of three chunks of columns that can be read, which are as wide as tiles.
    """
    state = columns()

    def solved(state):
        def total(moved):
            values = brf(eqx.tree_at(varied, state, moved), BANDS, num_doublings=0, **OPTIONS)
            return jnp.sum(values), values

        return jax.grad(total, has_aux=True)(varied(state))

    whole = solved(state)
    tiles = []
    map_tiles = batching.map_tiles

    def watched(function, leaves, width, *others):
        tiles.append((leaves[0].shape[-1], width))
        return map_tiles(function, leaves, width, *others)

    monkeypatch.setattr(batching, "map_tiles", watched)
    monkeypatch.setattr(sizes, "_whole", lambda *_: 1)
    monkeypatch.setattr(sizes, "_SOLVER_TILES", 8)
    for solve, expected in ((jax.jit(lambda s: solved(s)), (20, 8)), (solved, (8, 8))):
        programs_anew(monkeypatch)
        tiles.clear()
        found = solve(state)
        assert set(tiles) == {expected, (8, 64)}  # and the solver's own
        for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(whole), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-18)


@pytest.mark.slow
def test_doublings_are_enough_or_the_column_is_not_a_number():
    """Of a layer of 1800 the value is exact, and slopes are NaN where it cannot be read."""
    state = columns(2)
    mass, number = (np.array(x) for x in jax.tree.leaves(state.atmosphere.liquid))
    mass[1, 1], number[1, 1] = 8.0, 1e13
    cloud = lambda s: (s.atmosphere.liquid.mass_path, s.atmosphere.liquid.number_path)  # noqa: E731
    state = eqx.tree_at(cloud, state, (mass, number))

    def solve(state):
        return brf(state, BANDS, **OPTIONS)[..., 0]

    read, mapped, traced = solve(state), jax.vmap(solve)(state), jax.jit(solve)(state)
    exact = brf(state, BANDS, num_doublings=14, **OPTIONS)[..., 0]
    np.testing.assert_allclose(read, exact, rtol=1e-11)
    np.testing.assert_array_equal(mapped, read)
    np.testing.assert_allclose(traced, exact, rtol=1e-11)
    slopes = jax.jit(jax.grad(lambda s: jnp.sum(solve(s))))(state).albedo[BANDS[0]]
    np.testing.assert_array_equal(np.isnan(slopes), [False, True])


@pytest.mark.slow
def test_second_derivatives():
    """Forward over reverse and reverse over reverse, against differences of the first."""
    state = columns(1)
    point = jnp.asarray([0.4, 0.3])

    def of(x):
        changed = eqx.tree_at(varied, state, (x[:1], x[1:]))
        return brf(changed, BANDS, num_doublings=2, **OPTIONS)[0, 0]

    slope = jax.jit(jax.grad(of))
    step = 1e-5
    expected = np.stack(
        [(slope(point + step * e) - slope(point - step * e)) / (2 * step) for e in np.eye(2)]
    )
    for second in (jax.jacfwd(jax.grad(of)), jax.jacrev(jax.grad(of))):
        np.testing.assert_allclose(jax.jit(second)(point), expected, rtol=1e-6, atol=1e-9)


def test_depths_that_are_read_are_no_reflectances(monkeypatch):
    """One column, of which the value is asked for before its slopes, and after them.

    Both read programs of the same state and settings: one that gives the largest optical depth, by
    which slopes choose their doublings, and one that gives brf. Which of them is read does not
    depend on what is solved: here the light that comes up through all layers.
    """

    def light(columns, arguments, settings):
        return arguments["albedo"] * jnp.exp(-0.1 * jnp.sum(arguments["tau"], axis=1))

    monkeypatch.setattr(bands_of_states, "_terms", light)
    state = column(liquid=0.5, num_layers=2)

    def value():
        return brf(state, BANDS, **OPTIONS)

    def slope():
        return jax.jacrev(lambda s: brf(s, BANDS, **OPTIONS))(state).albedo["C01"]

    found = []
    for order in ((value, slope), (slope, value)):
        programs_anew(monkeypatch)
        found.append({ask.__name__: np.asarray(ask()) for ask in order})
    for name in ("value", "slope"):
        assert found[0][name].shape == (1,) and 0 < found[0][name][0] < 1
        np.testing.assert_allclose(found[0][name], found[1][name], rtol=1e-12)
