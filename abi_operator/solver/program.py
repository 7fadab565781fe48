"""From a tile of columns to what leaves its top: the solver's parts put together."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..machine.algebra import fenced
from .column import Column, Options
from .gradient.emission import radiance
from .gradient.emitting_mode import Heating
from .gradient.fluxes import spherical_albedo
from .gradient.mode_sum import How, ModeSum, mode_sum
from .lit import seen_from, seen_from_the_view, upside_down, weights_of_modes
from .method.adding import Emission, Top, emitting_ground
from .method.azimuth import (
    Directions,
    LegendreTables,
    azimuthal_mean,
    emitting_mean,
    higher_modes,
    legendre_tables,
    weighted_moments,
)
from .method.bordered import Bordered, Vector
from .method.delta_m import ScaledLayers, unscaled
from .method.delta_m import delta_m as scale_delta_m
from .method.doublings import layer_doublings, within_reach
from .method.ground import black, isotropic, lambertian, reflecting
from .method.legendre import legendre_series
from .method.single_scatter import (
    cos_scattering_angle,
    direct_transmission,
    exact_single_scattering,
)
from .method.surface import AnySurface
from .skipping import company
from .skipping.budget import Expected, expected
from .skipping.plan import LayersOfModes

_SOME_ALBEDO = 0.1  # of a ground that is none, where a rough one will do


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
    problem = _Problem(column, options)
    mean, others = _grounds(column.albedo, problem)
    shine = (column.planck_levels, column.surface_emission, column.isotropic_top)
    if all(x is None for x in shine):
        at_once = _seen_at_once(problem)
        return Emerging(at_once + 0.5 * problem.reflection(mean, others, at_once), None)
    zero = jnp.zeros_like(column.mu0)
    planck, from_ground, from_above = (zero if x is None else x for x in shine)
    jumps = None if column.planck_levels is None else planck[1:] - planck[:-1]
    at_top, at_ground = (zero, zero) if jumps is None else (planck[0], planck[-1])
    emission = emitting_ground(mean, problem.one, from_ground, at_ground)
    top, emission = problem.emitting_mean(mean, emission, jumps)
    emitted = top.emerging(emission, problem.one, from_above, at_top)[1:]
    brf = _seen_at_once(problem) + 0.5 * (top.reflection() + problem.higher(others))
    return Emerging(brf, emitted)


def need(column: Column, options: Options) -> Float[Array, "*batch"]:
    """How much of columns will be solved, for those that need alike to be solved together."""
    assert options.error_budget is not None
    moments = column.moments[:, 1]
    tau, ssa = column.tau, column.ssa
    if options.delta_m:
        scaled = scale_delta_m(tau, ssa, column.moments, options.num_streams)
        tau, ssa, moments = scaled.tau, scaled.ssa, scaled.moments[:, 1]
    albedo = column.albedo
    if isinstance(albedo, AnySurface):
        albedo = jnp.full_like(column.mu0, _SOME_ALBEDO)
    mu = jnp.min(column.mu, axis=0)
    return company.need(tau, ssa, ssa * moments, albedo, column.mu0, mu, options.error_budget)


def ground_response(column: Column, options: Options) -> GroundResponse:
    r"""Solve columns over black ground, and what an isotropic ground would add.

    The transmission T of isotropic ground light 1 towards each beam is, for the sun's beam and by
    reciprocity, that of sunlight to the ground. Light reflected k times by the ground adds
    :math:`T(\mu_0)T(\mu) a (Sa)^{k-1}`.
    """
    problem = _Problem(column, options)
    ground = black(problem.directions.cosines, options.num_streams)
    zero = jnp.zeros_like(column.mu0)
    emission = emitting_ground(ground, problem.one, zero + 1, zero)
    top, emission = problem.emitting_mean(ground, emission, None)
    transmission = top.emerging(emission, problem.one, zero, zero)
    return GroundResponse(
        _seen_at_once(problem) + 0.5 * (top.reflection() + problem.higher(None)),
        transmission[0] * transmission[1:],
        top.spherical_albedo(emission),
    )


def plane_albedo(column: Column, options: Options) -> Float[Array, "*batch"]:
    """Share of the sun's light that leaves the top in all directions."""
    problem = _Problem(column, options)
    mean, _ = _grounds(column.albedo, problem)
    nothing = jnp.zeros_like(problem.layers.tau), 0.0 * problem.one
    heating = Heating(*nothing, jnp.full_like(column.mu0, 2))
    lit = seen_from(0, *problem._shared(), mean, heating)
    return radiance(lit, problem.doublings, False)


def radiance_of_one_view(column: Column, options: Options) -> Float[Array, "*batch"]:
    """Sunlight and thermal light together, with a derivative that is written out."""
    problem = _Problem(column, options)
    mean, others = _grounds(column.albedo, problem)
    zero = jnp.zeros_like(column.mu0)
    shine = column.planck_levels, column.surface_emission, column.isotropic_top
    planck, from_ground, from_above = (zero if x is None else x for x in shine)
    cold = column.planck_levels is None
    at_top, at_ground = (zero, zero) if cold else (planck[0], planck[-1])
    heating = Heating(
        jumps=jnp.zeros_like(column.tau) if cold else planck[1:] - planck[:-1],
        ground=emitting_ground(mean, problem.one, from_ground, at_ground).column,
        above=2 * (from_above - at_top),
    )
    assert column.solar_irradiance is not None
    sun = column.solar_irradiance * column.mu0 / np.pi
    weights = 0.5 * sun * weights_of_modes(options.num_modes, column.relative_azimuth)
    lit = seen_from_the_view(*problem._shared(), mean, others, weights, heating)
    of_modes = radiance(lit, problem.doublings, not options.tms)
    return at_top + sun * _seen_at_once(problem)[0] + of_modes


def over_black_ground(column: Column, options: Options) -> Float[Array, "view *batch"]:
    """`GroundResponse.brf_black` alone."""
    problem = _Problem(column, options)
    ground = black(problem.directions.cosines, options.num_streams)
    at_once = _seen_at_once(problem)
    return at_once + 0.5 * problem.reflection(ground, None, at_once)


def from_ground(column: Column, options: Options, beam: Any) -> Float[Array, "*batch"]:
    """Share of isotropic light 1 of a black ground that leaves towards a beam, the sun being 0."""
    problem = _Problem(column, options)
    ground = black(problem.directions.cosines, options.num_streams)
    zero = jnp.zeros_like(column.mu0)
    emission = emitting_ground(ground, problem.one, zero + 1, zero).column
    heating = Heating(jnp.zeros_like(problem.layers.tau), emission, zero)
    lit = seen_from(beam, *problem._shared(), ground, heating)
    return radiance(lit, problem.doublings, False)


def back_to_ground(column: Column, options: Options) -> Float[Array, "*batch"]:
    """`GroundResponse.spherical_albedo` alone: of the layers in reverse order, from above."""
    problem = _Problem(column, options)
    shared = problem.layers, problem.directions, problem.doublings
    return spherical_albedo(*upside_down(*shared))


class _Problem:
    """What all modes share."""

    def __init__(self, column: Column, options: Options):
        num_streams = options.num_streams
        moments = column.moments  # the zeroth is 1 and not read
        moments = jnp.concatenate([jnp.ones_like(moments[:, :1]), moments[:, 1:]], axis=1)
        scale = scale_delta_m if options.delta_m else unscaled
        self.column, self.options, self.moments = column, options, moments
        self.layers: ScaledLayers = scale(column.tau, column.ssa, moments, num_streams)
        secant = 1 / column.mu0 if column.secant is None else column.secant
        self.directions = Directions(
            jnp.concatenate([column.mu0[None], column.mu]),
            jnp.broadcast_to(secant, column.tau.shape),
        )
        views = jnp.broadcast_to(
            1 / self.directions.cosines[1:, None], (column.mu.shape[0], *column.tau.shape)
        )
        secants = jnp.concatenate([self.directions.sun_secants[None], views])
        if options.unread:
            assert options.num_doublings is not None
            limits = secants, num_streams, options.num_doublings
            tau = self.layers.tau * within_reach(self.layers.tau, *limits)
            self.layers = self.layers._replace(tau=tau)
        self.doublings = layer_doublings(
            self.layers.tau, secants, num_streams, options.num_doublings
        )
        self.one: Vector = isotropic(num_streams, self.directions.cosines)
        self.tables = legendre_tables(num_streams, options.num_modes, self.directions.cosines)

    def mean(self, ground: Bordered) -> Top:
        return azimuthal_mean(*self._shared(), ground, **self._how())

    def emitting_mean(
        self,
        ground: Bordered,
        emission: Emission,
        planck_jumps: Float[Array, "layer *batch"] | None,
    ) -> tuple[Top, Emission]:
        shared = self._shared()
        return emitting_mean(*shared, ground, emission, self.one, planck_jumps, **self._how())

    def reflection(
        self, mean: Bordered, others: Bordered | None, rest: Float[Array, "view *batch"]
    ) -> Float[Array, "view *batch"]:
        """Twice the sum over all modes, whose derivative is written out.

        `rest` is the light that is added to it.
        """
        options, layers, azimuth = self.options, self.layers, self.column.relative_azimuth
        order = jnp.arange(options.num_modes)
        order = order.reshape(-1, *(1,) * azimuth.ndim)
        sign = jnp.where(order == 0, 1, jnp.where(order % 2 == 0, 2, -2)).astype(azimuth.dtype)
        even, odd = weighted_moments(layers)
        inputs = ModeSum(
            layers=LayersOfModes(
                layers.tau, layers.coalbedo, self.directions.sun_secants, (even, odd)
            ),
            view_secants=1 / self.directions.cosines[1:],
            beams=self.tables.beams,
            ground=mean,
            grounds=others,
            weights=sign * jnp.cos(order.astype(azimuth.dtype) * azimuth),
        )
        how = How(not options.tms, options.error_budget, options.num_doublings)
        given = self.doublings if options.error_budget is None else self._expected(rest)
        return mode_sum(inputs, given, how)

    def _expected(self, rest: Float[Array, "view *batch"]) -> Expected:
        column, layers = self.column, self.layers
        ground = jnp.zeros_like(rest)
        if not isinstance(column.albedo, AnySurface):  # of which `rest` has the light sent back
            sun = self.directions.sun_secants
            ground = column.albedo * direct_transmission(layers.tau, column.mu, sun)
        backward = layers.ssa * (1 - layers.moments[:, 1])
        return expected(rest, ground, layers.tau, layers.coalbedo, backward)

    def higher(self, grounds: Bordered | None) -> Float[Array, "view *batch"]:
        azimuth = self.column.relative_azimuth
        return higher_modes(*self._shared(), grounds, azimuth, **self._how())

    def _shared(self) -> tuple[ScaledLayers, LegendreTables, Directions]:
        return self.layers, self.tables, self.directions

    def _how(self) -> dict[str, Any]:
        return {"doublings": self.doublings, "single_scattering": not self.options.tms}


def _grounds(albedo: Array | AnySurface, problem: _Problem) -> tuple[Bordered, Bordered | None]:
    """Ground in mode 0, and in the others (None where they do not see it)."""
    cosines, num_streams = problem.directions.cosines, problem.options.num_streams
    if not isinstance(albedo, AnySurface):
        return lambertian(albedo, cosines, num_streams), None

    # All modes at once: a reflectance is evaluated at its azimuths only once.
    grounds = jax.vmap(lambda m: reflecting(albedo, m, cosines, num_streams))(
        jnp.arange(problem.options.num_modes)
    )
    return jax.tree.map(lambda x: x[0], grounds), jax.tree.map(lambda x: x[1:], grounds)


def _seen_at_once(problem: _Problem) -> Float[Array, "view *batch"]:
    """What is scattered or reflected once and added exactly."""
    column, options, layers = problem.column, problem.options, problem.layers
    mu0, mu, sun = column.mu0, column.mu, problem.directions.sun_secants
    brf = jnp.zeros_like(mu * mu0)
    if isinstance(column.albedo, AnySurface):
        reflected = column.albedo.brdf(mu, mu0[None], column.relative_azimuth)
        brf = brf + reflected * direct_transmission(layers.tau, mu, sun)
    if not options.tms:
        return brf
    exact = column.phase_function
    if exact is None:
        angle = cos_scattering_angle(mu0, mu, column.relative_azimuth)
        exact = legendre_series(problem.moments, angle)
    ratio = layers.scattering_ratio
    return brf + _scattered_once(layers.tau, ratio, exact, mu0, mu, sun)


# Else it would be computed column by column, where the result is turned to have the batch first.
_scattered_once = fenced(exact_single_scattering)
