"""Liquid clouds: a broken deck of stratocumulus at sea, a few small cumuli over the hills."""

from typing import NamedTuple

import numpy as np

from .air import Air, saturation_mixing_ratio
from .grid import Grid
from .landscape import coast_axes
from .noise import Noise, make_noise

# Growth of liquid water with height in a cloud, four fifths of the adiabatic one. [kg m-4]
_WATER_GROWTH = 1.6e-6
# Thinner clouds evaporate. [m]
_THINNEST = 50.0


class Clouds(NamedTuple):
    """Where clouds are (y, x).

    Parameters
    ----------
    base, thickness
        Height of the cloud's base above sea level; thickness, 0 where there is no cloud. [m]
    """

    base: np.ndarray
    thickness: np.ndarray


class Weather(NamedTuple):
    """Random fields from which clouds are made."""

    cells: Noise
    deck: Noise
    cumuli: Noise


def make_weather(rng: np.random.Generator) -> Weather:
    """Draw the fields."""
    return Weather(
        cells=make_noise(rng, 26e3, 3e3, slope=0.8),
        deck=make_noise(rng, 110e3, 30e3),
        cumuli=make_noise(rng, 22e3, 5e3, slope=0.5),
    )


def make_clouds(weather: Weather, grid: Grid, distance: np.ndarray, terrain: np.ndarray) -> Clouds:
    """Cover the sea with 17 and the land with 2 hundredths of the scene.

    Parameters
    ----------
    weather
        The random fields.
    grid
        Where to evaluate them.
    distance, terrain
        Distance inland and height of the ground (y, x). [m]
    """
    place = (grid.east, grid.north, grid.spacing)
    inland, along = coast_axes(grid.east, grid.north)
    far_out = -(((inland + 95e3) / 50e3) ** 2) + 0.35 * along / 60e3
    deck = far_out + 0.6 * weather.deck(*place) + 0.42 * weather.cells(*place)
    deck = _excess(np.where(distance < -6e3, deck, -np.inf), 0.17)
    hills = 1.2 * np.exp(-(((distance - 85e3) / 20e3) ** 2)) + weather.cumuli(*place)
    hills = _excess(np.where(distance > 15e3, hills, -np.inf), 0.02)
    lumps = np.clip(1 + 0.22 * weather.cells(*place), 0.4, 1.5)
    at_sea = 330 * lumps * np.sqrt(1 - np.exp(-deck / 0.4))
    on_land = 320 * np.sqrt(1 - np.exp(-hills / 0.5))
    thickness = at_sea + on_land
    base = np.where(distance < 0, 380 + 25 * weather.deck(*place), terrain + 1300)
    return Clouds(base, np.where(thickness > _THINNEST, thickness, 0.0))


def cloud_mixing_ratio(clouds: Clouds, air: Air) -> np.ndarray:
    """Cloud water per mass of dry air (layer, y, x), rising linearly from base to top. [kg kg-1]"""
    inside = np.clip(air.height - clouds.base, 0, clouds.thickness)
    path = _WATER_GROWTH / 2 * np.diff(inside**2, axis=0)
    return path / (np.diff(air.height, axis=0) * air.dry_density)


def saturate(air: Air, cloud_water: np.ndarray) -> Air:
    """Return `air` with as much vapour in the clouds as it can hold."""
    saturated = saturation_mixing_ratio(air.pressure, air.temperature)
    return air._replace(vapour=np.where(cloud_water > 0, saturated, air.vapour))


def _excess(field: np.ndarray, share: float) -> np.ndarray:
    """By how much a field exceeds the value that this share of the places exceeds."""
    return np.maximum(field - np.quantile(field, 1 - share, method="lower"), 0)
