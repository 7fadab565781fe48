"""Functions of numbers to numbers whose slopes are computed beside their values.

Backwards through a chain of operations every one of them needs what it was given, each an array and
a kernel that makes it. Of a function of one number, however long, it is enough to keep the slope,
which comes in forward mode from what the value is made of. Second derivatives are those of slopes.
"""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array

from ..machine.algebra import fenced, total
from ..machine.occupied import Present, if_present, row_by_row

_STATIC = bool, float, int, str


def pointwise(function: Callable[..., Any]) -> Callable[..., Any]:
    """`function` as a kernel of its own, with its slopes beside its values in derivatives.

    Parameters
    ----------
    function
        Of trees of arrays that broadcast, to a tree of arrays, each number from one number of each
        array. Numbers and strings of Python in those trees are static: where floats are constants,
        they are of no precision of their own.
    """

    def call(*args: Any) -> Any:
        return _called(function, None, (), args)

    return call


def where_occupied(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same of layers, of which those that nothing is in are not computed.

    It is called with, before all other arguments, where anything is, ``layer *batch`` or None for
    everywhere, and a tuple of those arrays that have an axis of layers first, as the result has.
    In a layer in which there is nothing in any column of a batch values and slopes are 0.

    Parameters
    ----------
    function
        As for `pointwise`, of each of the arrays that have an axis of layers, and of the others.
    """

    def call(there: Any, by_layer: tuple[Any, ...], *others: Any) -> Any:
        return _called(function, there, by_layer, others)

    return call


def _called(
    function: Callable[..., Any],
    there: Any,
    by_layer: tuple[Any, ...],
    others: tuple[Any, ...],
) -> Any:
    given, structure = jax.tree.flatten((*by_layer, *others))
    fixed = tuple(x if isinstance(x, _STATIC) else None for x in given)
    arrays = [jnp.asarray(x) for x in given if not isinstance(x, _STATIC)]
    if there is None:
        return _with_rule(function, 0, structure, fixed)(*arrays)
    return _with_rule(function, len(by_layer), structure, fixed)(jnp.asarray(there), *arrays)


@cache
def _with_rule(
    function: Callable[..., Any], by_layer: int, structure: Any, fixed: tuple[Any, ...]
) -> Callable:
    """`function` of those leaves of its arguments that are arrays, the others being `fixed`.

    One for all calls, so that what JAX has made of it is found again. Where so many of the arrays
    are given `by_layer`, there comes before them where anything is.
    """

    def of(*arrays: Array) -> Any:
        rest = iter(arrays)
        return function(
            *jax.tree.unflatten(structure, [next(rest) if x is None else x for x in fixed])
        )

    def kernel(of: Callable[..., Any]) -> Callable[..., Any]:
        whole = fenced(of)
        if not by_layer:
            return whole

        def some(there: Array, *arrays: Array) -> Any:
            others = arrays[by_layer:]

            def of_rows(rows: Sequence[Array], present: Sequence[Present]) -> Any:
                return if_present(present[0], lambda *rows: whole(*rows, *others), *rows)

            return row_by_row(of_rows, arrays[:by_layer], [there])

        return some

    value = jax.custom_jvp(kernel(of))

    @cache
    def with_slopes(moving: tuple[int, ...]) -> Callable[..., Any]:
        return kernel(lambda *arrays: _with_slopes(of, arrays, moving))

    def rule(primals: Sequence[Array], tangents: Sequence[Any]) -> tuple[Any, Any]:
        own = tangents[1:] if by_layer else tangents
        moving = tuple(k for k, t in enumerate(own) if not isinstance(t, SymbolicZero))
        found, slopes = with_slopes(moving)(*primals)

        def along(*slopes: Array) -> Array:
            terms = [x * own[k] for x, k in zip(slopes, moving, strict=True)]
            return total(terms)

        return found, jax.tree.map(along, *slopes)

    value.defjvp(rule, symbolic_zeros=True)
    return value


def _with_slopes(
    function: Callable[..., Any], arrays: Sequence[Array], moving: Sequence[int]
) -> tuple[Any, list[Any]]:
    """Values, and their slopes in each array that moves."""
    slopes, found = [], None
    for k in moving:

        def of_one(x: Array, k: int = k) -> Any:
            return function(*arrays[:k], x, *arrays[k + 1 :])

        found, slope = jax.jvp(of_one, (arrays[k],), (jnp.ones_like(arrays[k]),))
        slopes.append(slope)
    return found, slopes


def choose(condition: Array, if_true: Array | float, if_false: Array | float) -> Array:
    """`jnp.where` for use inside a fence, where all that is a `jax.jit` is a kernel of its own."""
    arrays: list[Any] = [x for x in (if_true, if_false) if not isinstance(x, float)]
    shape = jnp.broadcast_shapes(condition.shape, *(x.shape for x in arrays))
    given = (jnp.broadcast_to(jnp.asarray(x, arrays[0].dtype), shape) for x in (if_true, if_false))
    return jax.lax.select(jnp.broadcast_to(condition, shape), *given)
