"""Smoke of three fires, blown over the sea, as the grey values of a picture."""

from typing import NamedTuple

import numpy as np

from .grid import Grid
from .landscape import coast_axes
from .noise import make_noise

# Fires: distance from the domain's centre inland and along the coast to the south-east [m], and
# strength relative to the strongest [-].
_FIRES = ((33e3, -78e3, 0.75), (40e3, 2e3, 1.0), (27e3, 66e3, 0.85))
# The Santa Ana wind blows to the south-west; angle from inland towards along the coast. [rad]
_HEADING = np.radians(186.0)
# Share of the picture that smoke covers.
_COVER = 0.25
# Half width of a plume at the fire [m] and how it grows downwind [-].
_WIDTH = 2.2e3
_SPREAD = 0.10


class Smoke(NamedTuple):
    """Smoke and its sources.

    Parameters
    ----------
    brightness
        Of the picture (y, x), 0 to 1 and 0 outside the smoke. [-]
    east, north
        Of the fires. [m]
    strength
        Of the fires, relative to the strongest. [-]
    """

    brightness: np.ndarray
    east: np.ndarray
    north: np.ndarray
    strength: np.ndarray


def make_smoke(rng: np.random.Generator, grid: Grid) -> Smoke:
    """Smoke of fires near the coast, a little elsewhere for every seed."""
    inland, along = coast_axes(grid.east, grid.north)
    smoke, places = np.zeros_like(inland), []
    for fire_inland, fire_along, strength in _FIRES:
        shift = rng.uniform(-6e3, 6e3, size=2)
        places.append((fire_inland + shift[0], fire_along + shift[1]))
        heading = _HEADING + rng.uniform(-0.07, 0.07)
        ahead, aside = inland - fire_inland - shift[0], along - fire_along - shift[1]
        downwind = np.cos(heading) * ahead + np.sin(heading) * aside
        crosswind = np.cos(heading) * aside - np.sin(heading) * ahead
        smoke += strength * _plume(rng, downwind, crosswind, grid.spacing)
    clear = np.quantile(smoke, 1 - _COVER)
    dense = np.quantile(smoke, 0.998)
    brightness = np.clip((smoke - clear) / (dense - clear), 0, 1) ** 0.7
    # Turned once more, the axes along the coast are those of the map again.
    east, north = coast_axes(*np.transpose(places))
    return Smoke(brightness, east, north, np.array([strength for *_, strength in _FIRES]))


def _plume(
    rng: np.random.Generator, downwind: np.ndarray, crosswind: np.ndarray, resolution: float
) -> np.ndarray:
    """Density of one plume, Gaussian across the wind, with meanders, billows and streaks. [-]"""
    meander = make_noise(rng, 110e3, 30e3)
    billows = make_noise(rng, 26e3, 4e3)
    streaks = make_noise(rng, 16e3, 2.5e3, slope=0.7)
    gone = np.maximum(downwind, 0)
    width = _WIDTH + _SPREAD * gone
    aside = crosswind + 0.35 * width * meander(downwind, crosswind, resolution)
    aside = aside + 0.35 * np.minimum(width, 6e3) * billows(downwind, crosswind, resolution)
    across = np.exp(-((aside / width) ** 2) / 2)
    start = np.exp(-((np.minimum(downwind, 0) / _WIDTH) ** 2))
    texture = np.exp(0.36 * streaks(downwind / 4, aside, resolution))
    return start * across * texture * (_WIDTH / width) ** 0.45 * np.exp(-gone / 400e3)
