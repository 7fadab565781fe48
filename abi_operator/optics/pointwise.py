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
        given, structure = jax.tree.flatten(args)
        fixed = tuple(x if isinstance(x, _STATIC) else None for x in given)
        value = _with_rule(function, structure, fixed)
        return value(*(x for x in given if not isinstance(x, _STATIC)))

    return call


@cache
def _with_rule(function: Callable[..., Any], structure: Any, fixed: tuple[Any, ...]) -> Callable:
    """`function` of those leaves of its arguments that are arrays, the others being `fixed`.

    One for all calls, so that what JAX has made of it is found again.
    """

    def of(*arrays: Array) -> Any:
        rest = iter(arrays)
        return function(
            *jax.tree.unflatten(structure, [next(rest) if x is None else x for x in fixed])
        )

    value = jax.custom_jvp(fenced(of))

    @cache
    def with_slopes(moving: tuple[int, ...]) -> Callable[..., Any]:
        return fenced(lambda *arrays: _with_slopes(of, arrays, moving))

    def rule(primals: Sequence[Array], tangents: Sequence[Any]) -> tuple[Any, Any]:
        moving = tuple(k for k, t in enumerate(tangents) if not isinstance(t, SymbolicZero))
        found, slopes = with_slopes(moving)(*primals)

        def along(*slopes: Array) -> Array:
            terms = [x * tangents[k] for x, k in zip(slopes, moving, strict=True)]
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
