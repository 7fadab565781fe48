"""What of the operator's output is looked at, by name: bands, green, the contrast of a fire."""

from collections.abc import Sequence
from dataclasses import replace

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..atmosphere import Fire, State
from ..bands import BANDS
from ..products import GREEN_RECIPES, derived_green, fire_contrast
from ..radiance import FIRE_BANDS, THERMAL, of_white_ground, radiance, sunlight
from ..reflectance import brf
from ..settings import Settings
from .derivatives import Function

FIRE_CONTRAST = "fire_contrast"
FIRE_BAND = "C06"
_COLOURS = ("C02", "C01", "C03")  # in the order of a recipe's arguments
_SOLAR = tuple(band for band in BANDS if band not in THERMAL)


def check_outputs(names: Sequence[str]) -> tuple[str, ...]:
    """Return names of outputs as a tuple, or raise `ValueError` for what is none.

    Bands are bidirectional reflectance factors, C05 and C06 with what shines there of states with a
    fire; ``green`` is derived by Eq. (1) of Grasso et al. (2013), ``green:bah2018`` by another
    recipe; light of 0.555 um itself is ``green_band``. The contrast of a fire is that in C06, as
    `products.fire_contrast` has it.
    """
    for name in names:
        if name != FIRE_CONTRAST and name not in _PLAIN and _recipe(name) is None:
            raise ValueError(
                f"no output {name!r}; choose from {', '.join(_PLAIN)}, green, "
                f"{', '.join(f'green:{recipe}' for recipe in GREEN_RECIPES)} and {FIRE_CONTRAST}."
            )
    if not names:
        raise ValueError("there is no output to look at; name at least one.")
    return tuple(names)


def bands_of(names: Sequence[str]) -> tuple[str, ...]:
    """Bands that outputs are made of."""
    found: list[str] = []
    for name in names:
        if name == FIRE_CONTRAST:
            found.append(FIRE_BAND)
        else:
            found += [_PLAIN[name]] if name in _PLAIN else list(_COLOURS)
    return tuple(dict.fromkeys(found))


def output_function(
    names: Sequence[str], settings: Settings, sun_distance: float = 1.0
) -> Function:
    """A function of states to these outputs (column, of), each band simulated once.

    Parameters
    ----------
    names
        As `check_outputs` takes them.
    settings
        How to simulate.
    sun_distance
        For what shines beside the sun. [AU]

    Raises
    ------
    ValueError
        As `check_outputs`; by the function where there is no fire whose contrast to look at, or no
        temperature of what shines (`radiance`).
    """
    names = check_outputs(names)
    bands = bands_of([name for name in names if name != FIRE_CONTRAST])

    def outputs(states: State) -> Float[Array, "column of"]:
        shining = [band for band in bands if states.fire is not None and band in FIRE_BANDS]
        dark = tuple(band for band in bands if band not in shining)
        found: dict[str, Array] = {}
        if dark:
            seen = brf(replace(states, fire=None), dark, **settings._asdict())
            found = {band: seen[..., k] for k, band in enumerate(dark)}
        if shining:
            found |= _brf_with_emission(states, tuple(shining), settings, sun_distance)
        columns = []
        for name in names:
            if name == FIRE_CONTRAST:
                columns.append(_contrast(states, settings, sun_distance))
            elif name in _PLAIN:
                columns.append(found[_PLAIN[name]])
            else:
                colours = (found[band] for band in _COLOURS)
                columns.append(derived_green(*colours, recipe=_recipe(name) or "grasso2013"))
        return jnp.stack(columns, axis=-1)

    return outputs


def _brf_with_emission(
    states: State, bands: tuple[str, ...], settings: Settings, sun_distance: float
) -> dict[str, Array]:
    """Bidirectional reflectance factor of all light, as a result of a simulation has it, by band.

    NaN, with derivative 0, where the sun is down.
    """
    seen = radiance(states, bands, sun_distance=sun_distance, **settings._asdict())
    mu0 = states.geometry.mu0
    found = {}
    for k, (band, sun) in enumerate(sunlight(mu0, bands, settings.satellite, sun_distance).items()):
        white = of_white_ground(mu0, sun)
        by_day = white > 0
        found[band] = jnp.where(by_day, seen[..., k] / jnp.where(by_day, white, 1), jnp.nan)
    return found


def _contrast(states: State, settings: Settings, sun_distance: float) -> Array:
    """Of the fire that the states have, against the same ground without one."""
    if states.fire is None:
        raise ValueError("the contrast of a fire is of states with a fire (State.fire).")
    none = Fire(jnp.zeros_like(states.fire.fraction), states.fire.temperature)
    with_fire, without = (
        radiance(x, (FIRE_BAND,), sun_distance=sun_distance, **settings._asdict())[..., 0]
        for x in (states, replace(states, fire=none))
    )
    return jnp.asarray(fire_contrast(with_fire, without))


def _recipe(name: str) -> str | None:
    """Recipe of a derived green, None where the name is of none."""
    if name == "green":
        return "grasso2013"
    kind, _, recipe = name.partition(":")
    return recipe if kind == "green" and recipe in GREEN_RECIPES else None


_PLAIN = {band: band for band in _SOLAR if band != "green"} | {"green_band": "green"}
