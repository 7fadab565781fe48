"""Sensitivities of any function of the operator's output to any inputs, column by column."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..atmosphere import State
from .inputs import Input, allowed, changed

Function = Callable[[State], Float[Array, "column of"]]
"""From columns, one leading axis on every leaf, to a row of numbers of each column by itself."""

# Share of an input's step over which slopes are differenced for the second order. [-]
_FINE = 0.01


class Sensitivity(NamedTuple):
    """How numbers of columns hang on inputs.

    Parameters
    ----------
    value
        The numbers (column, of).
    inputs
        What the inputs are (column, to).
    jacobian
        Exact derivatives (column, of, to), in the units of the inputs.
    elasticity
        Relative change of a number for a relative change of an input (column, of, to): the
        Jacobian times input over number. Of an input with a `relative` change of its own (an albedo
        in all bands) it is the slope for one share of each of its numbers, over number; of the
        height of a plume, whose edges move by one length, the input is the middle of the plume,
        and its thickness stays. [-]
    up, down
        Exact changes for a step of each input up and down (column, of, to); NaN where the column
        may not be so (a single-scattering albedo above 1).
    second
        Second derivatives (column, of, to, to), differences of exact slopes over a hundredth of the
        first input's step; NaN likewise.
    """

    value: np.ndarray
    inputs: np.ndarray
    jacobian: np.ndarray
    elasticity: np.ndarray
    up: np.ndarray
    down: np.ndarray
    second: np.ndarray


def sensitivity(
    function: Function, states: State, inputs: Sequence[Input], *, second_order: bool = True
) -> Sensitivity:
    """Derivatives, elasticities, finite changes and second derivatives of a function of states.

    Parameters
    ----------
    function
        Of the operator's output: of states with one leading axis, the columns, to a number of each
        or a row of them. Columns must not see each other.
    states
        The columns; one or more.
    inputs
        What to change, each as `inputs.leaf` and its neighbours make it.
    second_order
        Whether second derivatives are wanted: two Jacobians for each input.

    Raises
    ------
    ValueError
        Where there is no input, or the function gives something else.
    """
    if not inputs:
        raise ValueError("there is no input to be sensitive to; name at least one.")
    rows = rows_of(function)
    # Along with the others, since what they change is the same: one program has them all.
    shares = {k: one.relative for k, one in enumerate(inputs) if one.relative is not None}
    by_share = [replace(inputs[k], change=relative(states)) for k, relative in shares.items()]
    value, along = slopes(rows, states, [*inputs, *by_share], None)
    jacobian = along[..., : len(inputs)]
    own = np.stack([np.asarray(one.value(states)) for one in inputs], axis=-1)
    steps = np.array([one.step for one in inputs], value.dtype)
    up, down = (finite_changes(rows, states, inputs, sign * steps, value) for sign in (1, -1))
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = jacobian * own[:, None]
        relative[..., list(shares)] = along[..., len(inputs) :]
        elasticity = relative / value[..., None]
    second = np.full((*jacobian.shape, len(inputs)), np.nan, value.dtype)
    if second_order:
        for k, one in enumerate(inputs):
            second[..., k, :] = _curvature(rows, states, inputs, k, _FINE * one.step)
    return Sensitivity(value, own, jacobian, elasticity, up, down, second)


def rows_of(function: Function) -> Function:
    """The function with a row for each column, also where it gives one number."""

    def rows(states: State) -> Array:
        found = jnp.asarray(function(states))
        columns = states.geometry.solar_zenith.shape[0]
        if found.ndim not in (1, 2) or found.shape[0] != columns:
            raise ValueError(
                f"a function of {columns} columns gives ({columns},) or ({columns}, n) numbers; "
                f"got {found.shape}."
            )
        return found[:, None] if found.ndim == 1 else found

    return rows


def slopes(
    function: Function,
    states: State,
    inputs: Sequence[Input],
    at: Float[np.ndarray, "column to"] | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Value (column, of) and Jacobian (column, of, to) where the inputs are changed.

    Columns do not see each other, so that one direction for each input holds the slopes of all.

    Parameters
    ----------
    function, states, inputs
        As of `sensitivity`, the function with rows.
    at
        Changes of the inputs; None for none.
    """
    zenith = jnp.asarray(states.geometry.solar_zenith)
    shape = zenith.shape[0], len(inputs)
    start = jnp.zeros(shape, zenith.dtype) if at is None else jnp.asarray(at, zenith.dtype)
    value, linear = jax.linearize(lambda by: function(changed(states, inputs, by)), start)
    directions = jnp.eye(len(inputs), dtype=zenith.dtype)
    columns = [np.asarray(linear(jnp.broadcast_to(d, shape))) for d in directions]
    return np.asarray(value), np.stack(columns, axis=-1)


def finite_changes(
    function: Function,
    states: State,
    inputs: Sequence[Input],
    steps: Float[np.ndarray, " to"],
    value: Float[np.ndarray, "column of"],
) -> np.ndarray:
    """Change of a function (column, of, to) for one step of each input by itself."""
    found = np.full((*value.shape, len(inputs)), np.nan, value.dtype)
    for k, step in enumerate(steps):
        by, good = _one_step(states, inputs, k, step)
        moved = np.asarray(function(changed(states, inputs, jnp.asarray(by)))) - value
        found[..., k] = np.where(good[:, None], moved, np.nan)
    return found


def _curvature(
    function: Function, states: State, inputs: Sequence[Input], k: int, step: float
) -> np.ndarray:
    """Difference of Jacobians along one input (column, of, to)."""
    (ahead, may), (behind, might) = (_one_step(states, inputs, k, s) for s in (step, -step))
    good = may & might
    sides = [slopes(function, states, inputs, by * good[:, None])[1] for by in (ahead, behind)]
    return np.where(good[:, None, None], (sides[0] - sides[1]) / (2 * step), np.nan)


def _one_step(
    states: State, inputs: Sequence[Input], k: int, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """A change of one input (column, to), 0 where a column may not be so, and where it may."""
    zenith = np.asarray(states.geometry.solar_zenith)
    by = np.zeros((zenith.shape[0], len(inputs)), zenith.dtype)
    by[:, k] = step
    good = allowed(states, inputs, by)
    return by * good[:, None], good
