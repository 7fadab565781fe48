"""A state with a number that cannot be is refused by name; what is accepted has a reflectance."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from drawn import REPEATABLE, all_finite, among, array, powers
from hypothesis import given, strategies
from states import column, stacked
from test_optics import columns

from abi_operator import Geometry, Hydrometeor, LiquidCloud, State, brf, check_state
from abi_operator.geometry import is_up
from abi_operator.ranges import FINITE, STATE

STATES = stacked([column(), column(liquid=0.0), column(ash_aod=2.0)])
LEAVES = jax.tree_util.tree_leaves_with_path(STATES)


def field(path):
    """Name of the range of a leaf."""
    names = [str(getattr(key, "name", getattr(key, "key", ""))) for key in path]
    return next((name for name in reversed(names) if name in STATE), "")


@given(strategies.data())
@REPEATABLE
def test_a_number_that_cannot_be_is_refused_by_name(data):
    which = data.draw(strategies.integers(0, len(LEAVES) - 1))
    path, leaf = LEAVES[which]
    allowed = STATE.get(field(path), FINITE)
    wrong = data.draw(
        strategies.one_of(
            strategies.sampled_from([np.nan, np.inf, -np.inf]), strategies.floats(width=64)
        ).filter(lambda x: not allowed.holds(x))
    )
    values = np.array(leaf, float)
    place = data.draw(strategies.integers(0, values.size - 1))
    values.ravel()[place] = wrong
    leaves = [values if i == which else x for i, (_, x) in enumerate(LEAVES)]
    state = jax.tree.unflatten(jax.tree.structure(STATES), leaves)
    with pytest.raises(ValueError) as error:
        check_state(state)
    assert f"state{jax.tree_util.keystr(path)}" in str(error.value)


COUNT, LAYERS, BAND = 6, 2, "C06"
# To just below what is allowed.
MASS, NUMBER = powers(-12, 4, 1e-30, 9e5), powers(-5, 19, 1e-30, 9e19)
TEMPERATURES = 50.1, 9e4  # optics are asked at colder ones too, which no state may have
ZENITH = among(0.0, 1.57, np.pi / 2 - 1e-6, np.pi / 2 - 1e-3, np.pi / 2, 2.0, np.pi)


@strategies.composite
def accepted(draw):
    """States that are allowed, with all that a column can hold; air is that of its heights."""

    def some(numbers, *shape):
        return draw(array(numbers, COUNT * int(np.prod(shape)))).reshape(COUNT, *shape)

    def particles():
        mass, number = some(MASS, LAYERS), some(NUMBER, LAYERS)
        return np.where(number > 0, mass, 0), number

    air = draw(columns(BAND, "ash"))
    has_air = some(among(0.0, 1.0))[:, None] < 0.8
    pressure = np.where(has_air, 1e5 * np.exp(-air.height / 8e3), 0)
    others = {name: Hydrometeor(*particles()) for name in ("ice", "rain")}
    air = type(air)(
        pressure,
        air.height,
        LiquidCloud(*particles()),
        air.plumes,
        np.clip(air.temperature, *TEMPERATURES),
        air.gases,
        others,
        air.background,
    )
    geometry = Geometry(some(ZENITH), some(ZENITH), some(among(-6.28, 6.28, 0.0, np.pi)))
    return State(air, {BAND: some(among(0.0, 1.0))}, geometry)


@jax.jit
def judge(state):
    """Reflectance, its slope in everything at once, and slopes of its sum in each."""

    def light(state):
        return brf(state, (BAND,), num_streams=2, num_doublings=40)[:, 0]

    _, along = jax.jvp(light, (state,), (jax.tree.map(jnp.ones_like, state),))
    found, pull = jax.vjp(light, state)
    return found, along, pull(jnp.ones_like(found))


@pytest.mark.slow
@given(accepted())
@REPEATABLE
def test_what_is_accepted_has_a_reflectance_and_slopes(state):
    """By night, and out of sight, it is NaN with slopes of 0. Single precision is not for all."""
    check_state(state)
    found, *slopes = judge(state)
    seen = [is_up(x) for x in (state.geometry.solar_zenith, state.geometry.view_zenith)]
    np.testing.assert_array_equal(np.isfinite(found), seen[0] & seen[1])
    assert all_finite(jax.tree.leaves(slopes))
