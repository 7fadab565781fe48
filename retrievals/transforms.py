r"""From numbers without bounds to quantities that have some.

A minimisation needs no constraints where its unknowns may take any real value. Each element of x is
such a number, and a smooth, rising function makes a physical quantity of it.
"""

import math
from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

_FARTHEST = math.log(1e4)  # x of what is a ten-thousandth of the way from limit to limit inside one


@dataclass(frozen=True)
class Bounded:
    r"""A quantity between two limits, which x only reaches at infinity.

    .. math:: q = l + \frac{u - l}{1 + e^{-x}} \quad\text{or, if logarithmic,}\quad
       \ln q = \ln l + \frac{\ln u - \ln l}{1 + e^{-x}}

    With a lower limit of 0 the first is a logarithm, :math:`q \approx u\, e^x`, as long as q is
    small beside u.

    Parameters
    ----------
    lower, upper
        Limits l and u, in the unit of the quantity.
    logarithmic
        Whether the logarithm of the quantity is what lies between those of its limits.
    """

    lower: float
    upper: float
    logarithmic: bool = False

    def __post_init__(self) -> None:
        smallest = 0 if self.logarithmic else -math.inf
        if not smallest < self.lower < self.upper < math.inf:
            above = "0 < " if self.logarithmic else ""
            raise ValueError(
                f"limits must be finite and {above}lower < upper; got {self.lower} and "
                f"{self.upper}."
            )

    @property
    def extremes(self) -> tuple[float, ...]:
        """The x between which everything lies."""
        return -math.inf, math.inf

    def value(self, x: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
        """Quantity that x stands for."""
        share = jax.nn.sigmoid(x)
        if self.logarithmic:
            return self.lower * jnp.exp(share * math.log(self.upper / self.lower))
        return self.lower + (self.upper - self.lower) * share

    def x(self, value: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
        """Number that stands for a quantity; not finite where that is not between the limits."""
        if self.logarithmic:
            share = jnp.log(value / self.lower) / math.log(self.upper / self.lower)
        else:
            share = (value - self.lower) / (self.upper - self.lower)
        return jnp.log(share) - jnp.log1p(-share)

    def inside(self, value: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
        """The nearest quantity whose x is a moderate number: limits have none."""
        least, most = (self.value(jnp.asarray(x, value.dtype)) for x in (-_FARTHEST, _FARTHEST))
        return jnp.clip(value, least, most)

    def slope(self, x: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
        """Derivative of `value`, for the propagation of errors."""
        inner = jax.nn.sigmoid(x) * jax.nn.sigmoid(-x)
        if self.logarithmic:
            return self.value(x) * math.log(self.upper / self.lower) * inner
        return (self.upper - self.lower) * inner


@dataclass(frozen=True)
class Unbounded:
    """A quantity that may be any number: x itself."""

    @property
    def extremes(self) -> tuple[float, ...]:
        """One x: how far it may go is not known."""
        return (0.0,)

    def value(self, x: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
        """Quantity that x stands for."""
        return x

    def x(self, value: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
        """Number that stands for a quantity."""
        return value

    def inside(self, value: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
        """The quantity itself."""
        return value

    def slope(self, x: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
        """Derivative of `value`, for the propagation of errors."""
        return jnp.ones_like(x)


Transform = Bounded | Unbounded
