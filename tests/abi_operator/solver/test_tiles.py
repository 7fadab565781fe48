"""How many columns the solver asks its door to take together."""

import jax.numpy as jnp
import pytest

from abi_operator.solver import door
from abi_operator.solver.column import Column
from abi_operator.solver.settings import Settings

COUNT, STREAMS = 3, 8


@pytest.mark.parametrize("num_layers", [1, 2])
def test_slopes_of_a_layer_that_is_the_only_one_take_more_columns(num_layers, monkeypatch):
    """As many as `sizes.tile_size` says of it; values of it do not."""
    monkeypatch.setattr(door, "enter", lambda program, leaves: (program, leaves))
    layers, each = jnp.full((COUNT, num_layers), 0.5), jnp.full(COUNT, 0.5)
    moments = jnp.ones((COUNT, num_layers, STREAMS + 1)) * 0.5 ** jnp.arange(1.0 * STREAMS + 1)
    column = Column(layers, layers, moments, each, each, each, each)
    program, leaves = door.solve(lambda *_: None, column, Settings(num_streams=STREAMS))
    asked = {what: program.tile(leaves, what) for what in ("value", (True,) * len(leaves))}
    usual = door.tile_size(STREAMS, layers.dtype)
    alone = door.tile_size(STREAMS, layers.dtype, alone=num_layers == 1)
    assert list(asked.values()) == [usual, alone]
