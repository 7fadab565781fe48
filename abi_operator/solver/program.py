"""From a tile of columns to what leaves its top: the solver's parts put together."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .all_modes import Shining, grounds_of, radiated
from .column import Column, Options
from .foreknown import warm_of
from .gradient.emission import Given, radiance
from .gradient.emitting_mode import Heating
from .gradient.fluxes import spherical_albedo
from .gradient.modes import How
from .lit import seen_from, upside_down
from .method.adding import emitting_ground
from .method.ground import Grounds, black
from .method.surface import AnySurface
from .problem import Problem, seen_at_once

_NO_SUN = How(single_scattering=False, error_budget=None, most=None)


class Emerging(NamedTuple):
    """What leaves the top of each column towards each view.

    `brf` is the answer to the sun alone; `emitted` the radiance from everything else, None where
    nothing else shines.
    """

    brf: Float[Array, "view *batch"]
    emitted: Float[Array, "view *batch"] | None


class GroundResponse(NamedTuple):
    """How columns over black ground see a Lambertian one; see `SurfaceCoupling`."""

    brf_black: Float[Array, "view *batch"]
    coupling: Float[Array, "view *batch"]
    spherical_albedo: Float[Array, "*batch"]


def emerging(column: Column, options: Options) -> Emerging:
    """Solve columns whose batch is last (see `column.aligned`)."""
    problem = Problem(column, options)
    shine = (column.planck_levels, column.surface_emission, column.isotropic_top)
    if all(x is None for x in shine):
        at_once = seen_at_once(problem)
        return Emerging(at_once + 0.5 * problem.reflection(at_once), None)
    mean, others, absorbed = grounds_of(column.albedo, problem.directions, options)
    zero = jnp.zeros_like(column.mu0)
    planck, from_ground, from_above = (zero if x is None else x for x in shine)
    jumps = None if column.planck_levels is None else planck[1:] - planck[:-1]
    at_top, at_ground = (zero, zero) if jumps is None else (planck[0], planck[-1])
    emission = emitting_ground(mean, problem.one, from_ground, at_ground, absorbed)
    top, emission = problem.emitting_mean(mean, emission, jumps)
    emitted = top.emerging(emission, problem.one, from_above, at_top)[1:]
    brf = seen_at_once(problem) + 0.5 * (top.reflection() + problem.higher(others))
    return Emerging(brf, emitted)


def ground_response(column: Column, options: Options) -> GroundResponse:
    r"""Solve columns over black ground, and what an isotropic ground would add.

    The transmission T of isotropic ground light 1 towards each beam is, for the sun's beam and by
    reciprocity, that of sunlight to the ground. Light reflected k times by the ground adds
    :math:`T(\mu_0)T(\mu) a (Sa)^{k-1}`.
    """
    problem = Problem(column, options)
    ground = black(problem.directions.cosines, options.num_streams)
    zero = jnp.zeros_like(column.mu0)
    emission = emitting_ground(ground, problem.one, zero + 1, zero, zero + 1)
    top, emission = problem.emitting_mean(ground, emission, None)
    transmission = top.emerging(emission, problem.one, zero, zero)
    return GroundResponse(
        seen_at_once(problem) + 0.5 * (top.reflection() + problem.higher(None)),
        transmission[0] * transmission[1:],
        top.spherical_albedo(emission),
    )


def plane_albedo(column: Column, options: Options) -> Float[Array, "*batch"]:
    """Share of the sun's light that leaves the top in all directions."""
    problem = Problem(column, options)
    grounds = grounds_of(column.albedo, problem.directions, options)
    nothing = jnp.zeros_like(problem.layers.tau), 0.0 * problem.one
    heating = Heating(*nothing, jnp.full_like(column.mu0, 2))
    lit = seen_from(0, *problem.shared(), grounds, heating)
    return radiance(lit, Given(problem.doublings), _NO_SUN)


def radiance_of_one_view(column: Column, options: Options) -> Float[Array, "*batch"]:
    """Sunlight and thermal light together, with a derivative that is written out."""
    problem = Problem(column, options)
    assert column.solar_irradiance is not None
    sun = column.solar_irradiance * column.mu0 / np.pi
    levels = column.planck_levels
    at_top = jnp.zeros_like(column.mu0) if levels is None else levels[0]
    at_once = seen_at_once(problem)
    shining = Shining(column, problem.layers, problem.directions, sun, Given(problem.doublings))
    # Of grounds other than Lambertian nobody knows how they send thermal light to the view.
    unknown = levels is None or isinstance(column.albedo, AnySurface)
    if options.error_budget is None or unknown:
        return at_top + sun * at_once[0] + radiated(shining, options)
    warm = warm_of(column, problem.layers, problem.directions, at_once)
    shining = shining._replace(given=shining.given._replace(warm=warm))
    return at_top + sun * at_once[0] + radiated(shining, options)


def over_black_ground(column: Column, options: Options) -> Float[Array, "view *batch"]:
    """`GroundResponse.brf_black` alone."""
    problem = Problem(column._replace(albedo=jnp.zeros_like(column.mu0)), options)
    at_once = seen_at_once(problem)
    return at_once + 0.5 * problem.reflection(at_once)


def from_ground(column: Column, options: Options, beam: Any) -> Float[Array, "*batch"]:
    """Share of isotropic light 1 of a black ground that leaves towards a beam, the sun being 0."""
    problem = Problem(column, options)
    ground = black(problem.directions.cosines, options.num_streams)
    zero = jnp.zeros_like(column.mu0)
    emission = emitting_ground(ground, problem.one, zero + 1, zero).column
    heating = Heating(jnp.zeros_like(problem.layers.tau), emission, zero)
    lit = seen_from(beam, *problem.shared(), Grounds(ground, absorbed=zero + 1), heating)
    return radiance(lit, Given(problem.doublings), _NO_SUN)


def back_to_ground(column: Column, options: Options) -> Float[Array, "*batch"]:
    """`GroundResponse.spherical_albedo` alone: of the layers in reverse order, from above."""
    problem = Problem(column, options)
    shared = problem.layers, problem.directions, problem.doublings
    return spherical_albedo(*upside_down(*shared))
