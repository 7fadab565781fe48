r"""Layer amounts of absorbing gas, by which an absorption coefficient becomes an optical depth.

Each amount is additive: whatever the levels, the layers between two pressures hold the same (well
mixed gases and columns exactly; vapour scaled by pressure or temperature as well as the mean of a
layer stands for the layer). `amounts_of` gives one number a layer for each.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..._numerics import safe_divide
from ...atmosphere import Atmosphere, Gases
from ...constants import STANDARD_PRESSURE
from ...machine.algebra import trailing
from ..air import counted_pressure
from ..pointwise import choose, pointwise

_GRAVITY = 9.80665  # standard [m s-2]
# Temperatures between which parabolas are believed [K]; beyond, they are those of temperatures that
# bend, by this much at most in units of 250 K: to 100 and 400 K, where they are above 0.
_BELIEVED, _BEND = (150.0, 325.0), (0.2, 0.3)


def ozone_column(atmosphere: Atmosphere) -> Float[Array, "layer *batch"]:
    """Ozone of each layer. [atm-cm]"""
    return 1e-3 * gases_of(atmosphere).ozone


def vapour_column(atmosphere: Atmosphere) -> Float[Array, "layer *batch"]:
    """Precipitable water of each layer. [cm]"""
    return 0.1 * gases_of(atmosphere).vapour


def self_continuum_vapour(atmosphere: Atmosphere) -> Float[Array, "layer *batch"]:
    r"""Vapour times its own pressure, as its self continuum has it. [kg m-2]

    .. math:: u_k\, \frac{e}{p_0} \Bigl(\frac{296\ \mathrm{K}}{T}\Bigr)^7, \qquad
       e = \frac{q\, p}{0.622 + 0.378\, q}, \quad q = \frac{g\, u_k}{\Delta p}, \quad
       p_0 = 1013.25\ \mathrm{hPa}

    at the middle of the layer, with its vapour u and the difference of pressure between its levels.
    The power of temperature is that of MT_CKD 4.3 in C06 and C07 (density has one of the seven). A
    layer of no air has none.
    """
    air, vapour = jnp.diff(atmosphere.pressure, axis=0), gases_of(atmosphere).vapour
    humidity = safe_divide(_GRAVITY * vapour, air)
    own = humidity * _middle(atmosphere.pressure) / (0.622 + 0.378 * humidity)
    return vapour * (own / STANDARD_PRESSURE) * (296 / _middle(temperature_of(atmosphere))) ** 7


class MixedGas(NamedTuple):
    r"""A gas of one mole fraction at all heights.

    .. math:: \frac{X}{X_0} \left(\frac{p_{k+1}}{p_0}\right)^{1 + n}
       - \frac{X}{X_0} \left(\frac{p_k}{p_0}\right)^{1 + n}, \qquad p_0 = 1013.25\ \mathrm{hPa}

    where :math:`p_k` of the first level counts as 0 (`counted_pressure`): the gas above
    it is in the uppermost layer.

    Parameters
    ----------
    name
        Name of the mole fraction in `Gases`; None for oxygen and nitrogen, of which air has the
        same everywhere.
    reference
        Mole fraction :math:`X_0` for which the coefficients were fitted. [-]
    exponent
        Power n by which pressure makes a unit of the gas absorb more. [-]
    """

    name: str | None
    reference: float | Array
    exponent: float | Array

    def __call__(self, atmosphere: Atmosphere) -> Float[Array, "layer *batch"]:
        """Amount in each layer of one column."""
        return amounts_of(atmosphere, [self])[0]

    def of_path(self, atmosphere: Atmosphere, path: Float[Array, "layer *batch"]) -> Array:
        """Amount, by that of a gas of which there is the mole fraction X_0."""
        if self.name is None:
            return path
        return path * (getattr(gases_of(atmosphere), self.name) / self.reference)


class ScaledVapour(NamedTuple):
    r"""Vapour times a power of pressure at the middle of the layer, :math:`u_k (p/p_0)^n`. [kg m-2]

    Parameters
    ----------
    reference_pressure
        Pressure :math:`p_0`. [Pa]
    exponent
        n. [-]
    """

    reference_pressure: float | Array
    exponent: float | Array

    def __call__(self, atmosphere: Atmosphere) -> Float[Array, "layer *batch"]:
        """Amount in each layer of one column."""
        return amounts_of(atmosphere, [self])[0]

    def of_path(self, atmosphere: Atmosphere, path: Float[Array, "layer *batch"]) -> Array:
        """Amount, by vapour times the power of pressure."""
        return path


class WarmVapour(NamedTuple):
    r"""Scaled vapour times a parabola in temperature at the middle of the layer. [kg m-2]

    .. math:: u_k \left(\frac{p}{p_0}\right)^n (1 + a x + b x^2), \qquad
       x = \frac{T - 250\ \mathrm{K}}{250\ \mathrm{K}}

    The parabolas were fitted to air. Below 150 K and above 325 K x bends smoothly towards its value
    at 100 and at 400 K, so that what absorbs does not become less than nothing.

    Parameters
    ----------
    reference_pressure, exponent
        As of `ScaledVapour`. [Pa], [-]
    linear, quadratic
        a and b. [-]
    """

    reference_pressure: float | Array
    exponent: float | Array
    linear: float | Array
    quadratic: float | Array

    def __call__(self, atmosphere: Atmosphere) -> Float[Array, "layer *batch"]:
        """Amount in each layer of one column."""
        return amounts_of(atmosphere, [self])[0]

    def of_path(self, atmosphere: Atmosphere, path: Float[Array, "layer *batch"]) -> Array:
        """Amount, by vapour times the power of pressure."""
        x = _believed(_middle(temperature_of(atmosphere)) / 250 - 1)
        return path * (1 + x * (self.linear + x * self.quadratic))


def foreign_continuum_vapour(atmosphere: Atmosphere) -> Float[Array, "layer *batch"]:
    r"""Vapour times density of air relative to 296 K and 1013.25 hPa. [kg m-2]"""
    relative = _middle(atmosphere.pressure) / STANDARD_PRESSURE
    return gases_of(atmosphere).vapour * relative * (296 / _middle(temperature_of(atmosphere)))


Amount = Callable[[Atmosphere], Float[Array, "layer *batch"]] | MixedGas | ScaledVapour | WarmVapour
"""A function, or a power of pressure with numbers of its own."""


def amounts_of(
    atmosphere: Atmosphere, wanted: Sequence[Amount]
) -> list[Float[Array, "layer *batch"]]:
    """Amounts in the layers of one column, with the powers of pressure of all taken at once."""
    by_levels = [x for x in wanted if isinstance(x, MixedGas)]
    by_layers = [x for x in wanted if isinstance(x, ScaledVapour | WarmVapour)]
    mixed = iter(_mixed_paths(atmosphere, by_levels) if by_levels else ())
    scaled = iter(_vapour_paths(atmosphere, by_layers) if by_layers else ())
    found = []
    for amount in wanted:
        if isinstance(amount, MixedGas):
            found.append(amount.of_path(atmosphere, next(mixed)))
        elif isinstance(amount, ScaledVapour | WarmVapour):
            found.append(amount.of_path(atmosphere, next(scaled)))
        else:
            found.append(amount(atmosphere))
    return found


def _mixed_paths(atmosphere: Atmosphere, amounts: Sequence[MixedGas]) -> Sequence[Array]:
    relative = counted_pressure(atmosphere.pressure) / STANDARD_PRESSURE
    exponent = _column([x.exponent for x in amounts], relative)
    paths = jnp.diff(relative * _power(relative[None], exponent), axis=1)
    # Where a product and the difference are joined in one rounding, levels at one pressure (and
    # those an ulp apart) have a little less than nothing between them.
    rounding = jnp.where(jnp.diff(relative, axis=0) >= 0, jnp.minimum(paths, 0), 0)
    return jnp.unstack(paths - jax.lax.stop_gradient(rounding))


def _vapour_paths(
    atmosphere: Atmosphere, amounts: Sequence[ScaledVapour | WarmVapour]
) -> Sequence[Array]:
    pressure, vapour = _middle(atmosphere.pressure), gases_of(atmosphere).vapour
    relative = pressure / _column([x.reference_pressure for x in amounts], pressure)
    return jnp.unstack(vapour * _power(relative, _column([x.exponent for x in amounts], pressure)))


def _column(numbers: Sequence[float | Array], like: Array) -> Float[Array, "amount #layer *#batch"]:
    return trailing(jnp.stack([jnp.asarray(x, like.dtype) for x in numbers]), 1 + like.ndim)


def gases_of(atmosphere: Atmosphere) -> Gases:
    """Gases of a column that has them, or `ValueError`."""
    if atmosphere.gases is None:
        raise ValueError("amounts of gas need atmosphere.gases, which is None.")
    return atmosphere.gases


def temperature_of(atmosphere: Atmosphere) -> Float[Array, "level *batch"]:
    """Temperature of the levels, or `ValueError` where the atmosphere has none. [K]"""
    if atmosphere.temperature is None:
        raise ValueError("absorption by vapour in this band needs atmosphere.temperature.")
    return atmosphere.temperature


@pointwise
def _power(x: Array, exponent: Array) -> Array:
    """Power of a number by an exponent, both 0 or more; where the number is 0, of slope 0."""
    power = jnp.exp(exponent * jnp.log(choose(x > 0, x, 1.0)))
    return choose(x > 0, power, (exponent == 0).astype(x.dtype))


def _believed(x: Float[Array, "layer *batch"]) -> Float[Array, "layer *batch"]:
    """Temperature over 250 K, less 1, bent beyond those that parabolas know."""
    low, high = (limit / 250 - 1 for limit in _BELIEVED)
    under, over = x < low, x > high
    # Each exponential sees only what it is for.
    colder = low + _BEND[0] * jnp.expm1((jnp.where(under, x, low) - low) / _BEND[0])
    warmer = high - _BEND[1] * jnp.expm1((high - jnp.where(over, x, high)) / _BEND[1])
    return jnp.where(under, colder, jnp.where(over, warmer, x))


def _middle(level: Float[Array, "level *batch"]) -> Float[Array, "layer *batch"]:
    return (level[1:] + level[:-1]) / 2
