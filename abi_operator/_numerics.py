"""Divisions and roots with a finite derivative everywhere, and small-matrix algebra.

Matrices have their two axes first and the batch last, ``"row col *batch"``: with no batch a
function reads as the algebra of one column, with one it is arithmetic on long contiguous vectors,
which is what a CPU is fast at when matrices are small.
"""

from collections.abc import Callable, Sequence
from functools import wraps

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental.xla_metadata import set_xla_metadata
from jaxtyping import Array, Float

_WRITTEN_OUT = 16  # longest sum of a matrix product that is written out
_IN_PARTS = range(5, 9)  # such sums are two operations in float32


def fenced(function: Callable) -> Callable:
    """Compile `function` as a kernel of its own inside a larger program.

    XLA fuses chains of written-out matrix products and then recomputes their parts, which makes a
    layer several times slower. A call that is not inlined stops it, and derivatives and `vmap`
    pass through; `jax.lax.optimization_barrier` is dropped before fusion on the CPU.
    """
    compiled = jax.jit(function)

    @wraps(function)
    def call(*args):
        # As arguments, Python's numbers would be of double precision.
        dtype = jnp.result_type(*(x for x in jax.tree.leaves(args) if not isinstance(x, float)))
        args = jax.tree.map(lambda x: jnp.asarray(x, dtype) if isinstance(x, float) else x, args)
        with set_xla_metadata(inlineable="false"):
            return compiled(*args)

    return call


def safe_divide(numerator: Float[Array, "*#n"], denominator: Float[Array, "*#n"]) -> Array:
    """Quotient; 0, with derivative 0, where the denominator is 0.

    A denominator whose square underflows (1e-19 in float32, 1e-154 in float64) counts as 0: the
    derivative of the quotient divides by that square.
    """
    tiny = np.sqrt(np.finfo(denominator.dtype).tiny).item()
    empty = jnp.abs(denominator) <= tiny
    return jnp.where(empty, 0, numerator / jnp.where(empty, 1, denominator))


def safe_sqrt(x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Square root; 0, with derivative 0, where `x` is not positive."""
    positive = x > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, x, 1)), 0)


def product(a: Float[Array, "row inner *#batch"], b: Float[Array, "inner col *#batch"]) -> Array:
    """Matrix product, batch last and broadcast, for use inside a kernel.

    A short sum over `inner` is written out: a chain of fused multiply-adds on whole batches, five
    to ten times faster than a batched ``dot`` on matrices of 2 to 8 rows. From 16 on the ``dot`` is
    faster, and written-out sums would take minutes to compile. In float32 sums of 5 to 8 terms come
    in two operations, neither of which has more arithmetic than bytes: what that is good for stands
    in `_kernels.one_kernel`.
    """
    inner = a.shape[1]
    if inner > _WRITTEN_OUT:
        return jnp.einsum("ik...,kj...->ij...", a, b, precision=jax.lax.Precision.HIGHEST)
    if inner in _IN_PARTS and a.dtype == jnp.float32:
        half = inner // 2
        return _written_out(_first_half(a, b), a[:, half:], b[half:])
    return _written_out(a[:, :1] * b[:1], a[:, 1:], b[1:])


def _written_out(total, a, b):
    for k in range(a.shape[1]):
        total = total + a[:, k, None] * b[None, k]
    return total


@fenced
def _first_half(a, b):
    half = a.shape[1] // 2
    return product(a[:, :half], b[:half])


def kernel_of_product(function: Callable, inner: int) -> Callable:
    """`function` as a kernel of its own if the products in it are written out.

    A ``dot`` is a kernel by itself, and no part of any other.
    """
    return fenced(function) if inner <= _WRITTEN_OUT else function


def matmul(a: Float[Array, "row inner *#batch"], b: Float[Array, "inner col *#batch"]) -> Array:
    """Matrix product, batch last and broadcast, as a kernel of its own."""
    return kernel_of_product(product, a.shape[1])(a, b)


def weighted(terms: Sequence[tuple[Array | float, Array]]) -> Array:
    """Sum of arrays times weights."""
    total, *others = [weight * array for weight, array in terms]
    for term in others:
        total = total + term
    return total


def minus_product(
    terms: Sequence[tuple[Array | float, Array]],
    factor: Array,
    a: Float[Array, "row inner *batch"],
    b: Float[Array, "inner col *batch"],
) -> Float[Array, "row col *batch"]:
    """Weighted sum of matrices minus `factor` times a product, in one pass over all of them."""
    return kernel_of_product(_minus_product, a.shape[1])(terms, factor, a, b)


def _minus_product(terms, factor, a, b):
    return weighted(terms) - factor * product(a, b)


def weighted_sum(
    matrices: Float[Array, "*shape term"], weights: Float[Array, "term *batch"]
) -> Array:
    """Sum of arrays that all columns share, weighted column by column: ``*shape *batch``."""
    if weights.shape[0] > _WRITTEN_OUT:
        return jnp.tensordot(matrices, weights, axes=1)
    # Few terms at a time: `_kernels.one_kernel` asks for no more arithmetic than bytes in each.
    terms = 2 if weights.dtype == jnp.float32 else 4
    total = _weighted_sum(matrices[..., :terms], weights[:terms])
    for k in range(terms, weights.shape[0], terms):
        total = _add_weighted_sum(total, matrices[..., k : k + terms], weights[k : k + terms])
    return total


@fenced
def _weighted_sum(matrices, weights):
    expand = (...,) + (None,) * (weights.ndim - 1)
    return weighted([(matrices[..., k][expand], weights[k]) for k in range(weights.shape[0])])


@fenced
def _add_weighted_sum(total, matrices, weights):
    expand = (...,) + (None,) * (weights.ndim - 1)
    terms = [(matrices[..., k][expand], weights[k]) for k in range(weights.shape[0])]
    return weighted([(1.0, total), *terms])


def transpose(a: Float[Array, "row col *batch"]) -> Float[Array, "col row *batch"]:
    """Transpose, batch last."""
    return jnp.swapaxes(a, 0, 1)


@jax.custom_jvp
def inverse(a: Float[Array, "n n *batch"]) -> Float[Array, "n n *batch"]:
    """Inverse of a symmetric positive definite matrix, batch last.

    Its derivative is written out, -a^-1 da a^-1, two products instead of a differentiated
    elimination.
    """
    return _inverse_by_halves(a)


@inverse.defjvp
def _inverse_jvp(primals, tangents):
    value = inverse(*primals)
    return value, -matmul(matmul(value, tangents[0]), value)


def _inverse_by_halves(a: Float[Array, "n n *batch"]) -> Float[Array, "n n *batch"]:
    """Halving needs no pivots here: with blocks ``[[p, q], [q^T, r]]`` of a positive definite
    matrix both p and the Schur complement r - q^T p^-1 q are positive definite again.
    """
    n = a.shape[0]
    if n <= 2:
        return _inverse_of_one_or_two(a)
    half = n // 2
    p_inverse = _inverse_by_halves(a[:half, :half])
    u = kernel_of_product(_first_times_second, half)(p_inverse, a)
    schur_inverse = _inverse_by_halves(kernel_of_product(_schur_complement, half)(a, u))
    w = matmul(u, schur_inverse)
    return kernel_of_product(_joined, n - half)(p_inverse, w, u, schur_inverse)


@fenced
def _inverse_of_one_or_two(a):
    if a.shape[0] == 1:
        return 1 / a
    p, q, r = a[:1, :1], a[:1, 1:], a[1:, 1:]
    reciprocal = 1 / (p * r - q * q)
    upper, lower = (jnp.concatenate(row, axis=1) for row in ((r, -q), (-q, p)))
    return jnp.concatenate([upper, lower]) * reciprocal


def _first_times_second(p_inverse, a):
    half = p_inverse.shape[0]
    return product(p_inverse, a[:half, half:])


def _schur_complement(a, u):
    half = u.shape[0]
    return a[half:, half:] - product(transpose(a[:half, half:]), u)


def _joined(p_inverse, w, u, schur_inverse):
    upper = jnp.concatenate([p_inverse + product(w, transpose(u)), -w], axis=1)
    lower = jnp.concatenate([-transpose(w), schur_inverse], axis=1)
    return jnp.concatenate([upper, lower])
