"""What all modes of a tile of columns share, and what is added to them exactly."""

from functools import cached_property
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

from .all_modes import Sunlit, twice_reflected
from .column import Column, Options, phase_functions, whole_moments
from .foreknown import expected_of
from .method.adding import Emission, Top
from .method.azimuth import (
    Directions,
    LegendreTables,
    emitting_mean,
    higher_modes,
    legendre_tables,
)
from .method.bordered import Bordered, Vector
from .method.delta_m import ScaledLayers, unscaled
from .method.delta_m import delta_m as scale_delta_m
from .method.doublings import layer_doublings, within_reach
from .method.ground import isotropic
from .method.rounding import DEEPEST, within_single_precision
from .method.single_scatter import direct_transmission, exact_single_scattering
from .method.surface import AnySurface


class Problem:
    """What all modes share; `deepest` is how deep single precision goes (`method.rounding`)."""

    def __init__(self, column: Column, options: Options, deepest: float = DEEPEST):
        num_streams = options.num_streams
        scale = scale_delta_m if options.delta_m else unscaled
        self.column, self.options = column, options
        moments = whole_moments(column)
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
            factor = within_single_precision(self.layers.tau, self.layers.coalbedo, deepest)
            self.layers = self.layers._replace(tau=self.layers.tau * factor)
        self.doublings = layer_doublings(
            self.layers.tau, secants, num_streams, options.num_doublings
        )

    @cached_property
    def one(self) -> Vector:
        """Isotropic light 1."""
        return isotropic(self.options.num_streams, self.directions.cosines)

    @cached_property
    def tables(self) -> LegendreTables:
        """Of all modes."""
        how = self.options.num_streams, self.options.num_modes
        return legendre_tables(*how, self.directions.cosines)

    def emitting_mean(
        self,
        ground: Bordered,
        emission: Emission,
        planck_jumps: Float[Array, "layer *batch"] | None,
    ) -> tuple[Top, Emission]:
        """Mode 0 of all layers over a ground, with what both emit (`azimuth.emitting_mean`)."""
        shared = self.shared()
        return emitting_mean(*shared, ground, emission, self.one, planck_jumps, **self.how())

    def reflection(self, rest: Float[Array, "view *batch"]) -> Float[Array, "view *batch"]:
        """Twice the sum over all modes, whose derivative is written out.

        `rest` is the light that is added to it.
        """
        column, options = self.column, self.options
        sunlit = Sunlit(self.layers, self.directions, column.albedo, column.relative_azimuth)
        if options.error_budget is None:
            return twice_reflected((sunlit, self.doublings), options)
        known = expected_of(column, self.layers, self.directions, rest)
        return twice_reflected((sunlit, known), options)

    def higher(self, grounds: Bordered | None) -> Float[Array, "view *batch"]:
        """Sum over the modes above 0, by `azimuth.higher_modes`."""
        azimuth = self.column.relative_azimuth
        return higher_modes(*self.shared(), grounds, azimuth, **self.how())

    def shared(self) -> tuple[ScaledLayers, LegendreTables, Directions]:
        """First arguments of the functions of `azimuth`."""
        return self.layers, self.tables, self.directions

    def how(self) -> dict[str, Any]:
        """Their last ones, by name."""
        return {"doublings": self.doublings, "single_scattering": not self.options.tms}


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
    exact, ratio = phase_functions(column), layers.scattering_ratio
    return brf + exact_single_scattering(layers.tau, ratio, exact, mu0, mu, sun)
