"""Derivatives of columns that do not see each other: one gradient for every transformation.

Where columns are solved side by side, each result depends on its own column alone. Its gradient in
every argument then is all there is to a first derivative: forward mode multiplies it by tangents,
reverse mode by cotangents, a Jacobian takes it as it is, and they agree to the last rounding.
`independent_columns` computes that gradient once, beside the value, tile by tile.

`jax.vmap` of the call for one column, or of its derivatives, joins the mapped axis to the batch:
the program has its batch last then too, which is several times faster than first.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_batching import custom_vmap
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from .batching import map_tiles
from .slopes import chosen

Leaves = list[Float[Array, "*own batch"]]
Slopes = list[Float[Array, "row *own batch"]]


def independent_columns(
    program: Callable[[Any], Any],
    tile: int,
    gradient: Callable[[Any], tuple[Any, Any]] | None = None,
    need: Callable[[Any], Any] | None = None,
) -> Callable[[Any], Any]:
    """Solve columns tile by tile, with derivatives and `jax.vmap` as they are cheapest.

    Parameters
    ----------
    program
        Maps a pytree of arrays whose last axis is the batch to a pytree of floating arrays with
        that same last axis, every column by itself. It must not close over traced arrays.
    tile
        Columns a tile.
    gradient
        Maps a tile to what `program` gives and to a pytree like the tile's, with an array
        ``row *own batch`` in place of each floating ``*own batch``. Rows number the entries of a
        column's result: those of its first array in order, then those of its second, and so on.
        Second derivatives differentiate it again; slopes that nobody wants are not compiled.
        None is reverse mode through `program`.
    need
        Of columns, by which they are sorted (`batching.map_tiles`).

    Returns
    -------
    `program` for batches of any size.
    """

    def solve(columns: Any) -> Any:
        leaves, structure = jax.tree.flatten(columns)

        def of_leaves(leaves: Leaves) -> Any:
            assert need is not None
            return need(jax.tree.unflatten(structure, leaves))

        sorted_by = None if need is None else of_leaves

        def value(leaves: Leaves) -> Any:
            return program(jax.tree.unflatten(structure, leaves))

        def value_and_slopes(leaves: Leaves, wanted: Sequence[bool]) -> tuple[Any, Slopes]:
            if gradient is None:
                return _reverse_mode(value, leaves, wanted)
            result, slopes = gradient(jax.tree.unflatten(structure, leaves))
            return result, chosen(structure.flatten_up_to(slopes), wanted)

        solution = jax.custom_jvp(_joining(value, tile, sorted_by))

        def rule(primals: tuple[Leaves], tangents: tuple[list[Any]]) -> tuple[Any, Any]:
            wanted = [_perturbs(tangent) for tangent in tangents[0]]
            both = _linearised(lambda leaves: value_and_slopes(leaves, wanted), tile, sorted_by)
            result, slopes = both(primals[0])
            return result, _contracted(slopes, chosen(tangents[0], wanted), result)

        solution.defjvp(rule, symbolic_zeros=True)
        return solution(leaves)

    return solve


def _perturbs(tangent: Any) -> bool:
    """Whether there is a derivative to take: not for constants, nor for integers."""
    return not isinstance(tangent, SymbolicZero) and tangent.dtype != jax.dtypes.float0


def _contracted(slopes: Slopes, tangents: Leaves, result: Any) -> Any:
    """Slopes times tangents, summed over each column's own axes: linear, so JAX transposes it."""
    if not slopes:
        return jax.tree.map(jnp.zeros_like, result)
    products = [
        jnp.sum(slope * tangent, axis=tuple(range(1, tangent.ndim)))
        for slope, tangent in zip(slopes, tangents, strict=True)
    ]
    return _from_rows(sum(products[1:], start=products[0]), result)


def _from_rows(rows: Float[Array, "row batch"], like: Any) -> Any:
    """Rows as the entries of a result of this structure, whose shapes but for the batch count."""
    outputs, structure = jax.tree.flatten(like)
    counts = [math.prod(x.shape[:-1]) for x in outputs]
    parts = jnp.split(rows, np.cumsum(counts)[:-1])
    shaped = [p.reshape(*x.shape[:-1], rows.shape[-1]) for p, x in zip(parts, outputs, strict=True)]
    return jax.tree.unflatten(structure, shaped)


def _reverse_mode(
    value: Callable[[Leaves], Any], leaves: Leaves, wanted: Sequence[bool]
) -> tuple[Any, Slopes]:
    """Value of a tile, and the slope of every row in the leaves that are wanted."""

    def of_wanted(some: Leaves) -> Any:
        rest = iter(some)
        return value([next(rest) if use else x for x, use in zip(leaves, wanted, strict=True)])

    result, pull_back = jax.vjp(of_wanted, chosen(leaves, wanted))
    outputs = jax.tree.leaves(result)
    count, batch = sum(math.prod(x.shape[:-1]) for x in outputs), outputs[0].shape[-1]

    def slopes_of(row: Float[Array, " row"]) -> Leaves:
        # One pull for all columns: those of others do not change a column's result.
        seed = jnp.broadcast_to(row[:, None], (count, batch))
        return pull_back(_from_rows(seed, result))[0]

    rows = jnp.eye(count, dtype=outputs[0].dtype)
    if count == 1:  # nothing comes before the axes of the one sweep
        return result, [x[None] for x in slopes_of(rows[0])]
    return result, jax.vmap(slopes_of)(rows)


def _linearised(function: Callable[[Leaves], Any], tile: int, need: Any) -> Callable[[Leaves], Any]:
    """`_joining`, differentiable again: `jax.custom_batching.custom_vmap` alone has no transpose.

    Second derivatives are JAX's own of the program of a tile. Mapped, they have that axis first.
    """
    joining = jax.custom_jvp(_joining(function, tile, need))

    @joining.defjvp
    def _(primals, tangents):
        return jax.jvp(lambda leaves: map_tiles(function, leaves, tile, need), primals, tangents)

    return joining


def _joining(function: Callable[[Leaves], Any], tile: int, need: Any) -> Callable[[Leaves], Any]:
    """`function` tile by tile, whose batch takes in the axes that `jax.vmap` maps over."""

    @custom_vmap
    def joining(leaves: Leaves) -> Any:
        return map_tiles(function, leaves, tile, need)

    @joining.def_vmap
    def _(axis_size: int, is_mapped: list[list[bool]], leaves: Leaves) -> tuple[Any, Any]:
        def joined(x: Array, mapped: bool) -> Array:
            if not mapped:
                x = jnp.broadcast_to(x, (axis_size, *x.shape))
            x = jnp.moveaxis(x, 0, -2)
            return x.reshape(*x.shape[:-2], axis_size * x.shape[-1])

        def apart(x: Array) -> Array:
            return jnp.moveaxis(x.reshape(*x.shape[:-1], axis_size, batch), -2, 0)

        batch = leaves[0].shape[-1]
        found = joining([joined(x, m) for x, m in zip(leaves, is_mapped[0], strict=True)])
        return jax.tree.map(apart, found), jax.tree.map(lambda _: True, found)

    return joining
