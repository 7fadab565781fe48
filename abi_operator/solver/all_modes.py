"""What leaves the top of columns in all azimuth modes, from what all modes share.

Whatever all modes need alike (Legendre functions, the ground, what is emitted) is prepared here.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .column import Column, Options
from .gradient import emission
from .gradient.emission import radiance
from .gradient.emitting_mode import Heating
from .gradient.mode_sum import Given, ModeSum, mode_sum
from .gradient.modes import LATER, How
from .lit import seen_from_the_view, weights_of_modes
from .method.adding import emitting_ground
from .method.around import Above
from .method.azimuth import Directions, legendre_tables, weighted_moments
from .method.bordered import Bordered
from .method.delta_m import ScaledLayers
from .method.ground import (
    Grounds,
    absorbed_by_lambertian,
    isotropic,
    lambertian,
    reflecting,
)
from .method.surface import AnySurface
from .skipping.plan import LayersOfModes


class Sunlit(NamedTuple):
    """What the sum over the modes of reflectances is of.

    Parameters
    ----------
    layers, directions
        Of the air, as it is solved, and of the light in it.
    albedo
        Of the ground.
    azimuth
        Of each view, from the sun. [rad]
    """

    layers: ScaledLayers
    directions: Directions
    albedo: Array | AnySurface
    azimuth: Float[Array, "view *batch"]


def twice_reflected(given: tuple[Sunlit, Given], options: Options) -> Float[Array, "view *batch"]:
    """Twice the sum over all modes of what is given, with what only that needs."""
    (layers, directions, albedo, azimuth), known = given
    grounds = grounds_of(albedo, directions, options)
    return _twice_reflected(layers, directions, grounds, azimuth, known, options)


def twice_reflected_between(
    layers: ScaledLayers,
    directions: Directions,
    below: Bordered,
    above: Above,
    azimuth: Float[Array, "view *batch"],
    known: Given,
    options: Options,
) -> Float[Array, "view *batch"]:
    """The same of layers between others, which are given in all modes (`method.around`)."""
    grounds = _by_modes(below)
    return _twice_reflected(layers, directions, grounds, azimuth, known, options, above)


def _twice_reflected(layers, directions, grounds, azimuth, known, options, above=None):
    even, odd = weighted_moments(layers)
    sun_secants, cosines = directions.sun_secants, directions.cosines
    inputs = ModeSum(
        layers=LayersOfModes(layers.tau, layers.coalbedo, sun_secants, (even, odd)),
        view_secants=1 / cosines[1:],
        beams=legendre_tables(options.num_streams, options.num_modes, cosines).beams,
        ground=grounds.mean,
        grounds=grounds.others,
        weights=weights_of_modes(options.num_modes, azimuth),
        above=above,
        absorbed=grounds.absorbed,
    )
    return mode_sum(inputs, known, _how(options))


class Shining(NamedTuple):
    """Columns that emit, as their modes are solved.

    Parameters
    ----------
    column, layers, directions
        As they are given, and as they are solved.
    sun
        Radiance of a reflectance of 1.
    given
        What is known of them.
    """

    column: Column
    layers: ScaledLayers
    directions: Directions
    sun: Float[Array, "*batch"]
    given: emission.Given


def radiated(shining: Shining, options: Options) -> Float[Array, "*batch"]:
    """Sum over the modes, without what is seen at once, with what only that needs."""
    column, layers, directions, sun, given = shining
    cosines = directions.cosines
    one = isotropic(options.num_streams, cosines)
    tables = legendre_tables(options.num_streams, options.num_modes, cosines)
    grounds = grounds_of(column.albedo, directions, options)
    zero = jnp.zeros_like(column.mu0)
    shine = column.planck_levels, column.surface_emission, column.isotropic_top
    planck, from_ground, from_above = (zero if x is None else x for x in shine)
    cold = column.planck_levels is None
    at_top, at_ground = (zero, zero) if cold else (planck[0], planck[-1])
    heating = Heating(
        jumps=jnp.zeros_like(column.tau) if cold else planck[1:] - planck[:-1],
        ground=emitting_ground(grounds.mean, one, from_ground, at_ground).column,
        above=2 * (from_above - at_top),
    )
    weights = 0.5 * sun * weights_of_modes(options.num_modes, column.relative_azimuth[0])
    lit = seen_from_the_view(layers, tables, directions, grounds, weights, heating)
    return radiance(lit, given, _how(options))


def _how(options: Options) -> How:
    return How(not options.tms, options.error_budget, options.num_doublings, options.delta_m)


def grounds_of(albedo: Array | AnySurface, directions: Directions, options: Options) -> Grounds:
    """Ground in all modes."""
    cosines, num_streams = directions.cosines, options.num_streams
    if not isinstance(albedo, AnySurface):
        mean = lambertian(albedo, cosines, num_streams)
        return Grounds(mean, absorbed=absorbed_by_lambertian(albedo))

    # All modes at once: a reflectance is evaluated at its azimuths only once.
    return _by_modes(
        jax.vmap(lambda m: reflecting(albedo, m, cosines, num_streams))(
            jnp.arange(options.num_modes)
        )
    )


def _by_modes(admittances: Bordered) -> Grounds:
    """From those of all modes, on the first axis of every leaf."""
    mean, others = (jax.tree.map(lambda x, i=i: x[i], admittances) for i in (0, LATER))
    return Grounds(mean, others)
