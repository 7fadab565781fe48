"""What is known of a tile of columns before it is solved, where an error budget may be spent."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .column import Column, Options
from .method.azimuth import Directions
from .method.delta_m import ScaledLayers
from .method.delta_m import delta_m as scale_delta_m
from .method.surface import AnySurface
from .skipping import company
from .skipping.budget import Expected, expected
from .skipping.depths import Depths, depths
from .skipping.grouping import Alike
from .skipping.heat import Unscattered, Warm, unscattered

_FEW_STREAMS = 2  # where nobody looks downwards
_SOME_ALBEDO = 0.1  # of a ground that is none, where a rough one will do


def need(column: Column, options: Options, slopes: bool) -> Float[Array, "*batch"]:
    """How much of columns will be solved for values, or for slopes as well, for those that need
    alike to be solved together."""
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
    sums = depths(tau, 1 - ssa, ssa, ssa * (1 - moments[:, 1]), sun)
    ground = albedo * jnp.exp(-sums.slant - sums.tau / mu)
    nothing, cosines = jnp.zeros_like(mu)[None], jnp.stack([column.mu0, mu])
    known = expected(nothing, ground, sums, cosines)
    further = ssa * moments[:, degree] if degree > 1 else None
    alike = Alike(tau, ssa, ssa * moments[:, 1], further)
    if degree > 2:
        alike = alike._replace(second=ssa * moments[:, 2])
    if column.planck_levels is not None:
        up = _air(column, tau, 1 - ssa, _FEW_STREAMS).up
        warm = _warm(column, known, albedo, jnp.exp(-sums.tau / mu), up)
        known, alike = warm.known, alike._replace(planck=column.planck_levels, light=warm.light)
    return company.need(alike, known, column.mu0, mu, options.error_budget, slopes)


def depths_of(layers: ScaledLayers, directions: Directions) -> Depths:
    """What the layers add up to."""
    backward = layers.ssa * (1 - layers.moments[:, 1])
    return depths(layers.tau, layers.coalbedo, layers.ssa, backward, directions.sun_secants)


def expected_of(
    column: Column,
    layers: ScaledLayers,
    directions: Directions,
    rest: Float[Array, "view *batch"],
) -> Expected:
    """Of the reflectance, to which `rest` is added exactly.

    A ground that is not Lambertian has sent its light to `rest` and to the modes.
    """
    return _expected_of(column, depths_of(layers, directions), directions, rest)


def expected_between(
    column: Column,
    layers: ScaledLayers,
    directions: Directions,
    rest: Float[Array, "view *batch"],
    around: Depths,
    peaked: Float[Array, "*batch"],
) -> Expected:
    """The same of layers between others that add up to `around`, with the peaks of those."""
    own = depths_of(layers, directions)
    whole = Depths(*(x + y for x, y in zip(own, around, strict=True)))
    return _expected_of(column, whole, directions, rest)._replace(peaked=peaked)


def _expected_of(
    column: Column, sums: Depths, directions: Directions, rest: Float[Array, "view *batch"]
) -> Expected:
    if isinstance(column.albedo, AnySurface):
        return expected(rest, None, sums, directions.cosines)
    ground = column.albedo * jnp.exp(-sums.slant - sums.tau / column.mu)
    return expected(rest, ground, sums, directions.cosines)


def warm_of(
    column: Column,
    layers: ScaledLayers,
    directions: Directions,
    rest: Float[Array, "view *batch"],
) -> Warm:
    """Of the radiance of columns that emit, over Lambertian ground."""
    assert not isinstance(column.albedo, AnySurface)
    sums = depths_of(layers, directions)
    known = _expected_of(column, sums, directions, rest)
    seen = jnp.exp(-sums.tau / column.mu[0])
    up = _air(column, layers.tau, layers.coalbedo, _FEW_STREAMS).up
    return _warm(column, known, column.albedo, seen, up)


def _air(column: Column, tau: Array, coalbedo: Array, num_streams: int) -> Unscattered:
    """Thermal light of the air towards the view and the ground."""
    levels = column.planck_levels
    assert levels is not None
    layers = jax.lax.stop_gradient((tau, coalbedo, levels[:-1], levels[1:] - levels[:-1]))
    return unscattered(*layers, 1 / jnp.min(column.mu, axis=0), num_streams)


def _sunlight(column: Column) -> Float[Array, "*batch"]:
    """Radiance of a reflectance of 1."""
    assert column.solar_irradiance is not None
    return column.solar_irradiance * column.mu0 / np.pi


def _warm(
    column: Column,
    known: Expected,
    albedo: Float[Array, "*batch"],
    seen: Float[Array, "*batch"],
    thermal: Float[Array, "*batch"],
) -> Warm:
    """What is known of columns that emit, from what is of their reflectance, from the share of the
    ground's light that is `seen` by the view, and from the air's light towards it."""
    assert column.planck_levels is not None
    sun, levels = _sunlight(column), column.planck_levels
    ground = 0 if column.surface_emission is None else column.surface_emission
    top = 0 if column.isotropic_top is None else column.isotropic_top
    thermal = thermal + seen * ground
    # As `planned` has it of reflectances.
    flat = 1 if column.secant is None else column.mu0 * column.secant[0]
    light = sun / flat + jnp.abs(ground - (1 - albedo) * levels[-1]) + jnp.abs(top - levels[0])
    of_light = Expected(
        added=sun * known.added + levels[0],
        least=sun * known.least + thermal,
        dark=sun * known.dark,
        aside=sun * known.aside,
        through=sun * known.through,
        mu0=known.mu0,
    )
    return jax.lax.stop_gradient(Warm(of_light, light, levels, albedo * seen))
