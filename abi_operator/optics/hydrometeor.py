"""Scattering and absorption by any class of hydrometeor, from its mass and number."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._numerics import safe_divide
from ..atmosphere import Atmosphere, Hydrometeor
from ..bands import AnyBand, Band, OneOf, constants, first_missing, one_of
from ..optical_properties import OpticalProperties, Scatterer
from . import rain, rough_ice, water
from .anomalous_diffraction import Matter, matter, mean_efficiencies
from .cloud import fitted_radii_um, liquid_cloud
from .diffraction import diffracted_share, diffraction_asymmetry
from .droplets import effective_radius
from .gamma import Habit, equivalent_shape, mean_mass_of_path, photon_path
from .hydrometeor_classes import (
    CLASSES,
    RIMED_GEOMETRIC,
    TWO_LOBES,
    ClassOptics,
    class_optics,
    is_water,
)
from .ice import (
    ROUGHENED_GEOMETRIC,
    SIZE_PER_PATH,
    ice_coalbedo,
    ice_geometric_asymmetry,
    ice_mass_extinction,
)
from .ice_tables import FU, FU_RANGE_UM, ICE_INDEX, Fu
from .phase import HenyeyGreenstein, TwoTermHenyeyGreenstein
from .pointwise import choose, where_occupied

# Beyond a limit of size the logarithm of size goes on by this much at most. [-]
_BEND = 0.5
# Effective radius at which formulas are evaluated, to no effect, where there are no particles. [m]
_IDLE_RADIUS = 3e-5


def hydrometeor(
    atmosphere: Atmosphere,
    name: str,
    band: AnyBand,
    classes: Mapping[str, ClassOptics] = CLASSES,
) -> OpticalProperties:
    r"""Optical properties of one class of hydrometeor, from mass and number of its particles.

    .. math:: \tau = \frac{m\, \bar Q_\mathrm{ext}}{\rho\, \bar d}

    with the mean photon path d of the particles (`gamma`) and efficiencies by modified anomalous
    diffraction, and phase functions of one or two lobes of Henyey and Greenstein. A layer without
    mass or without number is empty, with derivative 0.

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
    optics, habit = class_optics(name, classes, particles)
    present = jnp.asarray(_present(particles.mass_path, particles.number_path))
    radius = _radius(particles, optics, habit, present)
    mass = jnp.where(present, particles.mass_path, 0)
    seen = _seen(present, radius, optics, habit, band)
    extinction = mass * seen.extinction
    phase = HenyeyGreenstein(seen.asymmetry)
    if optics.asymmetry in TWO_LOBES:
        phase = TwoTermHenyeyGreenstein(seen.lobe, seen.asymmetry, seen.share)
    scatterer = Scatterer(extinction - mass * seen.absorption, phase, present)
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
    present = _present(particles.mass_path, particles.number_path)
    return jnp.where(present, _radius(particles, *class_optics(name, classes)), 0)


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
    optics, habit = class_optics(name, classes)
    present = ~(effective_radius <= 0)
    log_path = jnp.log(jnp.where(present, effective_radius, _IDLE_RADIUS)) + math.log(4 / 3)
    number = mass_path * jnp.exp(-mean_mass_of_path(log_path, habit, optics.nu))
    return Hydrometeor(mass_path, jnp.where(present, number, 0))


def outside_fitted_range(
    atmosphere: Atmosphere, band: Band, classes: Mapping[str, ClassOptics] = CLASSES
) -> Float[Array, ""]:
    """Fraction of the optical depth of hydrometeors whose size is beyond what was fitted. [-]

    Fitted are effective radii of 1.74-59 um for the liquid cloud by Mie theory and 2-50 um for one
    by ``"mitchell"`` and the class of that kind, 20-2000 um for rain, and generalized effective
    sizes of 20-130 um for ice by Fu (1996), effective radii of 5-60 um for the asymmetry factor of
    rough ice; of a class that uses several fits, sizes that all of them cover. Where the asymmetry
    factor is a given number just the limits of the class count.

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
        optics, habit = class_optics(name, classes, particles)
        radius = _radius(particles, optics, habit)
        smallest, largest = _fitted_radii(optics)
        total = total + jnp.sum(tau)
        outside = outside + jnp.sum(jnp.where((radius < smallest) | (radius > largest), tau, 0))
    return safe_divide(outside, total)


def _radius(
    particles: Hydrometeor, optics: ClassOptics, habit: Habit, there: Array | None = None
) -> Array:
    """Effective radius, bent at the limits; of layers first, `there` leaves out empty ones. [m]"""
    limits = optics.smallest_radius, optics.largest_radius
    amounts = particles.mass_path, particles.number_path
    return _bent_radius(there, amounts, habit, optics.nu, limits)


def _present(mass: Any, number: Any) -> Any:
    # Below it the reciprocal, which a derivative needs, is not finite. What is no number is not
    # empty, and what follows from it is no number either.
    tiny = np.finfo(mass.dtype).tiny * 4
    return ~((mass <= tiny) | ((mass > tiny) & (number <= tiny)))


@where_occupied
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


class _Seen(NamedTuple):
    """Extinction and absorption per mass [m2 kg-1], asymmetry factor of all scattered light or of
    what is not diffracted, share of what is, and asymmetry factor of that. [-]"""

    extinction: Array
    absorption: Array
    asymmetry: Array
    share: Array
    lobe: Array


def _seen(present: Array, radius: Array, optics: ClassOptics, habit: Habit, band: AnyBand) -> _Seen:
    """What is seen of a class, by effective radius."""
    dtype, given = radius.dtype, optics.asymmetry
    index = water.REFRACTIVE_INDEX if is_water(habit) else ICE_INDEX
    seen = _of_radius(
        present,
        (radius,),
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
        given = jnp.broadcast_to(jnp.asarray(given, dtype), radius.shape)
        seen = seen._replace(asymmetry=given)
    return seen


@where_occupied
def _of_radius(
    radius: Array,
    wavelength_um: float | Array,
    substance: Matter,
    fits: Fu,
    band: OneOf,
    optics: ClassOptics,
    density: float,
) -> _Seen:
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
        asymmetry = ice_geometric_asymmetry(size_um, fits, wavelength_um)
    elif optics.asymmetry == "baum2014":
        asymmetry = rough_ice.rough_ice_geometric_asymmetry(radius_um, band)
    else:
        fixed = RIMED_GEOMETRIC if optics.asymmetry == "rimed" else ROUGHENED_GEOMETRIC
        # Of every band that has a radius of its own: JAX takes no result for several bands of which
        # the slopes are of each.
        asymmetry = fixed + 0 * radius
    share = diffracted_share(1 - absorption / extinction)
    lobe = diffraction_asymmetry(radius_um, wavelength_um)
    return _Seen(extinction, absorption, asymmetry, share, lobe)


def _fitted_radii(optics: ClassOptics) -> tuple[float, float]:
    """Effective radii for which what a class uses was fitted. [m]"""
    kind = optics.asymmetry if isinstance(optics.asymmetry, str) else "given"
    fits = []
    if kind == "droplets":
        fits.append((water.EFFECTIVE_RADIUS_UM[0], water.EFFECTIVE_RADIUS_UM[-1]))
    if kind == "rain":
        fits.append((rain.EFFECTIVE_RADIUS_UM[1], rain.EFFECTIVE_RADIUS_UM[-1]))
    if kind == "baum2014":
        fits.append((rough_ice.EFFECTIVE_RADIUS_UM[0], rough_ice.EFFECTIVE_RADIUS_UM[-1]))
    if "fu1996" in (kind, optics.efficiencies):
        fits.append(tuple(size * 3 / (4 * SIZE_PER_PATH) for size in FU_RANGE_UM))
    if not fits:
        return optics.smallest_radius, optics.largest_radius
    return 1e-6 * max(low for low, _ in fits), 1e-6 * min(high for _, high in fits)
