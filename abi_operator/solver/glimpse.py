"""Light of a tile of columns as if they scattered hardly anything, and whether that will do.

One kernel reads the layers as they are given (`skipping.one_pass`) and ends with what is known of
the light (`skipping.faint`, `skipping.faint_heat`), so that nothing else is done for columns that
need no solution: `door` asks for this before it solves anything.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..machine.kernels import one_kernel
from .column import Column, Options, phase_functions
from .method.rounding import in_single_precision
from .method.surface import AnySurface
from .skipping import budget
from .skipping.budget import expected
from .skipping.faint import of_sunlight
from .skipping.faint_heat import of_heat
from .skipping.one_pass import Air, known


class Glimpse(NamedTuple):
    """Reflectance or radiance of columns that are not solved.

    Parameters
    ----------
    light
        All of it.
    missing
        How much of that may be wrong, for the view of which most is.
    least
        A careful estimate of it, for the view that sees least.
    """

    light: Float[Array, "view *batch"]
    missing: Float[Array, "*batch"]
    least: Float[Array, "*batch"]

    def enough(self, error_budget: float) -> Bool[Array, "*batch"]:
        """Whether no more is missing than the budget allows, and the light is a number."""
        known = jnp.all(jnp.isfinite(self.light), axis=0)
        return known & (self.missing <= budget.OF_FAINT * error_budget * self.least)


def can_be_seen(column: Column, options: Options) -> bool:
    """Whether anything is known of such columns: not of grounds other than Lambertian, which send
    light to the modes, nor of what falls on the top, or where single scattering is not exact.

    Parameters
    ----------
    column
        Of which only what is None is read, and the kind of the ground.
    options
        How it is to be solved.
    """
    ordinary = not isinstance(column.albedo, AnySurface) and column.isotropic_top is None
    emitting = column.surface_emission is None or column.planck_levels is not None
    return ordinary and emitting and options.tms and options.error_budget is not None


def reflectance(column: Column, options: Options) -> Glimpse:
    """Of columns in sunlight, towards every view. [-]"""
    return _glimpse(column._replace(planck_levels=None), options)


def radiance(column: Column, options: Options) -> Glimpse:
    """Of columns that emit, towards their only view; or of any in sunlight. [radiance unit]"""
    assert column.solar_irradiance is not None
    if column.planck_levels is not None:
        return _glimpse(column, options)
    light, missing, least = _glimpse(column, options)
    sun = column.solar_irradiance * column.mu0 / np.pi
    return Glimpse(sun * light, sun * missing, sun * least)


def _glimpse(column: Column, options: Options) -> Glimpse:
    moments = column.moments[:, : options.num_streams + 1]
    phase = phase_functions(column)
    air = Air(column.tau, column.ssa, moments, phase, column.secant, column.planck_levels)
    of_heat = (column.solar_irradiance, column.surface_emission)

    def of_these(air, albedo, mu0, mu, solar_irradiance, surface_emission):
        emitted = jnp.zeros_like(mu0) if surface_emission is None else surface_emission
        how = options.num_streams, options.delta_m
        return _in_one_kernel(air, albedo, mu0, mu, solar_irradiance, emitted, *how)

    given = air, column.albedo, column.mu0, column.mu, *of_heat
    if budget.rounds(options.error_budget):
        given = in_single_precision(given)
    found = one_kernel(of_these, 1, num_beams=len(column.mu))(*given)
    return jax.tree.map(lambda x: x.astype(column.tau.dtype), found)


def _in_one_kernel(
    air, albedo, mu0, mu, solar_irradiance, emitted, num_streams, delta_m
) -> Glimpse:
    sums, scattered, once, passing = known(air, mu0, mu, emitted, num_streams, delta_m)
    seen = albedo * jnp.exp(-sums.slant - sums.tau / mu)
    expectation = expected(once, seen, sums, jnp.concatenate([mu0[None], mu]))
    sunlight = of_sunlight(sums, scattered, albedo, mu0, mu)
    light = once + 0.5 * sunlight.light
    if passing is None:
        return Glimpse(light, sunlight.missing, expectation.least)
    sun, secant = solar_irradiance * mu0 / np.pi, 1 / mu[0]
    heat = of_heat(sums, albedo, secant, passing, emitted)
    thermal = passing.up + jnp.exp(-secant * sums.tau) * emitted
    return Glimpse(
        (heat.light + sun * light[0])[None],
        heat.missing + sun * sunlight.missing,
        sun * expectation.least + thermal,
    )
