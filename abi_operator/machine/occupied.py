"""Rows of arrays that nothing is in are not computed: few layers of a tile hold any cloud at all.

Which rows are occupied is data, read while a program runs: a scan over the rows branches at each.
What is mapped over by `jax.vmap` shares one answer, that of all of its columns together, so that
the branch stays one. Backwards a row is computed again when its turn comes, in the cache: nothing
is kept of it. A function of rows that calls another one of rows has it branch within its own loop.
Where several devices share a program, and not each its own columns by `jax.shard_map`, each answer
waits for all of them. Another device than a CPU has all rows at once (`backend`): a step of a loop
takes it as long as all of them, and of thousands of columns some are everywhere.
"""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool

from .backend import on_cpu
from .plain import is_plain

Present = Bool[Array, ""] | None


def row_by_row(
    function: Callable[[Any, list[Present]], Any],
    by_row: Any,
    there: Sequence[Bool[Array, "row *batch"] | None],
) -> Any:
    """``function(by_row, present)``, a row at a time.

    Parameters
    ----------
    function
        Of arrays whose first axis is that of rows, to a tree of such arrays, every row by itself
        (a single one is not looped over); and of whether each of some things is in these rows, for
        `if_present`.
    by_row
        Its first argument.
    there
        Where each of those things is; None for everywhere.
    """
    if is_plain() or not on_cpu():
        return function(by_row, [None] * len(there))
    occupied = [None if x is None else _anywhere(x) for x in there]
    if len(jax.tree.leaves(by_row)[0]) == 1:
        return function(by_row, [None if x is None else x[0] for x in occupied])

    def one(_: None, row: tuple[Any, list[Present]]) -> tuple[None, Any]:
        own, present = row
        found = function(jax.tree.map(lambda x: x[None], own), present)
        return None, jax.tree.map(lambda x: x[0], found)

    return jax.lax.scan(jax.checkpoint(one), None, (by_row, occupied))[1]


def if_present(present: Present, function: Callable[..., Any], *args: Any) -> Any:
    """``function(*args)`` where what it is of is present, or nobody knows; else 0."""
    if present is None:
        return function(*args)
    shapes = jax.eval_shape(function, *args)

    def nothing(*_: Any) -> Any:
        return jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), shapes)

    return jax.lax.cond(present, function, nothing, *args)


def _anywhere(there: Bool[Array, "row *batch"]) -> Bool[Array, " row"]:
    """Whether anything is in a row of any column."""
    return _of_all(jnp.any(there.reshape(there.shape[0], -1), axis=1))


@jax.custom_batching.custom_vmap
def _of_all(occupied: Bool[Array, " row"]) -> Bool[Array, " row"]:
    return occupied


@_of_all.def_vmap
def _(axis_size: int, in_batched: list[bool], occupied: Bool[Array, "axis row"]) -> Any:
    return _of_all(jnp.any(occupied, axis=0)), False
