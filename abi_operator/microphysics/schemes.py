"""What microphysics schemes assume of each class of hydrometeor.

`SCHEMES[scheme][class]` is a `SizeDistribution`: how mass goes with diameter, the shape of the size
distribution, the closure that gives number, and the mean masses between which the scheme holds it.
Schemes are named as in WRF (lower case), classes by ``cloud drizzle rain ice snow graupel hail``
and, of RAMS, ``pristine`` and ``aggregates``.

The figures of WRF's schemes are those of its source (module_mp_wsm3, wsm5, wsm6, thompson,
morr_two_moment; public domain), those of RAMS of its table of habits. The number of cloud droplets
is an assumption in every single-moment scheme, and the one most worth replacing.

References
----------
.. [1] E. Kessler, "On the distribution and continuity of water substance in atmospheric
   circulations", Meteorol. Monogr., 10 (32), 1969, doi:10.1007/978-1-935704-36-2_1
.. [2] S.-Y. Hong, J. Dudhia and S.-H. Chen, "A revised approach to ice microphysical processes for
   the bulk parameterization of clouds and precipitation", Mon. Wea. Rev., 132, 103-120, 2004,
   doi:10.1175/1520-0493(2004)132<0103:ARATIM>2.0.CO;2
.. [3] S.-Y. Hong and J.-O. J. Lim, "The WRF single-moment 6-class microphysics scheme (WSM6)",
   J. Korean Meteor. Soc., 42, 129-151, 2006
.. [4] G. Thompson, P. R. Field, R. M. Rasmussen and W. D. Hall, "Explicit forecasts of winter
   precipitation using an improved bulk microphysics scheme. Part II", Mon. Wea. Rev., 136,
   5095-5115, 2008, doi:10.1175/2008MWR2387.1
.. [5] H. Morrison, G. Thompson and V. Tatarskii, "Impact of cloud microphysics on the development
   of trailing stratiform precipitation in a simulated squall line", Mon. Wea. Rev., 137, 991-1007,
   2009, doi:10.1175/2008MWR2556.1
.. [6] R. L. Walko, W. R. Cotton, M. P. Meyers and J. Y. Harrington, "New RAMS cloud microphysics
   parameterization part I: the single-moment scheme", Atmos. Res., 38, 29-62, 1995,
   doi:10.1016/0169-8095(94)00087-T
.. [7] M. P. Meyers, R. L. Walko, J. Y. Harrington and W. R. Cotton, "New RAMS cloud microphysics
   parameterization. Part II: the two-moment scheme", Atmos. Res., 45, 3-39, 1997,
   doi:10.1016/S0169-8095(97)00018-5
"""

import math
from typing import NamedTuple

from .closures import (
    Closure,
    FieldSnow,
    FixedNumber,
    IceMassPower,
    Intercept,
    Predicted,
    SnowIntercept,
    ThompsonGraupel,
)
from .gamma import MassLaw, log_moment, sphere


class SizeDistribution(NamedTuple):
    """What a scheme assumes of one class.

    Parameters
    ----------
    law
        Mass of one particle by its diameter.
    nu
        Shape: dN/dD = N0 D^nu exp(-Lam D). [-]
    closure
        What gives the number of particles.
    smallest_mass, largest_mass
        Limits of the mean mass of a particle. [kg]
    """

    law: MassLaw
    nu: float
    closure: Closure
    smallest_mass: float
    largest_mass: float


def size_distribution(scheme: str, name: str, *, assume: str | None = None) -> SizeDistribution:
    """What a scheme assumes of a class.

    Parameters
    ----------
    scheme, name
        Names in `SCHEMES`.
    assume
        Scheme whose assumptions are used where `scheme` is not in `SCHEMES`.

    Raises
    ------
    ValueError
        Where the scheme is not in `SCHEMES` and no other is assumed, or has no such class.
    """
    used = scheme if scheme in SCHEMES or assume is None else assume
    if used not in SCHEMES:
        raise ValueError(
            f"nothing is known of scheme {used!r}; have {list(SCHEMES)}, of which one can be "
            "assumed in its place."
        )
    if name not in SCHEMES[used]:
        raise ValueError(f"scheme {used!r} has no class {name!r}; it has {list(SCHEMES[used])}.")
    return SCHEMES[used][name]


# The scheme needs no number of droplets: what `SCHEMES` has of it is that of WSM.
_WITHOUT_DROPLET_NUMBER = ("kessler",)


def own_droplet_number(scheme: str) -> float | None:
    """Number of cloud droplets per volume that a scheme itself assumes; None where it has none.

    It is none where the scheme predicts the number, needs none, or is not in `SCHEMES`. [m-3]
    """
    if scheme not in SCHEMES or scheme in _WITHOUT_DROPLET_NUMBER:
        return None
    closure = SCHEMES[scheme]["cloud"].closure
    return float(closure.number) if isinstance(closure, FixedNumber) else None


def _by_slope(
    law: MassLaw, nu: float, closure: Closure, smallest: float, largest: float
) -> SizeDistribution:
    """Limits given as 1 / Lam. [m]"""
    unit = law.coefficient * math.exp(log_moment(law.power, nu))
    return SizeDistribution(law, nu, closure, unit * smallest**law.power, unit * largest**law.power)


def _by_diameter(
    law: MassLaw, nu: float, closure: Closure, smallest: float, largest: float
) -> SizeDistribution:
    """Limits given as diameters of the particle of mean mass. [m]"""
    limits = (law.coefficient * diameter**law.power for diameter in (smallest, largest))
    return SizeDistribution(law, nu, closure, *limits)


def _droplets(nu: float, number: float) -> SizeDistribution:
    """Droplets of an assumed number, with the limits of effective radius of WRF. [m-3]"""
    smallest, largest = (2 * radius / (nu + 3) for radius in (2.51e-6, 50e-6))
    return _by_slope(sphere(1000.0), nu, FixedNumber(number), smallest, largest)


# Numbers of droplets: WSM uses 3e8 m-3 where it needs one (xncr of autoconversion and nc0 of
# effective radii in WRF's source), Thompson 1e8 (Nt_c in the sources of WRF and MPAS; Thompson et
# al., 2008), Morrison 2.5e8 (NDCNST with INUM = 1 in the sources of WRF and ERF). Limits of slope
# that a scheme lacks are so wide here (1 cm) that they do not bite.
_WSM_RAIN = _by_slope(sphere(1000.0), 0.0, Intercept(8e6), 1 / 8e4, 1e-2)
_WSM_SNOW = _by_slope(sphere(100.0), 0.0, SnowIntercept(), 1 / 1e5, 1e-2)
# D = 11.9 m^(1/2), from 12.9 um on; the 500 um of the scheme limit fall speed and not mass.
_WSM_ICE = _by_diameter(MassLaw(1 / 11.9**2, 2.0), 0.0, IceMassPower(), 12.9e-6, 1e-2)
_WSM5 = {"cloud": _droplets(7.0, 3e8), "rain": _WSM_RAIN, "ice": _WSM_ICE, "snow": _WSM_SNOW}

SCHEMES: dict[str, dict[str, SizeDistribution]] = {
    "kessler": {
        "cloud": _droplets(7.0, 3e8),
        "rain": _by_slope(sphere(1000.0), 0.0, Intercept(1e7), 1 / 8e4, 1e-2),
    },
    "wsm3": _WSM5,
    "wsm5": _WSM5,
    "wsm6": _WSM5 | {"graupel": _by_slope(sphere(500.0), 0.0, Intercept(4e6), 1 / 6e4, 1e-2)},
    "thompson": {
        # nu is 12 for the number assumed (`droplet_shape`).
        "cloud": _droplets(12.0, 1e8),
        # Median volume diameter, 3.672 / Lam, between 37.5 um and 2.5 mm.
        "rain": _by_slope(sphere(1000.0), 0.0, Predicted(), 37.5e-6 / 3.672, 2.5e-3 / 3.672),
        # 4 / Lam between 5 and 300 um.
        "ice": _by_slope(sphere(890.0), 0.0, Predicted(), 5e-6 / 4, 300e-6 / 4),
        # Half the ratio of the third to the second moment between 5 and 999 um.
        "snow": _by_slope(MassLaw(0.069, 2.0), 0.0, FieldSnow(), 10e-6 / 3, 1998e-6 / 3),
        # Median volume diameter between 50 um and 25.4 mm.
        "graupel": _by_slope(sphere(500.0), 0.0, ThompsonGraupel(), 50e-6 / 3.672, 25.4e-3 / 3.672),
    },
    "morrison": {
        "cloud": _droplets(4.83, 2.5e8),  # the shape of 250 droplets cm-3 (`droplet_shape`)
        "rain": _by_slope(sphere(997.0), 0.0, Predicted(), 20e-6, 2800e-6),
        "ice": _by_slope(sphere(500.0), 0.0, Predicted(), 1e-6, 350e-6),
        "snow": _by_slope(sphere(100.0), 0.0, Predicted(), 10e-6, 2000e-6),
        "graupel": _by_slope(sphere(400.0), 0.0, Predicted(), 20e-6, 2000e-6),
        "hail": _by_slope(sphere(900.0), 0.0, Predicted(), 20e-6, 2000e-6),
    },
    # Shapes are one less than RAMS's own nu (9 of cloud, 2 of the others, as in OLAM's table; both
    # are settings of a run).
    "rams": {
        "cloud": _by_diameter(MassLaw(524.0, 3.0), 8.0, Predicted(), 2e-6, 40e-6),
        "drizzle": _by_diameter(MassLaw(524.0, 3.0), 1.0, Predicted(), 65e-6, 100e-6),
        "rain": _by_diameter(MassLaw(524.0, 3.0), 1.0, Predicted(), 0.1e-3, 5e-3),
        "pristine": _by_diameter(MassLaw(110.8, 2.91), 1.0, Predicted(), 15e-6, 125e-6),
        "snow": _by_diameter(MassLaw(2.739e-3, 1.74), 1.0, Predicted(), 0.1e-3, 10e-3),
        "aggregates": _by_diameter(MassLaw(0.496, 2.4), 1.0, Predicted(), 0.1e-3, 10e-3),
        "graupel": _by_diameter(MassLaw(157.0, 3.0), 1.0, Predicted(), 0.1e-3, 5e-3),
        "hail": _by_diameter(MassLaw(471.0, 3.0), 1.0, Predicted(), 0.8e-3, 10e-3),
    },
}
