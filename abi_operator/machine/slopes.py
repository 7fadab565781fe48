"""Slopes of columns: how they are found and kept, and the product of slopes and tangents.

The product is the linear part of a derivative, which `door` takes in forward mode and JAX
transposes in reverse. It is one operation: written out it would be linearised, staged and
transposed piece by piece with every derivative that a script takes outside `jax.jit`, in the time
of some hundred columns of 4 streams.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import ShapedArray
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir
from jaxtyping import Array, Float

from .checked import refuse_checked

Leaves = Sequence[Any]
Shapes = tuple[tuple[int, ...], ...]


def chosen(items: Leaves, wanted: Sequence[bool]) -> list[Any]:
    """Items that are wanted."""
    return [item for item, use in zip(items, wanted, strict=True) if use]


def slopes_by_reverse_mode(
    value: Callable[[list[Any]], Any], leaves: Leaves, wanted: Sequence[bool]
) -> tuple[Any, list[Float[Array, "row *own batch"]]]:
    """Value of a tile, and the slope of every row of it in the leaves that are wanted.

    Parameters
    ----------
    value
        Of leaves whose last axis is the batch to a pytree of arrays with that last axis, every
        column by itself. Rows number the entries of a column's result: those of the first array in
        order, then those of the second, and so on.
    leaves
        Its arguments.
    wanted
        Those in which there are slopes to find.
    """
    result, pull_back = jax.vjp(partial(_with, value, leaves, wanted), chosen(leaves, wanted))
    outputs, structure = jax.tree.flatten(result)
    counts = [math.prod(x.shape[:-1]) for x in outputs]

    def slopes_of(row: Float[Array, " row"]) -> list[Array]:
        # One pull for all columns: those of others do not change a column's result.
        parts = jnp.split(row, np.cumsum(counts)[:-1])
        seeds = [
            jnp.broadcast_to(part.reshape(*x.shape[:-1], 1), x.shape)
            for part, x in zip(parts, outputs, strict=True)
        ]
        return pull_back(jax.tree.unflatten(structure, seeds))[0]

    rows = jnp.eye(sum(counts), dtype=outputs[0].dtype)
    if len(rows) == 1:  # nothing comes before the axes of the one sweep
        return result, [x[None] for x in slopes_of(rows[0])]
    return result, jax.vmap(slopes_of)(rows)


def slopes_by_copies(
    value: Callable[[list[Any]], Float[Array, "row batch"]],
    leaves: Leaves,
    wanted: Sequence[bool],
    num_rows: int,
) -> tuple[Float[Array, "row batch"], list[Float[Array, "row *own batch"]]]:
    """The same of rows that can be given a copy each of what is wanted: one pull finds all slopes.

    Parameters
    ----------
    value
        As above, of leaves of which those that are wanted have a copy for every row, along their
        first axis. The rows must not see each other's.
    leaves, wanted
        As above.
    num_rows
        Rows of the result.
    """
    copies = [jnp.broadcast_to(x, (num_rows, *x.shape)) for x in chosen(leaves, wanted)]
    result, pull_back = jax.vjp(partial(_with, value, leaves, wanted), copies)
    return result, pull_back(jnp.ones_like(result))[0]


def _with(
    value: Callable[[list[Any]], Any], leaves: Leaves, wanted: Sequence[bool], some: Leaves
) -> Any:
    """A function of leaves, of which those that are wanted are exchanged for others."""
    others = iter(some)
    return value([next(others) if use else x for x, use in zip(leaves, wanted, strict=True)])


def joined(slopes: Sequence[Float[Array, "..."]], own_axes: Sequence[int]) -> Float[Array, "..."]:
    """Slopes ``*batch row *own`` in each argument as one array ``*batch row number``.

    To hand over an array of few columns takes longer than to read it.
    """
    pairs = list(zip(slopes, own_axes, strict=True))
    flat = [x.reshape(*x.shape[: x.ndim - n], math.prod(x.shape[x.ndim - n :])) for x, n in pairs]
    return jnp.concatenate(flat, axis=-1)


class Slopes(NamedTuple):
    """Slopes of columns, `joined`, in one array ``*batch row number`` or in those of chunks.

    Attributes
    ----------
    arrays
        The one, or ``column row number`` of each chunk.
    counts
        Columns that are taken of each chunk, from its first on; empty for the one array.
    batch
        Shape of the batch of the columns of all chunks.
    """

    arrays: Sequence[Any]
    counts: tuple[int, ...] = ()
    batch: tuple[int, ...] = ()


@partial(jax.jit, static_argnums=(1, 2))
def assembled(
    arrays: Sequence[Float[Array, "..."]], counts: tuple[int, ...], batch: tuple[int, ...]
) -> Float[Array, "..."]:
    """One array of chunks; see `Slopes`."""
    if not counts:
        return arrays[0]
    columns = [x[:count] for x, count in zip(arrays, counts, strict=True)]
    return jnp.concatenate(columns).reshape(*batch, *arrays[0].shape[1:])


def contracted(
    slopes: Slopes,
    tangents: Sequence[Float[Array, "..."]],
    own_axes: Sequence[int],
    results: Shapes,
) -> list[Float[Array, "..."]]:
    """Sum of slopes times tangents over each column's own axes.

    Parameters
    ----------
    slopes
        Of each row of a column's results in its own entries of each argument.
    tangents
        Of the arguments, ``*batch *own``, whose batches broadcast to that of the slopes.
    own_axes
        Number of axes of each argument that belong to one column.
    results
        Shapes of the results, with the batch's axes first. Rows number the entries of a column's
        results: those of the first in order, then those of the second, and so on.

    Returns
    -------
    Tangents of the results.
    """
    refuse_checked(tangents)
    arrays, *chunks = slopes
    shapes = tuple(own_axes), results
    return _contracted.bind(*arrays, *tangents, chunks=tuple(chunks), shapes=shapes)


def _forward(*operands: Array, chunks: Any, shapes: tuple[tuple[int, ...], Shapes]) -> list[Array]:
    own_axes, results = shapes
    arrays, tangents = _apart(operands, own_axes)
    slopes, pairs = assembled(arrays, *chunks), list(zip(tangents, own_axes, strict=True))
    numbers = [math.prod(x.shape[x.ndim - own :]) for x, own in pairs]
    rows: Any = 0
    for slope, (tangent, own), number in zip(_cut(slopes, numbers), pairs, numbers, strict=True):
        flat = tangent.reshape(*tangent.shape[: tangent.ndim - own], 1, number)
        rows = rows + jnp.sum(slope * flat, axis=-1)
    num_axes = rows.ndim - 1
    parts = _cut(rows, [math.prod(shape[num_axes:]) for shape in results])
    return [part.reshape(shape) for part, shape in zip(parts, results, strict=True)]


def _apart(operands: Sequence[Any], own_axes: tuple[int, ...]) -> tuple[list[Any], list[Any]]:
    """Arrays of slopes, and tangents."""
    count = len(operands) - len(own_axes)
    return list(operands[:count]), list(operands[count:])


@partial(jax.jit, static_argnums=(2, 3, 4))
def _backward(
    arrays: Sequence[Array],
    cotangents: Sequence[Array],
    chunks: Any,
    own_axes: tuple[int, ...],
    arguments: Shapes,
) -> list[Array]:
    """Cotangents of tangents, which have the shapes of the arguments.

    Chunk by chunk, so that slopes are read once and what comes of them is written once.
    """
    counts, batch = chunks if chunks[0] else (None, arrays[0].shape[:-2])
    size = math.prod(batch)
    parts = [x.reshape(size, math.prod(x.shape[len(batch) :])) for x in cotangents]
    rows = _cut(jnp.concatenate(parts, axis=-1), counts or [size], axis=0)
    given = list(zip(arguments, own_axes, strict=True))
    numbers = [math.prod(shape[len(shape) - own :]) for shape, own in given]
    pulled = []
    for slopes, weights in zip(arrays, rows, strict=True):
        flat = slopes.reshape(math.prod(slopes.shape[:-2]), *slopes.shape[-2:])[: len(weights)]
        pulled.append(_cut(jnp.sum(flat * weights[..., None], axis=1), numbers))
    return [
        _summed(jnp.concatenate(x).reshape(*batch, *shape[len(shape) - own :]), shape, own)
        for x, (shape, own) in zip(zip(*pulled, strict=True), given, strict=True)
    ]


def _cut(x: Array, numbers: Sequence[int], axis: int = -1) -> list[Array]:
    """Parts of an axis with so many entries each."""
    return jnp.split(x, np.cumsum(numbers)[:-1], axis=axis)


def _summed(full: Array, shape: tuple[int, ...], own: int) -> Array:
    """Sum over axes of the batch that an argument of this shape shares."""
    more = full.ndim - len(shape)
    shared = [k for k in range(full.ndim - own) if k < more or shape[k - more] != full.shape[k]]
    return jnp.sum(full, axis=tuple(shared)).reshape(shape) if shared else full


_contracted = Primitive("slopes_times_tangents")
_contracted.multiple_results = True
_contracted.def_impl(jax.jit(_forward, static_argnames=("chunks", "shapes")))


@_contracted.def_abstract_eval
def _abstract_eval(*operands: Any, chunks: Any, shapes: Any) -> list[ShapedArray]:
    dtype = jnp.result_type(*operands)
    return [ShapedArray(shape, dtype) for shape in shapes[1]]


def _jvp(primals: Any, tangents: Any, **params: Any) -> Any:
    full = [ad.instantiate_zeros(t) for t in tangents]
    return jax.jvp(partial(_forward, **params), tuple(primals), tuple(full))


def _transpose(cotangents: Any, *operands: Any, chunks: Any, shapes: Any) -> list[Any]:
    """Linear in tangents; slopes are known, for `_jvp` differentiates them by JAX's own rules."""
    arrays, tangents = _apart(operands, shapes[0])
    unknown = [ad.is_undefined_primal(x) for x in tangents]
    like = [x.aval if use else x for x, use in zip(tangents, unknown, strict=True)]
    full = [ad.instantiate_zeros(x) for x in cotangents]
    found = _backward(arrays, full, chunks, shapes[0], tuple(x.shape for x in like))
    found = [x if use else None for x, use in zip(found, unknown, strict=True)]
    return [None] * len(arrays) + found


def _batch(operands: Any, axes: Any, **params: Any) -> Any:
    found = jax.vmap(partial(_forward, **params), axes)(*operands)
    return found, [0] * len(found)


mlir.register_lowering(_contracted, mlir.lower_fun(_forward, multiple_results=True))
ad.primitive_jvps[_contracted] = _jvp
ad.primitive_transposes[_contracted] = _transpose
batching.primitive_batchers[_contracted] = _batch
