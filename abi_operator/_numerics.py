"""Divisions and roots with a finite derivative everywhere."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


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
