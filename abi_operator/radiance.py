"""The operator for radiances: sunlight, and what the air, the ground and fires give off.

`brf` and `reflectance_factor` are answers to sunlight alone; a band in which fires shine has to be
simulated as radiance. Sunlight and emission are one solve.
"""

from collections.abc import Sequence
from typing import Any, Unpack

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._keywords import with_keywords
from .atmosphere import State
from .bands import GRASSO2013
from .geometry import is_up
from .optics_and_solver import Inputs, Options, solve
from .planck import brightness_temperature as temperature_of
from .satellites import solar_irradiance
from .settings import ByName, Settings, settings_of
from .state_checks import check_state, checked_bands, is_concrete, uniform

THERMAL = ("C07",)
"""Bands whose emission is always simulated."""
FIRE_BANDS = ("C05", "C06", "C07")
"""Bands whose emission is simulated where there is a fire: without, C05 and C06 get no more than
4e-5 of the sun's light from a ground of 300 K."""

WARMEST_WITHOUT_FIRE = 350.0
"""Temperature of the ground up to which nothing has to shine in C05 and C06: there it would give
C06 9e-4 of the sun's light from a white ground, and C05 1e-6. [K]"""
# Distances that the sun has, and some more. [AU]
_SUN_DISTANCE = 0.9, 1.1


@with_keywords(ByName, Settings())
def radiance(
    state: State,
    bands: Sequence[str] = (*GRASSO2013, "C07"),
    *,
    sun_distance: Float[Array, "*batch"] | float = 1.0,
    **settings: Unpack[ByName],
) -> Float[Array, "*batch band"]:
    r"""Radiance at the top of the atmosphere, by band, before any limit. [W m-2 sr-1 um-1]

    In bands that emit, levels shine by the Planck function of their temperature, averaged over
    the response, and the ground isotropically with :math:`(1 - a)[p B(T_f) + (1 - p) B(T_s)]`.
    With the sun at or below the horizon emission is all there is; with the satellite there it is
    NaN. An anisotropic ground emits 1 minus its white-sky albedo to all sides, which makes the
    energy right that leaves it and no more.

    Parameters
    ----------
    state
        One column, or a batch of columns: the same axes leading on every leaf.
    bands
        Names of the bands, each present in the state's albedo and plumes. C07 needs temperatures
        of the levels and of the ground; so do C05 and C06 where there is a fire.
    sun_distance
        Distance of the sun, one for all columns or one each, 0.9 to 1.1. [AU]
    **settings
        Satellite, gases and accuracy: the fields of `Settings`.

    Returns
    -------
    One value per column and band, in the order of `bands`.

    Raises
    ------
    ValueError
        As `brf`, and if a temperature is missing, the satellite unknown, or the fit of gas
        absorption not made for the satellite's band (C04 of GOES-19); if distances of the sun are
        not those of the batch or, where they can be read, out of range; and where in C05 or C06 a
        ground above 350 K would not shine, as there is no fire.
    """
    how = settings_of(settings)
    bands = checked_bands(state, bands, how.gases, how.satellite)
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
    state, _ = uniform(state)
    if is_concrete(state):
        check_state(state)
        _refuse_hot_ground(state, bands)
    mu0 = state.geometry.mu0
    sun = sunlight(mu0, bands, how.satellite, sun_distance)
    options = Options(bands, tuple(emitting), how)
    found = solve(Inputs(state, {x: sun[x] for x in emitting}), options)
    factor = [jnp.ones_like(mu0) if x in emitting else of_white_ground(mu0, sun[x]) for x in bands]
    # A sun that is nowhere is not below the horizon.
    seen = is_up(state.geometry.view_zenith) & ~jnp.isnan(mu0)
    return jnp.where(seen[..., None], found * jnp.stack(factor, axis=-1), jnp.nan)


def sunlight(
    mu0: Float[Array, "*batch"],
    bands: Sequence[str],
    satellite: str,
    sun_distance: Float[Array, "*batch"] | float = 1.0,
) -> dict[str, Float[Array, "*batch"]]:
    """Solar irradiance of each band at the sun's distance, 0 by night. [W m-2 um-1]

    Parameters
    ----------
    mu0
        Cosine of the solar zenith angle. [-]
    bands, satellite
        Names.
    sun_distance
        Distance of the sun. [AU]

    Raises
    ------
    ValueError
        If distances are not those of the batch or, where they can be read, out of range.
    """
    _check_sun_distance(sun_distance, mu0.shape)
    distance = jnp.broadcast_to(jnp.asarray(sun_distance, mu0.dtype), mu0.shape)
    share = jnp.where(mu0 > 0, 1 / distance**2, 0)
    return {x: solar_irradiance(x, satellite) * share for x in bands}


def _check_sun_distance(distance: Any, batch: tuple[int, ...]) -> None:
    """Refuse distances that are not one for all columns or one each, or not those of the sun."""
    shape = np.shape(distance)
    if len(shape) > len(batch) or any(
        n not in (1, m) for n, m in zip(shape[::-1], batch[::-1], strict=False)
    ):
        raise ValueError(
            f"sun_distance has shape {shape}, but solar_zenith has {batch}: allowed is one number, "
            "or one for each column."
        )
    if not is_concrete(distance):
        return
    x, (low, high) = np.asarray(distance), _SUN_DISTANCE
    bad = ~((x >= low) & (x <= high))
    if bad.any():
        raise ValueError(
            f"sun_distance is {x[bad].flat[0]}; allowed is {low:g} to {high:g} AU (in AU, not km)."
        )


def _refuse_hot_ground(state: State, bands: Sequence[str]) -> None:
    """Refuse a ground that shines in bands of which the emission is not simulated."""
    dark = [x for x in bands if x in FIRE_BANDS and x not in THERMAL]
    if state.fire is not None or state.surface_temperature is None or not dark:
        return
    warmth = np.asarray(state.surface_temperature)
    if np.any(warmth > WARMEST_WITHOUT_FIRE):
        raise ValueError(
            f"state.surface_temperature is {warmth.max():g} K, and without a fire no emission is "
            f"simulated in {dark}: allowed is {WARMEST_WITHOUT_FIRE:g} K at most. Give "
            "state.fire = Fire(fraction=0, temperature=...), or leave these bands out."
        )


def of_white_ground(
    mu0: Float[Array, "*batch"], sun: Float[Array, "*batch"]
) -> Float[Array, "*batch"]:
    """Radiance of a white Lambertian ground without air. [W m-2 sr-1 um-1]

    It turns a bidirectional reflectance factor into a radiance.

    Parameters
    ----------
    mu0
        Cosine of the solar zenith angle. [-]
    sun
        Solar irradiance, from `sunlight`. [W m-2 um-1]
    """
    # The cosine may be below 0 only where the sunlight is 0.
    return sun * jnp.where(mu0 > 0, mu0 / np.pi, 0)


@with_keywords(ByName, Settings())
def brightness_temperature(
    state: State,
    *,
    sun_distance: Float[Array, "*batch"] | float = 1.0,
    **settings: Unpack[ByName],
) -> Float[Array, "*batch"]:
    """Temperature of the black body that C07 would take a column for. [K]

    Parameters
    ----------
    state, sun_distance, **settings
        As in `radiance`; the state has temperatures and a ground in C07.

    Returns
    -------
    One number for each column, in the batch's shape, before any limit of the instrument; NaN where
    the satellite is out of sight.

    Raises
    ------
    ValueError
        As `radiance`.
    """
    seen = radiance(state, ("C07",), sun_distance=sun_distance, **settings)
    return temperature_of(seen[..., 0], "C07", settings_of(settings).satellite)
