"""From one state to the columns that the solver is given: one for each exponential term of a band.

Functions are written for one state; `optics_and_solver` batches them.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .atmosphere import State
from .bands import BANDS
from .optics import column_optics
from .planck import in_band_radiance
from .solver import cos_scattering_angle
from .surface import Lambertian, surface_emission

HARMLESS_ZENITH = 1.0
"""Where a sun or a satellite at or below the horizon stands while columns are solved; what comes of
it is not used. [rad]"""


class BandColumns(NamedTuple):
    """Solver's columns of one state in one band.

    Parameters
    ----------
    arguments
        Those of `solver.toa_brf` or `solver.toa_radiance` by name, with an axis of columns first.
    weight
        Weight of each column. [-]
    """

    arguments: dict[str, Any]
    weight: Float[Array, " column"]


def band_columns(
    state: State,
    band: str,
    gases: tuple[str, ...],
    num_moments: int,
    *,
    solar_irradiance: Float[Array, ""] | None = None,
    emitting_as: str | None = None,
) -> BandColumns:
    """Columns of one state in one band.

    Parameters
    ----------
    state
        What the column holds; the sun and the satellite may be anywhere, see `above_horizon`.
    band, gases
        Which band, and which gases absorb.
    num_moments
        Legendre moments that the solver reads.
    solar_irradiance
        Of a band that emits. [W m-2 um-1]
    emitting_as
        Satellite in whose response a band emits; None for sunlight alone.
    """
    geometry = state.geometry
    mu0 = jnp.cos(above_horizon(geometry.solar_zenith))
    mu = jnp.cos(above_horizon(geometry.view_zenith))
    angles = mu0, mu, geometry.relative_azimuth
    optics = column_optics(state.atmosphere, BANDS[band], gases)
    given = {
        "moments": optics.moments(num_moments),
        "phase_function": optics.phase_function(cos_scattering_angle(*angles)),
        "albedo": ground_of(state, band),
        "mu0": mu0,
        "mu": mu,
        "relative_azimuth": geometry.relative_azimuth,
    }
    if emitting_as is not None:
        given["solar_irradiance"] = solar_irradiance
        given |= _emission(state, band, emitting_as)
    count = optics.weight.shape[0]
    repeated = jax.tree.map(lambda x: jnp.broadcast_to(x, (count, *x.shape)), given)
    return BandColumns(repeated | {"tau": optics.tau, "ssa": optics.ssa}, optics.weight)


def ground_of(state: State, band: str) -> Any:
    """Albedo of a Lambertian ground, given as one or as a surface, or any other surface."""
    ground = state.albedo[band]
    return ground.albedo if isinstance(ground, Lambertian) else ground


def above_horizon(zenith: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Zenith angle, or a harmless constant where it is at or below the horizon. [rad]"""
    return jnp.where(jnp.cos(zenith) > 0, zenith, zenith.dtype.type(HARMLESS_ZENITH))


def _emission(state: State, band: str, satellite: str) -> dict[str, Array]:
    """Planck function of the levels, and what leaves the ground."""
    at_levels, at_ground = state.atmosphere.temperature, state.surface_temperature
    assert at_levels is not None and at_ground is not None  # refused at the door
    fire = {}
    if state.fire is not None:
        hot = in_band_radiance(state.fire.temperature, band, satellite)
        fire = {"fire": hot, "fraction": state.fire.fraction}
    ground = ground_of(state, band)
    albedo = ground if isinstance(ground, jax.Array) else ground.white_sky_albedo()
    background = in_band_radiance(at_ground, band, satellite)
    return {
        "planck_levels": in_band_radiance(at_levels, band, satellite),
        "surface_emission": surface_emission(albedo, background, **fire),
    }
