"""What columns send to the imager: sunlight alone, or sunlight and emission as one radiance.

A column is solved for as little as it needs. Where nothing shines the answer to sunlight is
enough, by day; in C07 all columns shine, and in C05 and C06 those in which it burns, or whose
ground is as hot as that (`radiance.WARMEST_WITHOUT_FIRE`), day and night.
"""

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..atmosphere import Fire, State
from ..geometry import is_up
from ..machine.listening import Listener, listening
from ..nomenclature import QUALITY_FLAGS
from ..planck import brightness_temperature
from ..radiance import FIRE_BANDS, THERMAL, WARMEST_WITHOUT_FIRE, radiance
from ..reflectance import brf
from ..satellites import solar_irradiance
from .kinds_of_ground import by_kind

# Pixels with one of these flags are not solved; those of a night may shine.
_UNSEEN = QUALITY_FLAGS["no_albedo"] | QUALITY_FLAGS["out_of_sight"]
_HARMLESS = 1000.0  # temperature of a fire that is none [K]
_UNSOLVED = _UNSEEN | QUALITY_FLAGS["night"]


class Unheard(NamedTuple):
    """Hears for a listener of what is compiled, but not of columns that it does not count."""

    listener: Listener

    def compiling(self, begins: bool) -> None:
        """Pass on that a program begins, or has ended, to be compiled."""
        self.listener.compiling(begins)

    def solved(self, columns: int) -> None:
        """Say nothing: these columns are counted elsewhere."""


def light(
    states: State,
    flags: np.ndarray,
    streams: np.ndarray,
    bands: tuple[str, ...],
    satellite: str,
    distance: float,
    settings: dict[str, Any],
    listener: Listener | None = None,
) -> dict[str, np.ndarray]:
    """Reflectance factor, brf and radiance of columns (column, band); with C07 its temperature.

    Parameters
    ----------
    states
        Columns.
    flags, streams
        Their ``quality_flag`` (column): which cannot be solved; and streams of the solver (column).
    bands, satellite, distance
        Names of the bands, and of the satellite; distance of the sun. [AU]
    settings
        Others of the operator, by name.
    listener
        Is told of columns as they are solved, those that shine in C05 and C06 not twice.
    """
    with listening(listener):
        fields = _of_sunlight(
            dataclasses.replace(states, fire=None), flags, streams, bands, settings
        )
    irradiance = np.array([solar_irradiance(x, satellite) / (np.pi * distance**2) for x in bands])
    fields["radiance"] = fields["reflectance_factor"] * irradiance
    uncounted = None if listener is None else Unheard(listener)
    mu0 = np.cos(np.asarray(states.geometry.solar_zenith))
    burning = states if states.fire is not None else _with_no_fire(states)
    for k, band in enumerate(bands):
        shines = _shining(states, flags, band)
        if not shines.any():
            continue
        for number in np.unique(streams[shines]):
            chosen = shines & (streams == number)
            with listening(listener if band in THERMAL else uncounted):
                seen = radiance(
                    _some(states if band in THERMAL else burning, chosen),
                    (band,),
                    satellite=satellite,
                    sun_distance=distance,
                    num_streams=int(number),
                    **settings,
                )
            fields["radiance"][chosen, k] = np.asarray(seen)[:, 0]
        if band not in THERMAL:
            factor = fields["radiance"][shines, k] / irradiance[k]
            fields["reflectance_factor"][shines, k] = factor
            day = np.asarray(is_up(states.geometry.solar_zenith))[shines]
            fields["brf"][shines, k] = np.where(day, factor / np.where(day, mu0[shines], 1), np.nan)
    if "C07" in bands:
        seen = jnp.asarray(fields["radiance"][:, bands.index("C07")])
        fields["brightness_temperature"] = np.asarray(
            brightness_temperature(seen, "C07", satellite)
        )
    return fields


def _shining(states: State, flags: np.ndarray, band: str) -> np.ndarray:
    """Which columns have to be solved for their emission in a band (column)."""
    seen = (flags & _UNSEEN) == 0
    if band in THERMAL:
        return seen
    if band not in FIRE_BANDS:
        return np.zeros_like(seen)
    ground, air = states.surface_temperature, states.atmosphere.temperature
    hot = np.zeros_like(seen)
    if ground is not None and air is not None:
        hot |= np.asarray(ground) > WARMEST_WITHOUT_FIRE
    if states.fire is not None:
        hot |= np.asarray(states.fire.fraction) > 0
    return seen & hot


def _with_no_fire(states: State) -> State:
    """Columns that shine by their ground alone in C05 and C06, too."""
    none: Any = np.zeros_like(np.asarray(states.geometry.solar_zenith))
    return dataclasses.replace(states, fire=Fire(none, none + _HARMLESS))


def _of_sunlight(
    states: State,
    flags: np.ndarray,
    streams: np.ndarray,
    bands: tuple[str, ...],
    settings: dict[str, Any],
) -> dict[str, np.ndarray]:
    """Reflectance factor and brf (column, band) of the columns that can be solved."""
    solar = tuple(band for band in bands if band not in THERMAL)
    solved = (flags & _UNSOLVED) == 0
    values = np.full((len(flags), len(bands)), np.nan)
    index = np.array([bands.index(band) for band in solar], int)
    for number in np.unique(streams[solved]) if solar else ():
        alike = solved & (streams == number)
        for chosen, some in by_kind(_some(states, alike)):
            found = brf(some, solar, num_streams=int(number), **settings)
            values[np.ix_(np.flatnonzero(alike)[chosen], index)] = found
    factor = np.cos(states.geometry.solar_zenith)[:, None] * values
    in_sight = (flags & QUALITY_FLAGS["out_of_sight"]) == 0
    night = ((flags & QUALITY_FLAGS["night"]) > 0) & in_sight
    factor[np.ix_(night, np.array([band in solar for band in bands]))] = 0.0
    return {"reflectance_factor": factor, "brf": values}


def _some(states: State, chosen: np.ndarray) -> State:
    index = np.flatnonzero(chosen)
    return jax.tree.map(lambda x: x[index], states)
