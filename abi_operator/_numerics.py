"""Divisions and roots with a finite derivative everywhere, and small-matrix algebra.

Matrices have their two axes first and the batch last, ``"row col *batch"``: with no batch a
function reads as the algebra of one column, with one it is arithmetic on long contiguous vectors,
which is what a CPU is fast at when matrices are small.
"""

from collections.abc import Callable
from functools import wraps

import jax
import jax.numpy as jnp
import numpy as np
from jax.experimental.xla_metadata import set_xla_metadata
from jaxtyping import Array, Float

_WRITTEN_OUT = 8  # longest sum of a matrix product that is written out


def fenced(function: Callable) -> Callable:
    """Compile `function` as a call of its own inside a larger program.

    XLA fuses chains of written-out matrix products and then recomputes their parts, which makes a
    layer several times slower. A call that is not inlined stops it, and derivatives and `vmap`
    pass through; `jax.lax.optimization_barrier` is dropped before fusion on the CPU.
    """
    compiled = jax.jit(function)

    @wraps(function)
    def call(*args):
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


def matmul(a: Float[Array, "row inner *#batch"], b: Float[Array, "inner col *#batch"]) -> Array:
    """Matrix product, batch last and broadcast.

    A short sum over `inner` is written out: a chain of fused multiply-adds on whole batches, five
    to ten times faster than a batched ``dot`` on matrices of 2 to 8 rows. From 16 on the ``dot`` is
    faster, and written-out sums would take minutes to compile.
    """
    if a.shape[1] > _WRITTEN_OUT:
        return jnp.einsum("ik...,kj...->ij...", a, b, precision=jax.lax.Precision.HIGHEST)
    terms = (a[:, k, None] * b[None, k] for k in range(a.shape[1]))
    total = next(terms)
    for term in terms:
        total = total + term
    return total


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


def _inverse_by_halves(a: Float[Array, "n n *batch"]) -> Float[Array, "n n *batch"]:
    """Halving needs no pivots here: with blocks ``[[p, q], [q^T, r]]`` of a positive definite
    matrix both p and the Schur complement r - q^T p^-1 q are positive definite again.
    """
    n = a.shape[0]
    if n == 1:
        return 1 / a
    half = n // 2
    p, q, r = a[:half, :half], a[:half, half:], a[half:, half:]
    p_inverse = _inverse_by_halves(p)
    u = matmul(p_inverse, q)
    schur_inverse = _inverse_by_halves(r - matmul(transpose(q), u))
    w = matmul(u, schur_inverse)
    upper = jnp.concatenate([p_inverse + matmul(w, transpose(u)), -w], axis=1)
    lower = jnp.concatenate([-transpose(w), schur_inverse], axis=1)
    return jnp.concatenate([upper, lower], axis=0)


@inverse.defjvp
def _inverse_jvp(primals, tangents):
    value = inverse(*primals)
    return value, -matmul(matmul(value, tangents[0]), value)
