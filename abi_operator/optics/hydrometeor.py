"""Scattering and absorption by any class of hydrometeor, from its mass and number."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._numerics import safe_divide
from ..atmosphere import Atmosphere, Hydrometeor
from ..bands import AnyBand, Band, OneOf, constants, first_missing, one_of
from ..constants import WATER_DENSITY
from ..optical_properties import OpticalProperties, Scatterer
from . import rain, rough_ice, water
from .anomalous_diffraction import Matter, matter, mean_efficiencies
from .cloud import fitted_radii_um, liquid_cloud
from .droplets import LARGEST_RADIUS, NU, SMALLEST_RADIUS, effective_radius
from .gamma import Habit, equivalent_shape, mean_mass_of_path, photon_path, sphere_habit
from .ice import (
    ROUGHENED_ASYMMETRY,
    SIZE_PER_PATH,
    ice_asymmetry,
    ice_coalbedo,
    ice_mass_extinction,
)
from .ice_tables import CRYSTALS, FU, FU_RANGE_UM, ICE_DENSITY, ICE_INDEX, Fu
from .phase import HenyeyGreenstein
from .pointwise import choose, pointwise

HABITS: dict[str, Habit] = {
    "drops": sphere_habit(WATER_DENSITY, WATER_DENSITY),
    **CRYSTALS,
    # Bulk densities of graupel and hail in the scheme of Morrison. [kg m-3]
    "graupel": sphere_habit(400.0, ICE_DENSITY),
    "hail": sphere_habit(900.0, ICE_DENSITY),
}
"""Shapes of particles by name."""

# Asymmetry factor of graupel and hail, opaque lumps with a rough surface. [-] (An assumption,
# between the 0.75 of roughened crystals and the 0.87 of smooth spheres in the visible.)
RIMED_ASYMMETRY = 0.8
# Tunnelling of crystals relative to spheres. [-] (0.6 to 0.8 by habit: D. L. Mitchell et al.,
# "Testing and comparing the modified anomalous diffraction approximation", J. Atmos. Sci., 63,
# 2948-2962, 2006, doi:10.1175/JAS3775.1; it moves extinction by 1 % or less from 20 um on)
CRYSTAL_TUNNELLING = 0.7

ASYMMETRIES = ("droplets", "rain", "fu1996", "baum2014", "roughened")
EFFICIENCIES = ("mitchell", "fu1996")
# Beyond a limit of size the logarithm of size goes on by this much at most. [-]
_BEND = 0.5
# Effective radius at which formulas are evaluated, to no effect, where there are no particles. [m]
_IDLE_RADIUS = 3e-5


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
        Asymmetry factor: a number, or one of ``"droplets"``, ``"rain"`` (Mie theory), ``"fu1996"``
        (smooth hexagonal columns), ``"baum2014"`` (rough crystals of many habits),
        ``"roughened"`` (0.75). [-]
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
    "graupel": ClassOptics("graupel", 0.0, 1e-5, 1e-2, RIMED_ASYMMETRY),
    "hail": ClassOptics("hail", 0.0, 1e-5, 3e-2, RIMED_ASYMMETRY),
}
"""What is assumed of each class; vary it by ``CLASSES | {"snow": CLASSES["snow"]._replace(...)}``.
"""


def hydrometeor(
    atmosphere: Atmosphere,
    name: str,
    band: AnyBand,
    classes: Mapping[str, ClassOptics] = CLASSES,
) -> OpticalProperties:
    r"""Optical properties of one class of hydrometeor, from mass and number of its particles.

    .. math:: \tau = \frac{m\, \bar Q_\mathrm{ext}}{\rho\, \bar d}

    with the mean photon path d of the particles (`gamma`) and efficiencies by modified anomalous
    diffraction, and the phase function of Henyey and Greenstein. A layer without mass or without
    number is empty, with derivative 0.

    Parameters
    ----------
    atmosphere
        One column, of which the class is read.
    name
        Name of the class in `atmosphere` and in `classes`.
    band
        Band.
    classes
        What is assumed of each class.

    Raises
    ------
    ValueError
        Where the atmosphere has no such class, or nothing is assumed of it, or the band has no
        refractive index.
    """
    if name not in atmosphere.hydrometeors:
        have = sorted(atmosphere.hydrometeors)
        raise ValueError(f"no hydrometeor {name!r}; the atmosphere has {have}.")
    if missing := first_missing(band.name, ICE_INDEX):
        raise ValueError(f"no index of ice and water for {missing!r}; have {list(ICE_INDEX)}.")
    particles = atmosphere.hydrometeors[name]
    optics, habit = _class_optics(name, classes, particles)
    present, radius = _radius(particles, optics, habit)
    mass = jnp.where(present, particles.mass_path, 0)
    cross_section, absorbed, asymmetry = _seen(radius, optics, habit, band)
    extinction = mass * cross_section
    scatterer = Scatterer(extinction - mass * absorbed, HenyeyGreenstein(asymmetry))
    return OpticalProperties(extinction[None, :], jnp.ones(1, extinction.dtype), (scatterer,))


def particle_radius(
    particles: Hydrometeor, name: str, classes: Mapping[str, ClassOptics] = CLASSES
) -> Float[Array, "*batch layer"]:
    """Effective radius 3 M / (4 rho A) of a class; 0, with derivative 0, where it is empty. [m]

    Parameters
    ----------
    particles
        Mass and number of the particles. [kg m-2], [m-2]
    name, classes
        Name of the class, and what is assumed of each.
    """
    present, radius = _radius(particles, *_class_optics(name, classes))
    return jnp.where(present, radius, 0)


def from_effective_radius(
    mass_path: Float[Array, "*batch layer"],
    effective_radius: Float[Array, "*batch layer"],
    name: str,
    classes: Mapping[str, ClassOptics] = CLASSES,
) -> Hydrometeor:
    """Mass and number of a class whose effective radius a model supplies.

    The inverse of `particle_radius` between the limits of the class. Where the radius is 0 there
    are no particles.

    Parameters
    ----------
    mass_path, effective_radius
        Mass in each layer per horizontal area; effective radius, 3 M / (4 rho A). [kg m-2], [m]
    name, classes
        Name of the class, and what is assumed of each.
    """
    optics, habit = _class_optics(name, classes)
    present = effective_radius > 0
    log_path = jnp.log(jnp.where(present, effective_radius, _IDLE_RADIUS)) + math.log(4 / 3)
    number = mass_path * jnp.exp(-mean_mass_of_path(log_path, habit, optics.nu))
    return Hydrometeor(mass_path, jnp.where(present, number, 0))


def outside_fitted_range(
    atmosphere: Atmosphere, band: Band, classes: Mapping[str, ClassOptics] = CLASSES
) -> Float[Array, ""]:
    """Fraction of the optical depth of hydrometeors whose size is beyond what was fitted. [-]

    Fitted are effective radii of 1.74-59 um for the liquid cloud by Mie theory and 2-50 um for one
    by ``"mitchell"`` and the class of that kind, 20-2000 um for rain, and generalized effective
    sizes of 20-130 um for ice by Fu (1996), effective radii of 5-60 um for rough ice. Where the
    asymmetry factor is a given number just the limits of the class count.

    Parameters
    ----------
    atmosphere, band, classes
        As in `hydrometeor`; the liquid cloud of the column is counted too.
    """
    cloud = liquid_cloud(atmosphere, band).tau[0]
    radius_um = 1e6 * effective_radius(atmosphere.liquid)
    smallest, largest = fitted_radii_um(atmosphere.liquid)
    total = jnp.sum(cloud)
    outside = jnp.sum(jnp.where((radius_um < smallest) | (radius_um > largest), cloud, 0))
    for name in sorted(atmosphere.hydrometeors):
        tau = hydrometeor(atmosphere, name, band, classes).tau[0]
        particles = atmosphere.hydrometeors[name]
        optics, habit = _class_optics(name, classes, particles)
        _, radius = _radius(particles, optics, habit)
        smallest, largest = _fitted_radii(optics)
        total = total + jnp.sum(tau)
        outside = outside + jnp.sum(jnp.where((radius < smallest) | (radius > largest), tau, 0))
    return safe_divide(outside, total)


def _class_optics(
    name: str, classes: Mapping[str, ClassOptics], particles: Hydrometeor | None = None
) -> tuple[ClassOptics, Habit]:
    """Assumptions of a class, as its particles ask for them, and its habit, checked."""
    if name not in classes:
        raise ValueError(f"nothing is assumed of hydrometeor {name!r}; have {sorted(classes)}.")
    optics = classes[name]
    if particles is not None and (particles.optics, optics.asymmetry) == ("rough", "fu1996"):
        optics = optics._replace(asymmetry="baum2014")
    if isinstance(optics.habit, str) and optics.habit not in HABITS:
        raise ValueError(f"no habit {optics.habit!r} (of {name!r}); have {list(HABITS)}.")
    if isinstance(optics.asymmetry, str) and optics.asymmetry not in ASYMMETRIES:
        raise ValueError(f"no asymmetry {optics.asymmetry!r} (of {name!r}); have {ASYMMETRIES}.")
    habit = HABITS[optics.habit] if isinstance(optics.habit, str) else optics.habit
    if optics.efficiencies not in EFFICIENCIES[: 1 if _is_water(habit) else 2]:
        raise ValueError(f"no efficiencies {optics.efficiencies!r} for {name!r}: {EFFICIENCIES}.")
    return optics, habit


def _is_water(habit: Habit) -> bool:
    return habit.density == WATER_DENSITY


def _radius(particles: Hydrometeor, optics: ClassOptics, habit: Habit) -> tuple[Array, Array]:
    """Whether there are particles, and their effective radius, bent at the limits. [m]"""
    mass, number = particles.mass_path, particles.number_path
    limits = optics.smallest_radius, optics.largest_radius
    return _present(mass, number), _bent_radius(mass, number, habit, optics.nu, limits)


def _present(mass: Array, number: Array) -> Array:
    # Below it the reciprocal, which a derivative needs, is not finite.
    tiny = np.finfo(mass.dtype).tiny * 4
    return (mass > tiny) & (number > tiny)


@pointwise
def _bent_radius(
    mass: Array, number: Array, habit: Habit, nu: float | Array, limits: tuple[float, float]
) -> Array:
    present = _present(mass, number)
    log_mass = jnp.log(choose(present, mass, 1.0)) - jnp.log(choose(present, number, 1.0))
    log_radius = photon_path(log_mass, habit, nu) + math.log(3 / 4)
    log_radius = choose(present, log_radius, math.log(_IDLE_RADIUS))
    small, large = (math.log(x) for x in limits)
    over, under = log_radius > large, log_radius < small
    excess = choose(over, log_radius - large, choose(under, small - log_radius, 0.0))
    bent = _BEND * -jnp.expm1(-excess / _BEND)
    log_radius = choose(over, large + bent, choose(under, small - bent, log_radius))
    return jnp.exp(log_radius)


def _seen(
    radius: Array, optics: ClassOptics, habit: Habit, band: AnyBand
) -> tuple[Array, Array, Array]:
    """Extinction and absorption per mass, and asymmetry factor, by effective radius. [m2 kg-1]"""
    dtype, given = radius.dtype, optics.asymmetry
    index = water.REFRACTIVE_INDEX if _is_water(habit) else ICE_INDEX
    extinction, absorption, asymmetry = _of_radius(
        radius,
        band.wavelength_um,
        constants(lambda name: matter(index[name]), band.name, dtype),
        constants(FU.__getitem__, band.name, dtype),
        one_of(band.name),
        optics._replace(
            habit="",
            nu=equivalent_shape(habit, optics.nu),
            asymmetry=given if isinstance(given, str) else "",
        ),
        habit.density,
    )
    if not isinstance(given, str):
        asymmetry = jnp.broadcast_to(jnp.asarray(given, dtype), radius.shape)
    return extinction, absorption, asymmetry


@pointwise
def _of_radius(
    radius: Array,
    wavelength_um: float | Array,
    substance: Matter,
    fits: Fu,
    band: OneOf,
    optics: ClassOptics,
    density: float,
) -> tuple[Array, Array, Array]:
    radius_um, size_um = 1e6 * radius, 1e6 * SIZE_PER_PATH * 4 / 3 * radius
    if optics.efficiencies == "fu1996":
        extinction = ice_mass_extinction(size_um, fits)
        absorption = extinction * ice_coalbedo(size_um, fits)
    else:
        q_ext, q_abs = mean_efficiencies(
            radius_um,
            wavelength_um,
            substance,
            optics.nu,
            internal_reflection=optics.internal_reflection,
            tunnelling_factor=optics.tunnelling_factor,
        )
        area = 1 / (density * 4 / 3 * radius)
        extinction, absorption = area * q_ext, area * q_abs
    if optics.asymmetry == "droplets":
        asymmetry = water.droplet_asymmetry(radius_um, band)
    elif optics.asymmetry == "rain":
        asymmetry = rain.rain_asymmetry(radius_um, band)
    elif optics.asymmetry == "fu1996":
        asymmetry = ice_asymmetry(size_um, fits)
    elif optics.asymmetry == "baum2014":
        asymmetry = rough_ice.rough_ice_asymmetry(radius_um, band)
    else:
        asymmetry = jnp.full_like(radius, ROUGHENED_ASYMMETRY)
    return extinction, absorption, asymmetry


def _fitted_radii(optics: ClassOptics) -> tuple[float, float]:
    """Effective radii for which what a class uses was fitted. [m]"""
    kind = optics.asymmetry if isinstance(optics.asymmetry, str) else "given"
    if kind == "droplets":
        return 1e-6 * water.EFFECTIVE_RADIUS_UM[0], 1e-6 * water.EFFECTIVE_RADIUS_UM[-1]
    if kind == "rain":
        return 1e-6 * rain.EFFECTIVE_RADIUS_UM[1], 1e-6 * rain.EFFECTIVE_RADIUS_UM[-1]
    if kind == "baum2014":
        radii_um = rough_ice.EFFECTIVE_RADIUS_UM
        return 1e-6 * radii_um[0], 1e-6 * radii_um[-1]
    if "fu1996" in (kind, optics.efficiencies):
        lower, upper = (1e-6 * size * 3 / (4 * SIZE_PER_PATH) for size in FU_RANGE_UM)
        return lower, upper
    return optics.smallest_radius, optics.largest_radius
