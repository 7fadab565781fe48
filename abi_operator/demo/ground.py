"""Colour of the ground in the bands of MODIS, and the kernel weights that describe it."""

from typing import NamedTuple

import numpy as np

from ..surface.ross_li import WHITE_SKY
from .landscape import Landscape

# White-sky albedo of MODIS bands 1 to 7 (645, 858, 469, 555, 1240, 1640, 2130 nm). [-]
_PLANTS = np.array([0.050, 0.270, 0.028, 0.060, 0.270, 0.170, 0.085])
_SOIL = np.array([0.240, 0.310, 0.125, 0.185, 0.370, 0.400, 0.350])
_WET_SAND = np.array([0.110, 0.120, 0.085, 0.105, 0.110, 0.090, 0.070])
# f_vol and f_geo relative to f_iso, for plants and for soil. [-]
_PLANTS_SHAPE = np.array([1.0, 0.55, 0.12])
_SOIL_SHAPE = np.array([1.0, 0.35, 0.16])


class Ground(NamedTuple):
    """What the ground consists of (y, x).

    Parameters
    ----------
    plants, beach
        Shares of the ground covered by green plants and by wet sand. [-]
    soil
        Brightness of the bare soil relative to the mean. [-]
    """

    plants: np.ndarray
    beach: np.ndarray
    soil: np.ndarray

    def kernel_weights(self, dryness: float) -> np.ndarray:
        """Weights f_iso, f_vol, f_geo of the ground's reflectance.

        Parameters
        ----------
        dryness
            Share of the plants that has withered. [-]

        Returns
        -------
        numpy.ndarray
            Weights (band, y, x, 3) in MODIS bands 1 to 7. [-]
        """
        plants, beach = (1 - dryness) * self.plants[..., None], self.beach[..., None]
        albedo = plants * _PLANTS + (1 - plants) * self.soil[..., None] * _SOIL
        albedo = (1 - beach) * albedo + beach * _WET_SAND
        shape = plants * _PLANTS_SHAPE + (1 - plants) * _SOIL_SHAPE
        shape = shape / (shape @ np.array(WHITE_SKY))[..., None]
        return np.moveaxis(albedo, -1, 0)[..., None] * shape


def make_ground(
    landscape: Landscape,
    east: np.ndarray,
    north: np.ndarray,
    distance: np.ndarray,
    resolution: float,
) -> Ground:
    """Cover places on the map, this far inland, leaving out details below `resolution`. [m]"""
    return Ground(
        plants=landscape.vegetation(east, north, distance),
        beach=np.exp(-np.maximum(distance, 0) / 2.5e3),
        soil=np.exp(0.16 * landscape.soil(east, north, resolution)),
    )
