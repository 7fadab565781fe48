"""What all modes of a tile of columns share, and what is added to them exactly."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .column import Column, Options
from .foreknown import depths_of, expected_of
from .gradient.mode_sum import ModeSum, mode_sum
from .gradient.modes import How
from .method.adding import Emission, Top
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
from .method.ground import isotropic, lambertian, reflecting
from .method.legendre import legendre_series
from .method.rounding import within_single_precision
from .method.single_scatter import (
    cos_scattering_angle,
    direct_transmission,
    exact_single_scattering,
)
from .method.surface import AnySurface
from .skipping.plan import LayersOfModes


class Problem:
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
        if self.layers.tau.dtype == jnp.float32:
            factor = within_single_precision(self.layers.tau, self.layers.coalbedo)
            self.layers = self.layers._replace(tau=self.layers.tau * factor)
        self.doublings = layer_doublings(
            self.layers.tau, secants, num_streams, options.num_doublings
        )
        self.one: Vector = isotropic(num_streams, self.directions.cosines)
        self.tables = legendre_tables(num_streams, options.num_modes, self.directions.cosines)

    def mean(self, ground: Bordered) -> Top:
        return azimuthal_mean(*self.shared(), ground, **self.how())

    def emitting_mean(
        self,
        ground: Bordered,
        emission: Emission,
        planck_jumps: Float[Array, "layer *batch"] | None,
    ) -> tuple[Top, Emission]:
        shared = self.shared()
        return emitting_mean(*shared, ground, emission, self.one, planck_jumps, **self.how())

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
        how = How(not options.tms, options.error_budget, options.num_doublings, options.delta_m)
        if options.error_budget is None:
            return mode_sum(inputs, self.doublings, how)
        sums = depths_of(layers, self.directions)
        known = expected_of(self.column, sums, self.directions, rest, options)
        return mode_sum(inputs, known, how)

    def higher(self, grounds: Bordered | None) -> Float[Array, "view *batch"]:
        azimuth = self.column.relative_azimuth
        return higher_modes(*self.shared(), grounds, azimuth, **self.how())

    def shared(self) -> tuple[ScaledLayers, LegendreTables, Directions]:
        return self.layers, self.tables, self.directions

    def how(self) -> dict[str, Any]:
        return {"doublings": self.doublings, "single_scattering": not self.options.tms}


def grounds_of(albedo: Array | AnySurface, problem: Problem) -> tuple[Bordered, Bordered | None]:
    """Ground in mode 0, and in the others (None where they do not see it)."""
    cosines, num_streams = problem.directions.cosines, problem.options.num_streams
    if not isinstance(albedo, AnySurface):
        return lambertian(albedo, cosines, num_streams), None

    # All modes at once: a reflectance is evaluated at its azimuths only once.
    grounds = jax.vmap(lambda m: reflecting(albedo, m, cosines, num_streams))(
        jnp.arange(problem.options.num_modes)
    )
    return jax.tree.map(lambda x: x[0], grounds), jax.tree.map(lambda x: x[1:], grounds)


def seen_at_once(problem: Problem) -> Float[Array, "view *batch"]:
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
    return brf + exact_single_scattering(layers.tau, ratio, exact, mu0, mu, sun)
