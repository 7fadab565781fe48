"""What a state is changed in, by declaration: a name, a place, a step, and how a change is made.

A place is a path of fields and keys, such as ``"albedo.C03"`` or ``"atmosphere.plumes.ash.ssa"``;
it ends at a leaf or at a part of the state, all leaves of which are changed alike. `leaf` adds to
them and `factor` multiplies them; what is no leaf (an optical depth) is an `Input` of its own, and
`several` changes leaves at several places (the base and the top of a plume). Those that have short
names are in `declarations`. A ground that reflects unevenly has leaves that are no albedo: that of
any ground is `ground_albedo.albedo`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..atmosphere import State
from ..ranges import STATE, Range


@dataclass(frozen=True)
class Input:
    """A number that every column is changed by.

    Parameters
    ----------
    name, units, long_name
        Of the change; units as in CF.
    step
        Of finite changes, and its standard deviation where nobody says another; in the unit.
    change
        From a state and a change of each column to the changed state; 0 changes nothing.
    value
        From a state to what the change is added to, in the unit: of several numbers their mean.
    holds
        From a changed state to whether each column may be so.
    relative
        From a state to a change of it, as ``change``, by a share of each number and not by one
        number for all; None where the input is one number, where what is changed is a share
        already, and where several numbers are moved together and a share of each would pull them
        apart (the edges of a plume).
    """

    name: str
    units: str
    long_name: str
    step: float
    change: Callable[[State, Array], State]
    value: Callable[[State], Array]
    holds: Callable[[State], np.ndarray]
    relative: Callable[[State], Callable[[State, Array], State]] | None = None

    def stepping(self, step: float) -> "Input":
        """The same with another step."""
        if not 0 < step < math.inf:
            raise ValueError(f"a step is above 0 and finite; got {step} for {self.name}.")
        return replace(self, step=float(step))


def part(state: State, place: str) -> Any:
    """The part of a state at a place, or `ValueError` with what there is instead."""

    def inside(node: Any, key: str) -> Any:
        names = list(node) if isinstance(node, Mapping) else list(vars(node))
        found = node.get(key) if isinstance(node, Mapping) else getattr(node, key, None)
        if found is None:
            raise ValueError(f"the state has no {place}: instead of {key!r} there is {names}.")
        return found

    return reduce(inside, place.split("."), state)


def leaf(
    place: str,
    step: float,
    *,
    name: str | None = None,
    units: str | None = None,
    long_name: str | None = None,
    scale: float = 1.0,
) -> Input:
    """What is added to every number at a place.

    Parameters
    ----------
    place
        Path to the part of the state.
    step
        As of `Input`.
    name, units, long_name
        By default the place, and the unit of its quantity.
    scale
        Size of the unit in that of the state, such as that of a degree in radians.
    """
    found = several((place,), added, step, name or place, units, long_name, scale)
    by_share = factor(place, step).change
    return replace(found, relative=lambda _state: by_share)


def factor(
    place: str, step: float, *, name: str | None = None, long_name: str | None = None
) -> Input:
    """Relative change of every number at a place; its value is 1."""
    words = long_name or f"relative change of {place}"
    found = several((place,), _multiplied, step, name or place, "1", words, 1.0)
    return replace(found, value=_one)


def several(
    places: tuple[str, ...],
    how: Callable[[Array, Array], Array],
    step: float,
    name: str,
    units: str | None,
    long_name: str | None,
    scale: float,
) -> Input:
    """What is added to, or multiplies, every number at several places; see `leaf`.

    Parameters
    ----------
    places
        Paths, of quantities that may be what the first one may be.
    how
        From numbers and changes to new numbers.
    step, name, units, long_name, scale
        As of `leaf`.
    """
    allowed = _range_of(places[0])

    def change(state: State, by: Array) -> State:
        for place in places:
            new = jax.tree.map(lambda x: how(x, scale * by), part(state, place))
            state = eqx.tree_at(lambda s, place=place: part(s, place), state, new)
        return state

    def value(state: State) -> Array:
        leaves = [_by_column(x) for place in places for x in jax.tree.leaves(part(state, place))]
        return jnp.mean(jnp.concatenate(leaves, axis=-1), axis=-1) / scale

    def holds(state: State) -> np.ndarray:
        leaves = [x for place in places for x in jax.tree.leaves(part(state, place))]
        return np.all([np.all(allowed.holds(np.asarray(_by_column(x))), -1) for x in leaves], 0)

    words = long_name or f"change of {' and '.join(places)}"
    return Input(name, units or allowed.unit, words, step, change, value, holds)


def changed(state: State, inputs: Sequence[Input], by: Float[Array, "column to"]) -> State:
    """A state with all changes made, one after the other.

    Parameters
    ----------
    state
        Columns, one leading axis on every leaf.
    inputs
        What to change.
    by
        Changes, in the units of the inputs.
    """
    for k, one in enumerate(inputs):
        state = one.change(state, by[:, k])
    return state


def allowed(
    state: State, inputs: Sequence[Input], by: Float[Array | np.ndarray, "column to"]
) -> np.ndarray:
    """Whether each column may be changed so (column,)."""
    new = changed(state, inputs, jnp.asarray(by))
    return np.all([one.holds(new) for one in inputs], axis=0)


def _range_of(place: str) -> Range:
    """Allowed values of a quantity, by the last name in its place that has a range."""
    known = [name for name in place.split(".") if name in STATE]
    if not known:
        return Range(-np.inf, np.inf, "()")
    return STATE[known[-1]]


def _by_column(x: Any) -> Any:
    """The numbers of each column side by side."""
    return jnp.reshape(x, (jnp.shape(x)[0], -1))


def _beside(by: Array, x: Array) -> Array:
    return jnp.reshape(by, by.shape + (1,) * (jnp.ndim(x) - by.ndim))


def added(x: Array, by: Array) -> Array:
    """Numbers and changes of each column beside each other."""
    return x + _beside(by, x)


def _multiplied(x: Array, by: Array) -> Array:
    return x * (1 + _beside(by, x))


def _one(state: State) -> Array:
    return jnp.ones_like(state.geometry.solar_zenith)
