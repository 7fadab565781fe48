"""Columns whose value is told at once, and the others, tile by tile.

A program may know the value of some columns from a glance (`program.Program.at_once`). Where a
batch has several tiles, all columns are glanced at and only the others are put together to tiles
and solved: how many tiles there are is a number that the loop over them reads. A batch of one tile
is solved whole where the glance does not tell all of its columns; so is every tile of several CPU
devices, each of which has its own columns, and of plain JAX, of which derivatives may be taken:
those are always of what is solved.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Bool

AtOnce = Callable[[Any], tuple[Any, Bool[Array, " batch"]]]
"""Maps columns, whose batch is last, to their values and to whether these may stand."""


def unless_told(function: Callable[[Any], Any], at_once: AtOnce | None) -> Callable[[Any], Any]:
    """`function` of a tile of columns, but where all are told; derivatives are those of it."""
    return function if at_once is None else partial(_unless_told, function, at_once)


@partial(jax.custom_jvp, nondiff_argnums=(0, 1))
def _unless_told(function, at_once, columns):
    found, told = at_once(columns)

    def solved(columns):
        return jax.tree.map(partial(jnp.where, told), found, function(columns))

    return jax.lax.cond(jnp.all(told), lambda _: found, solved, columns)


@partial(_unless_told.defjvp, symbolic_zeros=True)
def _unless_told_jvp(function, _at_once, primals, tangents):
    columns, structure = jax.tree.flatten(primals[0])
    changes = jax.tree.leaves(tangents[0])
    moving = [k for k, x in enumerate(changes) if not isinstance(x, SymbolicZero)]

    def of_moving(some):
        every = list(columns)
        for k, x in zip(moving, some, strict=True):
            every[k] = x
        return function(jax.tree.unflatten(structure, every))

    return jax.jvp(of_moving, ([columns[k] for k in moving],), ([changes[k] for k in moving],))


class Glance(NamedTuple):
    """What is told of columns, of which it may stand, and a number by which they are solved, those
    last that are told."""

    found: Any
    told: Bool[Array, "batch"]
    place: Array


def glanced(columns: Any, at_once: AtOnce, need: Callable[[Any], Array] | None) -> Glance:
    """Glance at a tile.

    Parameters
    ----------
    columns, need
        As in `batching.map_tiles`.
    at_once
        Tells.
    """
    found, told = at_once(columns)
    if need is None:
        return Glance(found, told, told)

    def of_others(columns: Any) -> Array:
        number = need(columns)
        last = jnp.finfo(number.dtype).max  # also of those whose need is no number: they are solved
        number = jnp.where(number < last, number, last)
        return jnp.where(told, jnp.inf, number)

    shape = jax.eval_shape(need, columns)

    def none(columns: Any) -> Array:
        return jnp.full(shape.shape, jnp.inf, shape.dtype)

    return Glance(found, told, jax.lax.cond(jnp.all(told), none, of_others, columns))


def with_the_rest(
    function: Callable[[Any], Any],
    columns: Any,
    glance: Glance,
    width: int,
) -> Any:
    """Values of all columns, of which those that are not told are solved.

    Parameters
    ----------
    function
        As in `batching.map_tiles`.
    columns, glance
        Columns and what is told of them, with the batch first.
    width
        Columns of a tile.
    """
    found, told, place = glance
    size = told.size
    count = -(-size // width)
    tiles = -(-jnp.sum(~told) // width)

    def solved(found: Any) -> Any:
        order = jnp.pad(jnp.argsort(place), (0, count * width - size), mode="edge")

        def one(k: Array, into: Any) -> Any:
            own = jax.lax.dynamic_slice(order, (k * width,), (width,))
            some = jax.tree.map(lambda x: jnp.moveaxis(_at(x, own), 0, -1), columns)
            new = jax.tree.map(lambda x: jnp.moveaxis(x, -1, 0), function(some))
            return jax.tree.map(partial(_put, own, told), into, new)

        return jax.lax.fori_loop(0, tiles, one, found)

    return jax.lax.cond(jnp.all(told), lambda found: found, solved, found)


def _at(x: Array, own: Array) -> Array:
    return x.at[own].get(mode="promise_in_bounds")


def _put(own: Array, told: Array, into: Array, new: Array) -> Array:
    """Rows of `new` in their places, but of columns that are told."""
    kept = jnp.reshape(_at(told, own), (-1, *(1,) * (new.ndim - 1)))
    return into.at[own].set(jnp.where(kept, _at(into, own), new), mode="promise_in_bounds")
