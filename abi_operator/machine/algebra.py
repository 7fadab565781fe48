"""Divisions and roots with a finite derivative everywhere, and small-matrix algebra.

Matrices have their two axes first and the batch last, ``"row col *batch"``: with no batch a
function reads as the algebra of one column, with one it is arithmetic on long contiguous vectors,
which is what a CPU is fast at when matrices are small.
"""

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import wraps
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental.xla_metadata import set_xla_metadata
from jaxtyping import Array, Float, Int

from .backend import on_cpu
from .plain import is_plain

_WRITTEN_OUT = 16  # longest sum of a matrix product that is written out
# Terms of each operation of a sum in float32, none of which has more arithmetic than bytes, and of
# one in either precision where all columns share a factor, of which hardly any bytes are read.
_IN_PARTS = {5: (2, 3), 6: (3, 3), 7: (3, 4), 8: (4, 4)}
_IN_PARTS |= {9: (3, 3, 3), 10: (3, 4, 3), 11: (3, 4, 4), 12: (3, 5, 4)}
_OF_SHARED = _IN_PARTS | {8: (3, 5), 10: (3, 3, 4), 12: (3, 3, 3, 3)}
_OF_SHARED_IN_DOUBLE = {9: (4, 5), 10: (5, 5), 11: (5, 6), 12: (6, 6)}
_ALONE = 11  # terms of a product from which on its last operation has room for nothing else


def converted(x: Any, dtype: Any) -> Any:
    """An array of a floating type; one that is of it already is returned as it is.

    JAX would convert it all the same, and linearise that wherever a derivative is taken.
    """
    x = x if isinstance(x, jax.Array) else np.asarray(x)
    if x.dtype == dtype and not getattr(x, "weak_type", False):
        return x
    return x.astype(dtype)


def fenced(function: Callable) -> Callable:
    """Compile `function` as a kernel of its own inside a larger program.

    XLA fuses chains of written-out matrix products and then recomputes their parts, which makes a
    layer several times slower. A call that is not inlined stops it, and derivatives and `vmap`
    pass through; `jax.lax.optimization_barrier` is dropped before fusion on the CPU. Every
    `jax.jit` inside becomes such a call, too, also those in JAX's own functions. An `Entry` among
    the arguments reaches `function` as an array. Other devices have no fences (`backend`).
    """
    reading = _reading(function)
    compiled = jax.jit(reading)

    @wraps(function)
    def call(*args):
        if is_plain():
            return reading(*args)
        # As arguments, Python's numbers would be of double precision.
        arrays = [x for x in jax.tree.leaves(args) if not isinstance(x, float)]
        dtype = jnp.result_type(*(x for x in arrays if jnp.issubdtype(x.dtype, jnp.floating)))
        args = jax.tree.map(lambda x: jnp.asarray(x, dtype) if isinstance(x, float) else x, args)
        with set_xla_metadata(inlineable="false") if on_cpu() else nullcontext():
            return compiled(*args)

    return call


def trailing(x: Any, num_axes: int) -> Any:
    """An array with so many axes, those that it lacks of length 1 behind its own."""
    return x.reshape(*x.shape, *(1,) * (num_axes - x.ndim))


class Entry(eqx.Module):
    """One entry of a stack, given to a kernel that reads it in its place, without a copy.

    Parameters
    ----------
    stack
        Entries in one row each.
    place
        Number of the entry.
    shape
        Of the entry.
    """

    stack: Float[Array, "entry number"]
    place: Int[Array, ""]
    shape: tuple[int, ...] = eqx.field(static=True)

    def read(self) -> Array:
        """The entry as an array."""
        # Not `jax.lax.dynamic_index_in_dim`: a fence is passed on to all that is a `jax.jit`.
        start = self.place, jnp.zeros_like(self.place)
        return jax.lax.dynamic_slice(self.stack, start, (1, self.stack.shape[1])).reshape(
            self.shape
        )


def is_entry(x: Any) -> bool:
    """Whether it is an entry of a stack, for `jax.tree`'s `is_leaf`."""
    return isinstance(x, Entry)


def as_array(x: Any) -> Any:
    """The same, read if it is an entry of a stack."""
    return x.read() if isinstance(x, Entry) else x


def _reading(function: Callable) -> Callable:
    """`function` of arrays, some of which may be entries of a stack."""

    @wraps(function)
    def read(*args):
        return function(*jax.tree.map(as_array, args, is_leaf=is_entry))

    return read


class Rows(eqx.Module):
    """A matrix in blocks of rows, as an elimination leaves it: to join them takes a copy."""

    blocks: tuple[Float[Array, "_ col *batch"], ...]

    def joined(self) -> Float[Array, "row col *batch"]:
        """As one array."""
        return self.blocks[0] if len(self.blocks) == 1 else jnp.concatenate(self.blocks)


def product(
    a: Float[Array, "row inner *#batch"], b: Float[Array, "inner col *#batch"] | Rows
) -> Array:
    """Matrix product, batch last and broadcast, for use inside a kernel.

    A short sum over `inner` is written out: a chain of fused multiply-adds on whole batches, five
    to ten times faster than a batched ``dot`` on matrices of 2 to 8 rows. From 16 on the ``dot`` is
    faster, and written-out sums would take minutes to compile. In float32 sums of 5 to 12 terms
    come in two or more operations, none of which has more arithmetic than bytes, and in float64
    those of 9 to 12 where all columns share `b`: what that is good for stands in
    `kernels.one_kernel`.
    """
    inner = a.shape[1]
    if inner > _WRITTEN_OUT:
        b = b.joined() if isinstance(b, Rows) else b
        return jnp.einsum("ik...,kj...->ij...", a, b, precision=jax.lax.Precision.HIGHEST)
    terms, before, start = _terms(a, b), [], 0
    for count in _parts(a, b)[:-1]:
        before = [_sum_of_some(before, a, b, slice(start, start + count))]
        start += count
    return total([*before, *terms[start:]])


def _parts(a, b):
    """Numbers of terms of the operations that a product comes in; none where it is one."""
    shared = a.ndim > 2 and not isinstance(b, Rows) and all(n == 1 for n in b.shape[2:])
    if a.dtype == jnp.float64:
        table = _OF_SHARED_IN_DOUBLE if shared else {}
    else:
        table = _OF_SHARED if shared else _IN_PARTS
    return table.get(a.shape[1], ())


def comes_in_parts(a: Float[Array, "inner *_"]) -> bool:
    """Whether a sum over that axis does, or what has as much arithmetic as one over it."""
    return a.dtype == jnp.float32 and a.shape[0] in _IN_PARTS


def product_alone(
    a: Float[Array, "row inner *#batch"], b: Float[Array, "inner col *#batch"]
) -> Array:
    """`product` for use beside other terms inside a kernel: a long one is an operation by itself,
    so that none has more arithmetic than bytes."""
    return fenced(product)(a, b) if a.shape[1] >= _ALONE else product(a, b)


def _terms(a, b):
    blocks = b.blocks if isinstance(b, Rows) else (b,)
    rows = [block[k] for block in blocks for k in range(block.shape[0])]
    return [a[:, k, None] * row[None] for k, row in enumerate(rows)]


def _sum_of_some(before, a, b, some):
    return fenced(lambda before, a, b: total([*before, *_terms(a, b)[some]]))(before, a, b)


def kernel_of_product(function: Callable, inner: int) -> Callable:
    """`function` as a kernel of its own if the products in it are written out.

    A ``dot`` is a kernel by itself, and no part of any other.
    """
    return fenced(function) if inner <= _WRITTEN_OUT else _reading(function)


def matmul(
    a: Float[Array, "row inner *#batch"], b: Float[Array, "inner col *#batch"] | Rows
) -> Array:
    """Matrix product, batch last and broadcast, as a kernel of its own."""
    return kernel_of_product(product, a.shape[1])(a, b)


def weighted(terms: Sequence[tuple[Array | float, Array]]) -> Array:
    """Sum of arrays times weights."""
    total, *others = [weight * array for weight, array in terms]
    for term in others:
        total = total + term
    return total


def total(terms: Any) -> Array:
    """Sum over the first axis, inside a kernel, which a reduction would cut in two."""
    result = terms[0]
    for k in range(1, len(terms)):
        result = result + terms[k]
    return result


def minus_product(
    terms: Sequence[tuple[Array | float, Array]],
    factor: Array,
    a: Float[Array, "row inner *batch"],
    b: Float[Array, "inner col *batch"] | Rows,
) -> Float[Array, "row col *batch"]:
    """Weighted sum of matrices minus `factor` times a product, in one pass over all of them."""
    return kernel_of_product(_minus_product, a.shape[1])(terms, factor, a, b)


def _minus_product(terms, factor, a, b):
    return weighted(terms) - factor * product(a, b)


def weighted_sum(
    matrices: Float[Array, "*shape term"],
    weights: Float[Array, "term *batch"],
    more: Float[Array, "*shape"] | None = None,
) -> Array:
    """Sum of arrays that all columns share, weighted column by column: ``*shape *batch``.

    `more` is one more such array, of weight 1.
    """
    expand = (...,) + (None,) * (weights.ndim - 1)
    result: Any = None if more is None else more[expand]
    if weights.shape[0] > _WRITTEN_OUT:
        summed = jnp.tensordot(matrices, weights, axes=1, precision=jax.lax.Precision.HIGHEST)
        return summed if result is None else result + summed
    # Few terms at a time: `kernels.one_kernel` asks for no more arithmetic than bytes in each.
    terms = 2 if weights.dtype == jnp.float32 else 4
    for k in range(0, weights.shape[0], terms):
        result = _add_weighted_sum(result, matrices[..., k : k + terms], weights[k : k + terms])
    return result


@fenced
def _add_weighted_sum(result, matrices, weights):
    expand = (...,) + (None,) * (weights.ndim - 1)
    terms = [(matrices[..., k][expand], weights[k]) for k in range(weights.shape[0])]
    return weighted(terms if result is None else [(1.0, result), *terms])


def transpose(a: Float[Array, "row col *batch"]) -> Float[Array, "col row *batch"]:
    """Transpose, batch last."""
    return jnp.swapaxes(a, 0, 1)
