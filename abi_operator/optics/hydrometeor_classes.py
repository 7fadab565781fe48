"""What is assumed of each class of hydrometeor: shapes, distributions of size, asymmetry."""

from collections.abc import Mapping
from typing import NamedTuple

from jaxtyping import Array

from ..atmosphere import Hydrometeor
from ..constants import WATER_DENSITY
from .droplets import LARGEST_RADIUS, NU, SMALLEST_RADIUS
from .gamma import Habit, sphere_habit
from .ice_tables import CRYSTALS, ICE_DENSITY

HABITS: dict[str, Habit] = {
    "drops": sphere_habit(WATER_DENSITY, WATER_DENSITY),
    **CRYSTALS,
    # Bulk densities of graupel and hail in the scheme of Morrison. [kg m-3]
    "graupel": sphere_habit(400.0, ICE_DENSITY),
    "hail": sphere_habit(900.0, ICE_DENSITY),
}
"""Shapes of particles by name."""

# Asymmetry factor of what graupel and hail do not diffract, opaque lumps with a rough surface: 0.8
# of all light where they do not absorb. [-] (An assumption, between the 0.75 of roughened crystals
# and the 0.87 of smooth spheres in the visible.)
RIMED_GEOMETRIC = 0.6
# Tunnelling of crystals relative to spheres. [-] (0.6 to 0.8 by habit: D. L. Mitchell et al.,
# "Testing and comparing the modified anomalous diffraction approximation", J. Atmos. Sci., 63,
# 2948-2962, 2006, doi:10.1175/JAS3775.1; it moves extinction by 1 % or less from 20 um on)
CRYSTAL_TUNNELLING = 0.7

# Kinds of asymmetry factor: of one lobe, and of what is not diffracted, beside the lobe that is.
ONE_LOBE, TWO_LOBES = ("droplets", "rain"), ("fu1996", "baum2014", "roughened", "rimed")
EFFICIENCIES = ("mitchell", "fu1996")


class ClassOptics(NamedTuple):
    """How one class of hydrometeor is seen.

    Parameters
    ----------
    habit
        Shape of the particles, or its name in `HABITS`.
    nu
        Shape of the gamma distribution of diameters. [-]
    smallest_radius, largest_radius
        Effective radii between which mass and number are believed. [m] Beyond, size bends smoothly
        towards 1.65 times the limit, or its inverse, while mass stays what it is.
    asymmetry
        Asymmetry factor: a number, ``"droplets"`` or ``"rain"`` (Mie theory), of one lobe; or one
        of ``"fu1996"`` (smooth hexagonal columns), ``"baum2014"`` (rough crystals of many habits),
        ``"roughened"`` (0.75 in the visible) and ``"rimed"`` (0.8), of two (`diffraction`). [-]
    efficiencies
        Extinction and absorption by ``"mitchell"`` (modified anomalous diffraction) or, for ice,
        ``"fu1996"`` (geometric optics of hexagonal columns of the same effective size).
    internal_reflection, tunnelling_factor
        Coefficient a1 of modified anomalous diffraction, None for that of spheres (1 in Mitchell
        1996, 0.8 for plates), and tunnelling relative to spheres. [-]
    """

    habit: str | Habit
    nu: float | Array
    smallest_radius: float
    largest_radius: float
    asymmetry: str | float | Array
    efficiencies: str = "mitchell"
    internal_reflection: float | Array | None = None
    tunnelling_factor: float | Array = 1.0


def _ice(habit: str, nu: float, largest_radius: float) -> ClassOptics:
    """Crystals, from an effective radius of 2 um. [m]"""
    optics = ClassOptics(habit, nu, 2e-6, largest_radius, "fu1996")
    return optics._replace(tunnelling_factor=CRYSTAL_TUNNELLING)


CLASSES: dict[str, ClassOptics] = {
    "cloud": ClassOptics("drops", NU, SMALLEST_RADIUS, LARGEST_RADIUS, "droplets"),
    "drizzle": ClassOptics("drops", 1.0, 1e-5, 1e-3, "rain"),
    "rain": ClassOptics("drops", 0.0, 1e-5, 5e-3, "rain"),
    "ice": _ice("columns", 0.0, 5e-4),
    "pristine": _ice("columns", 1.0, 5e-4),
    "snow": _ice("aggregates", 0.0, 1e-3),
    "aggregates": _ice("aggregates", 1.0, 1e-3),
    "graupel": ClassOptics("graupel", 0.0, 1e-5, 1e-2, "rimed"),
    "hail": ClassOptics("hail", 0.0, 1e-5, 3e-2, "rimed"),
}
"""What is assumed of each class; vary it by ``CLASSES | {"snow": CLASSES["snow"]._replace(...)}``.
"""


def class_optics(
    name: str, classes: Mapping[str, ClassOptics], particles: Hydrometeor | None = None
) -> tuple[ClassOptics, Habit]:
    """Assumptions of a class, as its particles ask for them, and its habit, checked.

    Parameters
    ----------
    name, classes
        Name of the class, and what is assumed of each.
    particles
        Of which the optics are read: ``"rough"`` replaces the asymmetry of smooth crystals.

    Raises
    ------
    ValueError
        Where nothing is assumed of the class, or what is assumed is not known here.
    """
    if name not in classes:
        raise ValueError(f"nothing is assumed of hydrometeor {name!r}; have {sorted(classes)}.")
    optics = classes[name]
    if particles is not None and (particles.optics, optics.asymmetry) == ("rough", "fu1996"):
        optics = optics._replace(asymmetry="baum2014")
    if isinstance(optics.habit, str) and optics.habit not in HABITS:
        raise ValueError(f"no habit {optics.habit!r} (of {name!r}); have {list(HABITS)}.")
    have = ONE_LOBE + TWO_LOBES
    if isinstance(optics.asymmetry, str) and optics.asymmetry not in have:
        raise ValueError(f"no asymmetry {optics.asymmetry!r} (of {name!r}); have {have}.")
    habit = HABITS[optics.habit] if isinstance(optics.habit, str) else optics.habit
    if optics.efficiencies not in EFFICIENCIES[: 1 if is_water(habit) else 2]:
        raise ValueError(f"no efficiencies {optics.efficiencies!r} for {name!r}: {EFFICIENCIES}.")
    return optics, habit


def is_water(habit: Habit) -> bool:
    """Whether particles are drops."""
    return habit.density == WATER_DENSITY
