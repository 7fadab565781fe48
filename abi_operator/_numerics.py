"""Divisions and roots with a finite derivative everywhere, and small-matrix algebra.

Matrices have their two axes first and the batch last, ``"row col *batch"``: with no batch a
function reads as the algebra of one column, with one it is arithmetic on long contiguous vectors,
which is what a CPU is fast at when matrices are small.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float


def safe_divide(numerator: Float[Array, "*#n"], denominator: Float[Array, "*#n"]) -> Array:
    """Quotient; 0, with derivative 0, where the denominator is 0."""
    empty = denominator == 0
    return jnp.where(empty, 0, numerator / jnp.where(empty, 1, denominator))


def safe_sqrt(x: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Square root; 0, with derivative 0, where `x` is not positive."""
    positive = x > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, x, 1)), 0)
