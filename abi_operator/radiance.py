"""The operator for radiances: sunlight, and what the air, the ground and fires give off.

`brf` and `reflectance_factor` are answers to sunlight alone; a band in which fires shine has to be
simulated as radiance. Sunlight and emission are one solve.
"""

from collections.abc import Sequence

import jax.numpy as jnp
from jaxtyping import Array, Float

from .atmosphere import State
from .band_columns import band_columns, checked_bands, uniform
from .bands import GRASSO2013
from .optics import ALL_GASES
from .planck import brightness_temperature as temperature_of
from .planck import in_band_radiance
from .satellites import check_satellite, gas_fit_covers, solar_irradiance
from .solver import toa_radiance
from .surface import surface_emission

THERMAL = ("C07",)
"""Bands whose emission is always simulated."""
FIRE_BANDS = ("C05", "C06", "C07")
"""Bands whose emission is simulated where there is a fire: without, C05 and C06 get no more than
4e-5 of the sun's light from a ground of 300 K."""


def radiance(
    state: State,
    bands: Sequence[str] = (*GRASSO2013, "C07"),
    *,
    satellite: str = "GOES-16",
    sun_distance: Float[Array, "*batch"] | float = 1.0,
    gases: Sequence[str] = ALL_GASES,
    num_streams: int = 8,
    num_modes: int | None = None,
    num_doublings: int | None = None,
) -> Float[Array, "*batch band"]:
    r"""Radiance at the top of the atmosphere, by band, before any limit. [W m-2 sr-1 um-1]

    In bands that emit, levels shine by the Planck function of their temperature, averaged over
    the response, and the ground isotropically with :math:`(1 - a)[p B(T_f) + (1 - p) B(T_s)]`.
    With the sun at or below the horizon emission is all there is.

    Parameters
    ----------
    state
        One column, or a batch of columns: the same axes leading on every leaf.
    bands
        Names of the bands, each present in the state's albedo and plumes. C07 needs temperatures
        of the levels and of the ground; so do C05 and C06 where there is a fire.
    satellite
        Whose solar irradiance and response; optics are those of GOES-16.
    sun_distance
        Distance of the sun. [AU]
    gases, num_streams, num_modes, num_doublings
        As in `brf`.

    Returns
    -------
    One value per column and band, in the order of `bands`.

    Raises
    ------
    ValueError
        As `brf`, and if a temperature is missing, the satellite unknown, or the fit of gas
        absorption not made for the satellite's band (C04 of GOES-19).
    """
    bands = checked_bands(state, bands)
    check_satellite(satellite)
    gases = tuple(gases)
    for name in bands:
        if gases and state.atmosphere.gases is not None and not gas_fit_covers(satellite, name):
            raise ValueError(
                f"the gas absorption of {name} is not that of {satellite}; leave the gases out "
                "with gases=()."
            )
    emitting = [x for x in bands if x in (THERMAL if state.fire is None else FIRE_BANDS)]
    missing = [
        name
        for name, x in (
            ("atmosphere.temperature", state.atmosphere.temperature),
            ("surface_temperature", state.surface_temperature),
        )
        if x is None
    ]
    if emitting and missing:
        raise ValueError(f"emission in {emitting} needs {' and '.join(missing)} of the state.")
    state, batch = uniform(state)
    options = {
        "num_streams": num_streams,
        "num_modes": num_modes,
        "num_doublings": num_doublings,
    }
    sun = _sunlight(state, bands, satellite, sun_distance)
    found = {}
    for group in (tuple(x for x in bands if x not in emitting), tuple(emitting)):
        if not group:
            continue
        columns = band_columns(state, group, gases, num_streams + 1)
        light = {"solar_irradiance": jnp.stack([sun[x] for x in group], axis=-1)}
        if emitting and group == tuple(emitting):
            light |= _emission(state, group, satellite)
        light = {name: columns.repeated(x) for name, x in light.items()}
        total = columns.summed(toa_radiance(**columns.layers, **light, **options))
        found |= {x: total[..., k] for k, x in enumerate(group)}
    return jnp.stack([found[x] for x in bands], axis=-1).reshape(*batch, len(bands))


def brightness_temperature(
    state: State, *, satellite: str = "GOES-16", **options
) -> Float[Array, "*batch"]:
    """Temperature of the black body that C07 would take a column for. [K]

    Parameters
    ----------
    state, satellite, options
        As in `radiance`.
    """
    seen = radiance(state, ("C07",), satellite=satellite, **options)
    return temperature_of(seen[..., 0], "C07", satellite)


def _sunlight(state: State, bands: tuple[str, ...], satellite: str, distance) -> dict[str, Array]:
    """Solar irradiance of each column in each band, 0 by night."""
    mu0 = state.geometry.mu0
    shares = jnp.where(mu0 > 0, 1 / jnp.asarray(distance, mu0.dtype) ** 2, 0)
    return {x: solar_irradiance(x, satellite) * shares for x in bands}


def _emission(state: State, bands: tuple[str, ...], satellite: str) -> dict[str, Array]:
    levels, ground = [], []
    at_levels, at_ground = state.atmosphere.temperature, state.surface_temperature
    assert at_levels is not None and at_ground is not None  # refused at the door
    for name in bands:
        levels.append(in_band_radiance(at_levels, name, satellite))
        background = in_band_radiance(at_ground, name, satellite)
        fire = {}
        if state.fire is not None:
            hot = in_band_radiance(state.fire.temperature, name, satellite)
            fire = {"fire": hot, "fraction": state.fire.fraction}
        ground.append(surface_emission(state.albedo[name], background, **fire))
    return {
        "planck_levels": jnp.stack(levels, axis=-2),
        "surface_emission": jnp.stack(ground, axis=-1),
    }
