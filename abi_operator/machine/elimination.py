"""Inverses and quotients of symmetric positive definite matrices, batch last.

Halving needs no pivots here: with blocks ``[[p, q], [q^T, r]]`` of a positive definite matrix both
p and the Schur complement r - q^T p^-1 q are positive definite again. Small blocks are inverted,
which is rounded as substitution is where their eigenvalues are alike. The smallest of the whole
matrix is one of the last Schur complement's, whose two rows are therefore substituted (`Pair`):
under layers of 1e5 that absorb nothing it is 1e-5 of the others, along isotropic light. Of more
rows than are halved again double precision inverts the last half, as it does the first.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .algebra import Rows, fenced, kernel_of_product, matmul, product, total, transpose
from .kernels import one_kernel

_CLOSED_FORM = 2  # rows up to which an inverse is written down at once
_HALVED_AGAIN = 8  # rows up to which halves are halved on; of more there are too many kernels


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


def _inverse_by_halves(a):
    n = a.shape[0]
    if n <= _CLOSED_FORM:
        return fenced(_inverse_of_one_or_two)(a)
    p_inverse, u, schur_inverse = _eliminated(a)
    w = matmul(u, schur_inverse)
    return kernel_of_product(_joined, n - n // 2)(p_inverse, w, u, schur_inverse)


def _eliminated(a):
    """p^-1, p^-1 q and the inverse of the Schur complement."""
    half = a.shape[0] // 2
    inverse_of_half = _as_kernel if a.shape[0] > _HALVED_AGAIN else _inverse_by_halves
    p_inverse = inverse_of_half(a[:half, :half])
    u = kernel_of_product(_first_times_second, half)(p_inverse, a)
    schur = kernel_of_product(_schur_complement, half)(a, u)
    return p_inverse, u, inverse_of_half(schur)


def _as_kernel(a):
    """Inverse in one kernel, of a matrix that is part of one too large to be in a kernel itself."""
    return one_kernel(_inverse_by_halves, a.shape[0], in_parts=True)(a)


def _inverse_of_one_or_two(a):
    if a.shape[0] == 1:
        return 1 / a
    p, q, r = a[:1, :1], a[:1, 1:], a[1:, 1:]
    # Both corners are read: with less to do LLVM would unroll a loop over 16 columns as scalars.
    reciprocal = 1 / (p * r - q * a[1:, :1])
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


@jax.custom_jvp
def solve(
    a: Float[Array, "n n *batch"], rights: Sequence[Float[Array, "n _ *batch"]]
) -> list[Rows]:
    """``a^-1 right`` of a symmetric positive definite matrix for each of `rights`.

    By halves and their halves, so that no inverse of more than two rows is put together, which
    takes as much time in copies as in arithmetic. The derivative is written out.
    """
    factors = _factors(a)
    return [_substituted(factors, right) for right in rights]


@solve.defjvp
def _solve_jvp(primals, tangents):
    (a, rights), (da, drights) = primals, tangents
    # By the inverse, of which reverse mode makes two products, and not a second elimination.
    own = inverse(a)
    sizes = [[x.shape[0] for x in y.blocks] for y in jax.eval_shape(solve, a, rights)]
    found = [_times_in_blocks(own, x, rows) for x, rows in zip(rights, sizes, strict=True)]
    changes = [d - matmul(da, x) for d, x in zip(drights, found, strict=True)]
    return found, [_times_in_blocks(own, d, rows) for d, rows in zip(changes, sizes, strict=True)]


def _times_in_blocks(inverse, right, sizes) -> Rows:
    blocks, start = [], 0
    for size in sizes:
        rows = slice(start, start + size)
        times = kernel_of_product(lambda a, b, rows=rows: product(a[rows], b), inverse.shape[0])
        blocks.append(times(inverse, right))
        start += size
    return Rows(tuple(blocks))


class _Factors(NamedTuple):
    """Of a matrix in halves: of p, p^-1 q, and of the Schur complement."""

    first: Any
    u: Rows
    second: Any

    @property
    def half(self) -> int:
        return sum(block.shape[0] for block in self.u.blocks)


class Pair(NamedTuple):
    """Factors of the last two rows, ``[[p, q], [q, s + q^2 / p]]``.

    Where one eigenvalue is far below the others an inverse is large along its vector alone, and is
    rounded as if it were as large along all others: what it makes of a right side across that
    vector is off by rounding times their ratio. Substitution errs along the vector only.

    Parameters
    ----------
    own
        1 / p, and 0.
    along
        -q / p, and 1.
    over
        1 / s.
    """

    own: Float[Array, "2 *batch"]
    along: Float[Array, "2 *batch"]
    over: Float[Array, "*batch"]


def pair(a: Float[Array, "2 2 *batch"]) -> Pair:
    """Factors of a matrix of two rows."""
    return Pair(*fenced(_pair)(a))


def _pair(a):
    over = 1 / a[0, 0]
    along = -a[0, 1] * over
    rest = a[1, 1] + a[0, 1] * along
    return jnp.stack([over, 0 * over]), jnp.stack([along, 0 * over + 1]), 1 / rest


def of_pair(pair: Pair, right: Float[Array, "2 _ *batch"]) -> Float[Array, "2 _ *batch"]:
    """``a^-1 right`` of the factors of a, for use in kernels."""
    own, along, over = pair
    rest = over * (right[1] + along[0] * right[0])
    return total([own[:, None] * right[0], along[:, None] * rest])


def _factors(a):
    """Factors, or the inverse where it is small or its products are not kernels of our own."""
    n = a.shape[0]
    return _factors_of(a, 0, n, _CLOSED_FORM if n <= _HALVED_AGAIN else n - n // 2, last=True)


def _factors_of(a, start, n, largest, last=False):
    """Of the rows and columns from `start` on, cut out inside the kernels and not copied before.

    The smallest eigenvalues are those of the `last` ones.
    """
    if last and n > _CLOSED_FORM and a.dtype == jnp.float32:
        largest = min(largest, n - 1)  # down to a pair, see the head of this file
    if n <= largest:
        own = slice(start, start + n)
        if n == _CLOSED_FORM and last:
            return Pair(*fenced(lambda a: _pair(a[own, own]))(a))
        if n <= _CLOSED_FORM:
            return fenced(lambda a: _inverse_of_one_or_two(a[own, own]))(a)
        return _as_kernel(a[own, own])
    middle, end = start + n // 2, start + n
    first = _factors_of(a, start, n // 2, largest)
    u = _substituted(first, a, slice(start, middle), slice(middle, end))

    def schur_complement(a, u):
        q = a[start:middle, middle:end]
        return a[middle:end, middle:end] - _outer(q, _rows(u))

    schur = kernel_of_product(schur_complement, n // 2)(a, u)
    return _Factors(first, u, _factors_of(schur, 0, end - middle, largest, last))


def _substituted(factors, right, rows=slice(None), columns=slice(None)) -> Rows:
    """Rows of the quotient of a part of `right`."""
    if isinstance(factors, Pair):
        times = kernel_of_product(
            lambda *x: of_pair(Pair(*x[:3]), x[3][rows, columns]), _CLOSED_FORM
        )
        return Rows((times(*factors, right),))
    if not isinstance(factors, _Factors):
        times = kernel_of_product(lambda a, b: product(a, b[rows, columns]), factors.shape[0])
        return Rows((times(factors, right),))
    start = rows.start or 0
    middle = start + factors.half
    upper, lower = slice(start, middle), slice(middle, rows.stop)

    def less_of_first(right, u):
        return right[lower, columns] - _outer(_rows(u), right[upper, columns])

    rest = kernel_of_product(less_of_first, factors.half)(right, factors.u)
    second = _substituted(factors.second, rest)
    count = rest.shape[0]
    if factors.half <= _CLOSED_FORM:

        def both(inverse, right, u, second):
            return product(inverse, right[upper, columns]) - product(u, second)

        parts = (factors.first, right, *factors.u.blocks, second)
        return Rows((kernel_of_product(both, count)(*parts), *second.blocks))
    own = _substituted(factors.first, right, upper, columns)
    less = kernel_of_product(lambda own, u, second: own - product(u, second), count)
    blocks = zip(own.blocks, factors.u.blocks, strict=True)
    return Rows((*(less(x, u, second) for x, u in blocks), *second.blocks))


def _rows(matrix):
    """One by one."""
    return [block[k] for block in matrix.blocks for k in range(block.shape[0])]


def _outer(left, right):
    """Sum of the outer products of rows."""
    return total([x[:, None] * y[None] for x, y in zip(left, right, strict=True)])
