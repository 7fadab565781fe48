"""A coast like southern California's: islands, a green strip, mountains, dry plains behind them."""

import math
from typing import NamedTuple

import numpy as np

from .noise import Noise, make_noise

INLAND = (0.64, math.sqrt(1 - 0.64**2))
"""Unit vector, east and north, from the sea to the land."""

# Distance inland of the centre of the domain. [m]
_CENTRE_INLAND = 10.0e3
# East and north of an island's centre, half its length along the coast, half its width. [m]
_ISLANDS = ((-84.0e3, -8.0e3, 17.0e3, 6.0e3), (-91.0e3, -72.0e3, 16.0e3, 5.0e3))


class Landscape(NamedTuple):
    """Random fields from which the land is made.

    Methods take places on the map and the distance inland that `coast_distance` gives them. [m]
    """

    coast: Noise
    relief: Noise
    plants: Noise
    soil: Noise

    def coast_distance(self, east: np.ndarray, north: np.ndarray) -> np.ndarray:
        """Distance inland of the nearest coast, roughly; negative at sea. [m]"""
        inland, along = coast_axes(east, north)
        headlands = 1 - (along / 95e3) ** 2  # the shore recedes in the middle of a wide bight
        distance = inland + _CENTRE_INLAND - 9e3 * headlands + 5e3 * self.coast(east, north)
        shore = 1 + 0.25 * self.coast(north, east)
        for island_east, island_north, half_length, half_width in _ISLANDS:
            across, lengthwise = coast_axes(east - island_east, north - island_north)
            radius = np.hypot(across / half_width, lengthwise / half_length)
            distance = np.maximum(distance, half_width * (shore - radius))
        return distance

    def terrain(self, east: np.ndarray, north: np.ndarray, distance: np.ndarray) -> np.ndarray:
        """Height of the ground above sea level, 0 at sea. [m]"""
        relief = self.relief(east, north)
        ridge = np.exp(-(((distance - 68e3) / 17e3) ** 2))
        height = (
            700 * _smooth_step(distance / 110e3)
            + 650 * ridge * (1 + 0.3 * relief)
            + 70 * _smooth_step(distance / 20e3) * relief
            + 120 * _smooth_step(distance / 6e3)
        )
        return np.where(distance > 0, np.clip(height, 3, 1550), 0.0)

    def vegetation(self, east: np.ndarray, north: np.ndarray, distance: np.ndarray) -> np.ndarray:
        """Share of the ground covered by green plants. [-]"""
        coastal = 1 / (1 + np.exp((distance - 74e3) / 7e3))
        return np.clip(0.06 + 0.68 * coastal + 0.10 * self.plants(east, north), 0, 0.95)


def make_landscape(rng: np.random.Generator) -> Landscape:
    """Draw a landscape."""
    return Landscape(
        coast=make_noise(rng, 70e3, 8e3),
        relief=make_noise(rng, 50e3, 5e3),
        plants=make_noise(rng, 60e3, 3e3, slope=0.6),
        soil=make_noise(rng, 60e3, 3e3, slope=0.6),
    )


def coast_axes(east: np.ndarray, north: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Turn east and north into inland and along the coast (to the south-east). [m]"""
    inland = INLAND[0] * east + INLAND[1] * north
    return inland, INLAND[1] * east - INLAND[0] * north


def _smooth_step(x: np.ndarray) -> np.ndarray:
    """Rise smoothly from 0 at x = 0 to 1 at x = 1."""
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)
