r"""Size distribution of cloud droplets, from their mass and number.

Diameters follow a gamma distribution, dN/dD = N0 D^nu exp(-Lam D) with nu = 7, an effective
variance 1 / (nu + 3) of 0.1. Of such droplets

.. math:: m/N = \frac{\pi}{6} \rho_w \frac{\Gamma(\nu + 4)}{\Gamma(\nu + 1)} \Lambda^{-3},
   \qquad r_\mathrm{eff} = \frac{\nu + 3}{2 \Lambda} .
"""

import math
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..atmosphere import LiquidCloud
from ..constants import WATER_DENSITY
from .pointwise import choose, where_occupied

# Shape of the gamma distribution, nu. [-] (effective variance 0.1: Hansen 1971,
# doi:10.1175/1520-0469(1971)028<1400:MSOPLI>2.0.CO;2)
NU = 7.0
# Effective radii between which mass and number are believed. [m] Smaller droplets are haze, larger
# ones drizzle; in both a model's number is unreliable.
SMALLEST_RADIUS, LARGEST_RADIUS = 1e-6, 1e-4

# Mass of the mean droplet where the effective radius is 1 m. [kg]
_UNIT_MASS = math.pi / 6 * WATER_DENSITY * (NU + 1) * (NU + 2) * (NU + 3) * (2 / (NU + 3)) ** 3
# Effective radius where the mass of the mean droplet is 1 kg. [m]
_UNIT_RADIUS = _UNIT_MASS ** (-1 / 3)


def is_cloudy(liquid: LiquidCloud) -> Bool[Array, "*n"]:
    """Where there are droplets: where mass and number are above 0, or no numbers.

    Parameters
    ----------
    liquid
        Mass and number of the droplets. [kg m-2], [m-2]
    """
    # What is no number is no empty layer, and what follows from it is no number either.
    return jnp.asarray(_is_cloudy(liquid.mass_path, liquid.number_path))


def _is_cloudy(mass: Any, number: Any) -> Any:
    return ~((mass <= 0) | ((mass > 0) & (number <= 0)))


def effective_radius(
    liquid: LiquidCloud, there: Bool[Array, "layer *batch"] | None = None
) -> Float[Array, "*n"]:
    r"""Effective radius of the droplets; 0, with derivative 0, in a layer without cloud. [m]

    It is what mass and number say, r, from 1 to 100 um. Beyond, mass is kept and r bends towards
    0.61 and 165 um, so that a trace of mass spread over many droplets has a finite optical depth
    and derivative: with :math:`r_s` of 1 um and :math:`r_l` of 100 um

    .. math:: r_s \exp\frac{(r / r_s)^2 - 1}{2}, \qquad r_l \exp\frac{1 - (r_l / r)^2}{2},

    whose slopes are continuous with that of r. A layer has no cloud where mass or number is 0; that
    mass comes with number is checked where data enter a scene, not here. Mass that is no number,
    or whose number is none, gives none.

    Parameters
    ----------
    liquid
        Mass and number of the droplets. [kg m-2], [m-2]
    there
        Where there are any (`is_cloudy`), of arrays whose first axis is that of layers; None not to
        leave out what is empty (`pointwise.where_occupied`).
    """
    return _radius(there, (liquid.mass_path, liquid.number_path))


@where_occupied
def _radius(mass: Float[Array, "*n"], number: Float[Array, "*n"]) -> Float[Array, "*n"]:
    cloudy = _is_cloudy(mass, number)
    small = cloudy & (mass <= number * (_UNIT_MASS * SMALLEST_RADIUS**3))
    large = cloudy & (mass >= number * (_UNIT_MASS * LARGEST_RADIUS**3))
    # Roots are divided, and not masses, as the derivative of a quotient squares its denominator; of
    # large droplets upside down, for the same reason.
    mass_root, number_root = (jnp.cbrt(choose(cloudy, x, 1.0)) for x in (mass, number))
    quotient = choose(large, number_root, mass_root) / choose(large, mass_root, number_root)
    beyond = choose(
        small,
        quotient * (_UNIT_RADIUS / SMALLEST_RADIUS),
        choose(large, quotient * (LARGEST_RADIUS / _UNIT_RADIUS), 1.0),
    )
    excess = (beyond * beyond - 1) / 2  # 0 between the limits
    bend = jnp.exp(choose(large, -excess, excess))
    limit = choose(small, SMALLEST_RADIUS, choose(large, LARGEST_RADIUS, quotient * _UNIT_RADIUS))
    return choose(cloudy, limit * bend, 0.0)
