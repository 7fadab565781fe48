"""Air over the coast in a Santa Ana wind: cool, moist and capped at sea, warm and dry inland."""

from typing import NamedTuple

import numpy as np

from ..constants import (
    DRY_AIR_GAS_CONSTANT,
    FREEZING,
    GRAVITY,
    STANDARD_PRESSURE,
    VAPOUR_GAS_CONSTANT,
)
from .landscape import INLAND

TOP_PRESSURE = 5000.0
"""Pressure at the top of the model. [Pa]"""

# Heights at which the levels lie over the sea, roughly. [m]
_LEVEL_HEIGHTS = np.array(
    [0, 60, 130, 210, 300, 395, 490, 590, 690, 800, 930, 1090, 1300, 1570, 1920, 2370, 2950, 3650]
    + [4500, 5500, 6600, 7800, 9100, 10500, 12200, 14300, 17000, 20500]
)
# Sounding at sea and inland: height [m], temperature [K] and relative humidity [-].
_SEA = np.array(
    [(0, 290.5, 0.78), (850, 284.5, 0.94), (1150, 294.0, 0.20), (3000, 283.5, 0.15)]
    + [(6000, 264.0, 0.20), (11000, 225.0, 0.20), (16000, 207.0, 0.01), (25000, 217.0, 0.001)]
).T
_LAND = np.array(
    [(0, 302.0, 0.14), (1500, 290.0, 0.20), (3000, 281.0, 0.18), (6000, 262.5, 0.20)]
    + [(11000, 224.5, 0.20), (16000, 207.0, 0.01), (25000, 217.0, 0.001)]
).T
# Wind inland and at sea. [m s-1]
_WIND_INLAND, _WIND_AT_SEA = 9.0, 4.0
_VAPOUR_RATIO = DRY_AIR_GAS_CONSTANT / VAPOUR_GAS_CONSTANT


class Air(NamedTuple):
    """Columns of air, the lowest level first, as WRF counts.

    Parameters
    ----------
    level_pressure, height
        At the levels (level, y, x); height is above sea level. [Pa], [m]
    pressure, temperature, vapour
        In the layers (layer, y, x); vapour per mass of dry air. [Pa], [K], [kg kg-1]
    """

    level_pressure: np.ndarray
    height: np.ndarray
    pressure: np.ndarray
    temperature: np.ndarray
    vapour: np.ndarray

    @property
    def dry_density(self) -> np.ndarray:
        """Mass of dry air per volume of the layers. [kg m-3]"""
        moist = 1 + self.vapour / _VAPOUR_RATIO
        return self.pressure / (DRY_AIR_GAS_CONSTANT * self.temperature * moist)


def eta_levels() -> np.ndarray:
    """WRF's vertical coordinate at the levels, 1 at the ground and 0 at the top. [-]"""
    pressure = standard_pressure(_LEVEL_HEIGHTS)
    return (pressure - pressure[-1]) / (pressure[0] - pressure[-1])


def standard_pressure(height: np.ndarray) -> np.ndarray:
    """Pressure of the standard atmosphere's lower layers. [m] -> [Pa]"""
    troposphere = STANDARD_PRESSURE * (1 - np.minimum(height, 11000) / 44330.8) ** 5.25588
    return troposphere * np.exp(-np.maximum(height - 11000, 0) / 6341.6)


def column_pressure(terrain: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pressure at the levels and in the layers over ground of this height. [m] -> [Pa]"""
    depth = standard_pressure(terrain) - TOP_PRESSURE
    levels = TOP_PRESSURE + eta_levels()[:, None, None] * depth
    return levels, (levels[1:] + levels[:-1]) / 2


def make_air(terrain: np.ndarray, marine: np.ndarray) -> Air:
    """Fill columns with air.

    Parameters
    ----------
    terrain
        Height of the ground (y, x). [m]
    marine
        Share of sea air in the column, the rest being land air (y, x). [-]
    """
    level_pressure, pressure = column_pressure(terrain)
    nothing = np.zeros_like(pressure)
    height = np.broadcast_to(_LEVEL_HEIGHTS[:, None, None], level_pressure.shape)
    air = Air(level_pressure, height, pressure, nothing, nothing)
    for _ in range(6):  # temperature depends on height, and height on temperature
        middle = (air.height[1:] + air.height[:-1]) / 2
        temperature, humidity = (
            marine * np.interp(middle, _SEA[0], _SEA[row])
            + (1 - marine) * np.interp(middle, _LAND[0], _LAND[row])
            for row in (1, 2)
        )
        vapour = humidity * saturation_mixing_ratio(pressure, temperature)
        air = air._replace(temperature=temperature, vapour=vapour)
        air = with_hydrostatic_height(air, terrain)
    return air


def santa_ana(marine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Wind to the east and to the north at 10 m: off the land, and weaker over the sea. [m s-1]

    Parameters
    ----------
    marine
        Weight of the air at sea (y, x), 0 to 1. [-]
    """
    speed = _WIND_INLAND + (_WIND_AT_SEA - _WIND_INLAND) * marine
    return -speed * INLAND[0], -speed * INLAND[1]


def saturation_mixing_ratio(pressure: np.ndarray, temperature: np.ndarray) -> np.ndarray:
    """Water vapour that saturates air, over water (Bolton 1980). [Pa], [K] -> [kg kg-1]"""
    celsius = temperature - FREEZING
    saturation = 611.2 * np.exp(17.67 * celsius / (celsius + 243.5))
    return _VAPOUR_RATIO * saturation / (pressure - saturation)


def with_hydrostatic_height(air: Air, terrain: np.ndarray, water: np.ndarray | float = 0.0) -> Air:
    """Return `air` with heights such that each layer weighs what pressure says it does.

    Parameters
    ----------
    air
        Columns of air, whose heights are not read.
    terrain
        Height of the ground (y, x). [m]
    water
        Mass of cloud water per mass of dry air (layer, y, x). [kg kg-1]
    """
    density = air.dry_density * (1 + air.vapour + water)
    thickness = -np.diff(air.level_pressure, axis=0) / (GRAVITY * density)
    height = terrain + np.concatenate([np.zeros((1, *terrain.shape)), np.cumsum(thickness, axis=0)])
    return air._replace(height=height)
