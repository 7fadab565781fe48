r"""Layer amounts of absorbing gas, by which an absorption coefficient becomes an optical depth.

Each amount is additive: whatever the levels, the layers between two pressures hold the same (well
mixed gases and columns exactly; vapour scaled by pressure or temperature as well as the mean of a
layer stands for the layer). An amount is called with one `Atmosphere` and gives one number a layer.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...atmosphere import Atmosphere, Gases
from ...constants import STANDARD_PRESSURE


def ozone_column(atmosphere: Atmosphere) -> Float[Array, " layer"]:
    """Ozone of each layer. [atm-cm]"""
    return 1e-3 * gases_of(atmosphere).ozone


def vapour_column(atmosphere: Atmosphere) -> Float[Array, " layer"]:
    """Precipitable water of each layer. [cm]"""
    return 0.1 * gases_of(atmosphere).vapour


def self_broadened_vapour(atmosphere: Atmosphere) -> Float[Array, " layer"]:
    r"""Vapour of each layer times that above it, :math:`U_{k+1}^2 - U_k^2`. [cm2]

    U is the precipitable water above a level. The self continuum is in proportion to the partial
    pressure of the vapour, which is in proportion to U where vapour falls exponentially with
    height; the whole column then has the square of its precipitable water.
    """
    layer = vapour_column(atmosphere)
    below = jnp.cumsum(layer)
    return layer * (2 * below - layer)


class MixedGas(NamedTuple):
    r"""A gas of one mole fraction at all heights.

    .. math:: \frac{X}{X_0} \left(\frac{p_{k+1}}{p_0}\right)^{1 + n}
       - \frac{X}{X_0} \left(\frac{p_k}{p_0}\right)^{1 + n}, \qquad p_0 = 1013.25\ \mathrm{hPa}

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
    reference: float
    exponent: float

    def __call__(self, atmosphere: Atmosphere) -> Float[Array, " layer"]:
        relative = atmosphere.pressure / STANDARD_PRESSURE
        amount = jnp.diff(relative ** (1 + self.exponent))
        if self.name is None:
            return amount
        return amount * (getattr(gases_of(atmosphere), self.name) / self.reference)


class ScaledVapour(NamedTuple):
    r"""Vapour times powers of pressure and temperature at the middle of the layer. [kg m-2]

    .. math:: u_k \left(\frac{p}{p_0}\right)^n (1 + a x + b x^2), \qquad
       x = \frac{T - 250\ \mathrm{K}}{250\ \mathrm{K}}

    Parameters
    ----------
    reference_pressure
        Pressure :math:`p_0`. [Pa]
    exponent, linear, quadratic
        n, a and b. [-]
    """

    reference_pressure: float
    exponent: float
    linear: float = 0.0
    quadratic: float = 0.0

    def __call__(self, atmosphere: Atmosphere) -> Float[Array, " layer"]:
        pressure = _middle(atmosphere.pressure) / self.reference_pressure
        amount = gases_of(atmosphere).vapour * pressure**self.exponent
        if not (self.linear or self.quadratic):
            return amount
        x = _middle(temperature_of(atmosphere)) / 250 - 1
        return amount * (1 + x * (self.linear + x * self.quadratic))


def foreign_continuum_vapour(atmosphere: Atmosphere) -> Float[Array, " layer"]:
    r"""Vapour times density of air relative to 296 K and 1013.25 hPa. [kg m-2]"""
    relative = _middle(atmosphere.pressure) / STANDARD_PRESSURE
    return gases_of(atmosphere).vapour * relative * (296 / _middle(temperature_of(atmosphere)))


def gases_of(atmosphere: Atmosphere) -> Gases:
    """Gases of a column that has them, or `ValueError`."""
    if atmosphere.gases is None:
        raise ValueError("amounts of gas need atmosphere.gases, which is None.")
    return atmosphere.gases


def temperature_of(atmosphere: Atmosphere) -> Float[Array, " level"]:
    """Temperature of the levels, or `ValueError` where the atmosphere has none. [K]"""
    if atmosphere.temperature is None:
        raise ValueError("absorption by vapour in this band needs atmosphere.temperature.")
    return atmosphere.temperature


def _middle(level: Float[Array, " level"]) -> Float[Array, " layer"]:
    return (level[1:] + level[:-1]) / 2
