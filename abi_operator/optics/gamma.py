r"""Size of a population of particles as light sees it, from their mean mass.

A particle of diameter D has the mass alpha D^beta and the projected area gamma D^sigma; diameters
follow a gamma distribution. Light knows such a particle by the photon path d = m / (rho A), its
volume of solid matter over its area, which is 2/3 D for a solid sphere (Mitchell [1]_). Of a
population the mean by area

.. math:: \bar d = \frac{M}{\rho A} = \frac{\alpha}{\rho \gamma}\,
   \frac{\Gamma(\nu + 1 + \beta)}{\Gamma(\nu + 1 + \sigma)}\, \Lambda^{-(\beta - \sigma)}

turns mass into area. The effective radius is 3/4 of it, the generalized effective size of Fu (1996)
2 / sqrt 3 times it.

Photon paths of crystals are distributed nearly as diameters of spheres are: as the (beta - sigma)th
power of what, weighted by area, is a gamma distribution. `equivalent_shape` is the shape of the
distribution of spheres that has the same mean and variance of photon path, weighted by area, so
that the closed forms for spheres serve crystals too; for spheres it is nu itself.

References
----------
.. [1] D. L. Mitchell, "Effective diameter in radiation transfer: general definition, applications,
   and limitations", J. Atmos. Sci., 59, 2330-2346, 2002,
   doi:10.1175/1520-0469(2002)059<2330:EDIRTG>2.0.CO;2
"""

import math
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..microphysics.gamma import MassLaw, log_gamma, log_moment, sphere


class Habit(NamedTuple):
    """Shape of particles.

    Parameters
    ----------
    mass
        Mass by diameter, the longest dimension of a crystal.
    area_coefficient, area_power
        Projected area by diameter, coefficient D^power, D in m. [m2 m-power], [-]
    density
        Density of the solid or liquid itself, without the air in between. [kg m-3]
    """

    mass: MassLaw
    area_coefficient: float
    area_power: float
    density: float


def mitchell(
    mass: float, mass_power: float, area: float, area_power: float, density: float
) -> Habit:
    """Power laws in g, cm2 and cm, as Mitchell (1996) prints them, in SI units."""
    mass_law = MassLaw(1e-3 * mass * 100**mass_power, mass_power)
    return Habit(mass_law, 1e-4 * area * 100**area_power, area_power, density)


def sphere_habit(bulk_density: float, density: float) -> Habit:
    """Spheres of a bulk density, air included, made of matter of another. [kg m-3]"""
    return Habit(sphere(bulk_density), math.pi / 4, 2.0, density)


def photon_path(
    log_mean_mass: Float[Array, "*n"], habit: Habit, nu: float | Array
) -> Float[Array, "*n"]:
    """Logarithm of the mean photon path in m, from that of the mean mass of a particle in kg."""
    alpha, beta = habit.mass
    log_inverse_slope = (log_mean_mass - math.log(alpha) - log_moment(beta, nu)) / beta
    return _log_unit_path(habit, nu) + (beta - habit.area_power) * log_inverse_slope


def mean_mass_of_path(
    log_path: Float[Array, "*n"], habit: Habit, nu: float | Array
) -> Float[Array, "*n"]:
    """Logarithm of the mean mass of a particle in kg, from that of the mean photon path in m."""
    alpha, beta = habit.mass
    log_inverse_slope = (log_path - _log_unit_path(habit, nu)) / (beta - habit.area_power)
    return math.log(alpha) + log_moment(beta, nu) + beta * log_inverse_slope


def equivalent_shape(habit: Habit, nu: float | Array) -> float | Array:
    """Shape of the distribution of spheres whose photon paths vary as those of the particles. [-]

    With k = nu + 1 + sigma and p = beta - sigma, the ratio of the mean square to the squared mean
    of photon path is Gamma(k + 2p) Gamma(k) / Gamma(k + p)^2; for spheres it is 1 + 1 / (nu + 3).
    """
    k, p = nu + 1 + habit.area_power, habit.mass.power - habit.area_power
    log_ratio = log_gamma(k + 2 * p) + log_gamma(k) - 2 * log_gamma(k + p)
    variance = math.expm1(log_ratio) if isinstance(log_ratio, float) else jnp.expm1(log_ratio)
    return 1 / variance - 3


def _log_unit_path(habit: Habit, nu: float | Array) -> float | Array:
    """Logarithm of the mean photon path where 1 / Lam is 1 m."""
    log_path = math.log(habit.mass.coefficient / (habit.density * habit.area_coefficient))
    return log_path + log_moment(habit.mass.power, nu) - log_moment(habit.area_power, nu)
