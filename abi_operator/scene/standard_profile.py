"""Temperature, vapour and ozone of a standard atmosphere at the heights of any columns."""

from functools import cache
from typing import NamedTuple

import jax
import numpy as np

from ..standard_atmospheres import standard_atmosphere

# Step of the heights between which amounts are taken to be linear, to 2e-5 of a layer. [m]
_STEP = 20.0
_TOP = 120e3
# Poleward of it the midlatitude atmospheres are nearer than the tropical one, which stands for 15
# degrees as they do for 45. [degree]
_END_OF_TROPICS = 30.0


class StandardProfile(NamedTuple):
    """A standard atmosphere as functions of height.

    Parameters
    ----------
    name
        As in `standard_atmosphere`.
    height
        Rising from the ground. [m]
    temperature
        At these heights. [K]
    vapour_below, ozone_below
        What lies between the ground and these heights. [kg m-2], [DU]
    carbon_dioxide, methane, nitrous_oxide
        Mole fractions. [-]
    """

    name: str
    height: np.ndarray
    temperature: np.ndarray
    vapour_below: np.ndarray
    ozone_below: np.ndarray
    carbon_dioxide: float
    methane: float
    nitrous_oxide: float

    def temperature_at(self, height: np.ndarray) -> np.ndarray:
        """Temperature at some heights. [m] -> [K]"""
        return np.interp(height, self.height, self.temperature)

    def vapour_between(self, height: np.ndarray) -> np.ndarray:
        """Vapour in the layers between levels (level, ...), top first. [m] -> [kg m-2]"""
        return -np.diff(np.interp(height, self.height, self.vapour_below), axis=0)

    def ozone_between(self, height: np.ndarray) -> np.ndarray:
        """Ozone in the layers between levels (level, ...), top first. [m] -> [DU]"""
        return -np.diff(np.interp(height, self.height, self.ozone_below), axis=0)


@cache
def standard_profile(name: str) -> StandardProfile:
    """Tabulate a standard atmosphere every 20 m.

    Parameters
    ----------
    name
        As in `standard_atmosphere`.
    """
    height = np.arange(0.0, _TOP + _STEP, _STEP)
    with jax.enable_x64(True):
        air = standard_atmosphere(name, height[::-1])
        gases = air.gases
        assert gases is not None and air.temperature is not None
        vapour, ozone = (np.asarray(x)[::-1] for x in (gases.vapour, gases.ozone))
        return StandardProfile(
            name,
            height,
            np.asarray(air.temperature)[::-1],
            np.concatenate([[0.0], np.cumsum(vapour)]),
            np.concatenate([[0.0], np.cumsum(ozone)]),
            float(gases.carbon_dioxide),
            float(gases.methane),
            float(gases.nitrous_oxide),
        )


def nearest_standard_atmosphere(latitude: np.ndarray, time: np.datetime64 | np.ndarray) -> str:
    """Name of the standard atmosphere that is nearest to a scene by latitude and season.

    Tropical up to 30 degrees; beyond, midlatitude summer from April to September and midlatitude
    winter in the other months, and the reverse in the south.

    Parameters
    ----------
    latitude
        Of the columns. [degree]
    time
        Of the scene.
    """
    middle = float((np.min(latitude) + np.max(latitude)) / 2)
    if abs(middle) <= _END_OF_TROPICS:
        return "tropical"
    month = int(np.asarray(time, "datetime64[M]").astype(int) % 12) + 1
    northern_summer = 4 <= month <= 9
    return "midlatitude_summer" if northern_summer == (middle > 0) else "midlatitude_winter"
