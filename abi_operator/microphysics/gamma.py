r"""Gamma distributions of particle size, from mass and number.

Diameters follow dN/dD = N0 D^nu exp(-Lam D), and a particle's mass is alpha D^beta. Moments are
gamma functions,

.. math:: \int D^p\, \frac{dN}{dD}\, dD =
   N\, \frac{\Gamma(\nu + 1 + p)}{\Gamma(\nu + 1)}\, \Lambda^{-p} ,

so that the mean mass of a particle gives the slope, and back.
"""

import math
from typing import NamedTuple

import jax.numpy as jnp
from jax.scipy.special import gammaln
from jaxtyping import Array, Float


class MassLaw(NamedTuple):
    """Mass of a particle, coefficient D^power, with D in m. [kg m-power], [-]"""

    coefficient: float
    power: float


def sphere(density: float) -> MassLaw:
    """Mass of spheres.

    Parameters
    ----------
    density
        Bulk density of the particle, air between its crystals included. [kg m-3]
    """
    return MassLaw(math.pi / 6 * density, 3.0)


def log_gamma(x: float | Array) -> float | Array:
    """Logarithm of the gamma function: a number for a number, an array for an array. [-]"""
    return math.lgamma(x) if isinstance(x, float | int) else gammaln(x)


def log_moment(power: float, nu: float | Array) -> float | Array:
    """Logarithm of the mean of (Lam D)^power. [-]"""
    return log_gamma(nu + 1 + power) - log_gamma(nu + 1)


def mean_mass(
    inverse_slope: Float[Array, "*n"] | float, law: MassLaw, nu: float | Array
) -> Float[Array, "*n"]:
    """Mean mass of a particle. [kg]

    Parameters
    ----------
    inverse_slope
        1 / Lam. [m]
    law
        Mass of one particle by its diameter.
    nu
        Shape of the distribution. [-]
    """
    log_unit = math.log(law.coefficient) + log_moment(law.power, nu)
    return jnp.exp(log_unit + law.power * jnp.log(inverse_slope))


def inverse_slope(
    log_mean_mass: Float[Array, "*n"], law: MassLaw, nu: float | Array
) -> Float[Array, "*n"]:
    """1 / Lam, from the logarithm of the mean mass of a particle in kg. [m]"""
    log_unit = math.log(law.coefficient) + log_moment(law.power, nu)
    return jnp.exp((log_mean_mass - log_unit) / law.power)
