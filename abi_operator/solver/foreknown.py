"""What is known of a tile of columns before it is solved, where an error budget may be spent."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .column import Column, Options
from .method.azimuth import Directions
from .method.delta_m import ScaledLayers
from .method.delta_m import delta_m as scale_delta_m
from .method.single_scatter import direct_transmission
from .method.surface import AnySurface
from .skipping import company
from .skipping.budget import Expected, expected
from .skipping.grouping import Alike
from .skipping.heat import Warm, unscattered

_FEW_STREAMS = 2  # where nobody looks downwards
_SOME_ALBEDO = 0.1  # of a ground that is none, where a rough one will do


def need(column: Column, options: Options) -> Float[Array, "*batch"]:
    """How much of columns will be solved, for those that need alike to be solved together."""
    assert options.error_budget is not None
    moments, degree = column.moments, options.num_streams // 2
    tau, ssa = column.tau, column.ssa
    if options.delta_m:
        scaled = scale_delta_m(tau, ssa, column.moments, options.num_streams)
        tau, ssa, moments = scaled.tau, scaled.ssa, scaled.moments
    albedo = column.albedo
    if isinstance(albedo, AnySurface):
        albedo = jnp.full_like(column.mu0, _SOME_ALBEDO)
    mu = jnp.min(column.mu, axis=0)
    sun = jnp.broadcast_to(1 / column.mu0, tau.shape)
    ground = albedo * direct_transmission(tau, mu[None], sun)
    nothing, cosines = jnp.zeros_like(mu)[None], jnp.stack([column.mu0, mu])
    known = expected(nothing, ground, tau, 1 - ssa, ssa * (1 - moments[:, 1]), cosines)
    further = ssa * moments[:, degree] if degree > 1 else None
    alike = Alike(tau, ssa, ssa * moments[:, 1], further)
    if column.planck_levels is not None:
        warm = _warm(column, known, tau, 1 - ssa, albedo)
        known, alike = warm.known, alike._replace(planck=column.planck_levels, light=warm.light)
    return company.need(alike, known, column.mu0, mu, options.error_budget)


def expected_of(
    column: Column, layers: ScaledLayers, directions: Directions, rest: Float[Array, "view *batch"]
) -> Expected:
    """Of the reflectance, to which `rest` is added exactly."""
    ground = None
    if not isinstance(column.albedo, AnySurface):  # `rest` has light sent back by others
        sun = directions.sun_secants
        ground = column.albedo * direct_transmission(layers.tau, column.mu, sun)
    backward = layers.ssa * (1 - layers.moments[:, 1])
    return expected(rest, ground, layers.tau, layers.coalbedo, backward, directions.cosines)


def warm_of(
    column: Column, layers: ScaledLayers, directions: Directions, rest: Float[Array, "view *batch"]
) -> Warm:
    """Of the radiance of columns that emit, over Lambertian ground."""
    assert not isinstance(column.albedo, AnySurface)
    known = expected_of(column, layers, directions, rest)
    return _warm(column, known, layers.tau, layers.coalbedo, column.albedo)


def _warm(
    column: Column,
    known: Expected,
    tau: Float[Array, "layer *batch"],
    coalbedo: Float[Array, "layer *batch"],
    albedo: Float[Array, "*batch"],
) -> Warm:
    """What is known of columns that emit, from what is of their reflectance."""
    assert column.planck_levels is not None and column.solar_irradiance is not None
    sun = column.solar_irradiance * column.mu0 / np.pi
    levels, secant = column.planck_levels, 1 / jnp.min(column.mu, axis=0)
    seen = jnp.exp(-secant * jnp.sum(tau, axis=0))
    jumps = levels[1:] - levels[:-1]
    thermal = unscattered(tau, coalbedo, levels[:-1], jumps, secant, _FEW_STREAMS).up
    if column.surface_emission is not None:
        thermal = thermal + seen * column.surface_emission
    light = sun
    if column.surface_emission is not None:
        light = light + jnp.abs(column.surface_emission - (1 - albedo) * levels[-1])
    if column.isotropic_top is not None:
        light = light + column.isotropic_top
    of_light = Expected(
        added=sun * known.added + levels[0],
        least=sun * known.least + thermal,
        dark=sun * known.dark,
        aside=sun * known.aside,
        through=known.through,
    )
    return jax.lax.stop_gradient(Warm(of_light, light, levels, albedo * seen))
