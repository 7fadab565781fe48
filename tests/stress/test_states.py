"""A state with a number that cannot be is refused by the name of its field, wherever it stands."""

import jax
import numpy as np
import pytest
from drawn import REPEATABLE
from hypothesis import given, strategies
from states import column, stacked

from abi_operator import check_state
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
