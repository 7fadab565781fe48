"""The demonstration's map: Mercator on WRF's sphere, 256 km wide whatever the number of pixels."""

from typing import NamedTuple

import numpy as np

CENTRE_LATITUDE = 33.5
CENTRE_LONGITUDE = -117.5
EXTENT = 256.0e3
"""Length of the domain's sides, in the map. [m]"""

# Radius of WRF's earth [m] and scale of a map that is true at the centre's latitude.
_RADIUS = 6.370e6 * np.cos(np.radians(CENTRE_LATITUDE))


class Grid(NamedTuple):
    """Places (y, x) east and north of the centre, and how far apart they are. [m]"""

    east: np.ndarray
    north: np.ndarray
    spacing: float


def make_grid(size: int) -> Grid:
    """Centres of `size` x `size` cells that fill the domain, the southernmost row first."""
    spacing = EXTENT / size
    along = (np.arange(size) + 0.5) * spacing - EXTENT / 2
    east, north = np.meshgrid(along, along)
    return Grid(east, north, spacing)


def latitude_longitude(east: np.ndarray, north: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Latitude and longitude of places on the map. [m] -> [degree]"""
    stretched = np.arcsinh(np.tan(np.radians(CENTRE_LATITUDE))) + north / _RADIUS
    latitude = np.degrees(np.arctan(np.sinh(stretched)))
    return latitude, CENTRE_LONGITUDE + np.degrees(east / _RADIUS)


def east_north(latitude: np.ndarray, longitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inverse of `latitude_longitude`. [degree] -> [m]"""
    stretched = np.arcsinh(np.tan(np.radians(latitude)))
    north = _RADIUS * (stretched - np.arcsinh(np.tan(np.radians(CENTRE_LATITUDE))))
    return _RADIUS * np.radians(longitude - CENTRE_LONGITUDE), north
