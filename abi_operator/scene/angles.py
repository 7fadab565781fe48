"""Where the sun and a geostationary satellite stand, seen from each column.

Positions are pyorbital's. Only `pyorbital.astronomy` is imported of it: `pyorbital.orbital`,
which has look angles, imports SciPy's optimisation, a fifth of what a command needs to start.
"""

from typing import NamedTuple

import numpy as np
from pyorbital.astronomy import (
    get_alt_az,
    gmst,
    observer_position,
    sun_earth_distance_correction,
)

from ..constants import SATELLITE_HEIGHT
from ..quality import flags_from

SATELLITE_LONGITUDE: dict[str, float] = {
    "GOES-16": -75.2,
    "GOES-17": -137.2,
    "GOES-18": -137.0,
    "GOES-19": -75.2,
}
"""Longitude above which each satellite stands or stood in service. [degree] (NOAA OSPO)"""

_ANY_TIME = np.datetime64("2000-01-01T12:00", "ns")


class Angles(NamedTuple):
    """Directions of the sun and the satellite (y, x). [degree]

    Parameters
    ----------
    solar_zenith, view_zenith
        Angles from the local vertical.
    relative_azimuth
        Azimuth between satellite and sun, 0 to 180; 0 where they stand on the same side.
    """

    solar_zenith: np.ndarray
    view_zenith: np.ndarray
    relative_azimuth: np.ndarray


def find_angles(
    time: np.datetime64 | np.ndarray,
    latitude: np.ndarray,
    longitude: np.ndarray,
    satellite_longitude: float,
) -> Angles:
    """Directions of the sun and the satellite by pyorbital, without refraction.

    Parameters
    ----------
    time
        One time, UTC.
    latitude, longitude
        Of the columns. [degree]
    satellite_longitude
        Longitude above which the satellite stands still, at 35786 km. [degree]
    """
    altitude, azimuth = get_alt_az(time, longitude, latitude)
    view_zenith, satellite_azimuth = _look(time, latitude, longitude, satellite_longitude)
    apart = np.abs(np.degrees(azimuth) - satellite_azimuth) % 360
    return Angles(90 - np.degrees(altitude), view_zenith, np.minimum(apart, 360 - apart))


def view_zenith(
    latitude: np.ndarray, longitude: np.ndarray, satellite_longitude: float
) -> np.ndarray:
    """Zenith angle under which the satellite is seen, which is the same at all times. [degree]

    Parameters
    ----------
    latitude, longitude, satellite_longitude
        As of `find_angles`. [degree]
    """
    return _look(_ANY_TIME, latitude, longitude, satellite_longitude)[0]


def _look(
    time: np.datetime64 | np.ndarray,
    latitude: np.ndarray,
    longitude: np.ndarray,
    satellite_longitude: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Zenith angle of a satellite above the equator, and its azimuth, clockwise from north.

    Parameters
    ----------
    time
        One time, UTC, at which all positions are taken; the angles do not depend on it.
    latitude, longitude, satellite_longitude
        As of `find_angles`; zenith is normal to the ellipsoid. [degree]
    """
    ground, _ = observer_position(time, longitude, latitude, 0.0)
    satellite, _ = observer_position(time, satellite_longitude, 0.0, SATELLITE_HEIGHT / 1e3)
    x, y, z = (there - here for there, here in zip(satellite, ground, strict=True))
    phi, sidereal = np.radians(latitude), gmst(time) + np.radians(longitude)
    outward = np.cos(sidereal) * x + np.sin(sidereal) * y
    east = np.cos(sidereal) * y - np.sin(sidereal) * x
    up = np.cos(phi) * outward + np.sin(phi) * z
    north = np.cos(phi) * z - np.sin(phi) * outward
    zenith = np.arctan2(np.hypot(east, north), up)
    return np.degrees(zenith), np.degrees(np.arctan2(east, north))


def sun_distance(time: np.datetime64 | np.ndarray) -> float:
    """Distance of the sun at a time, UTC, by pyorbital. [AU]"""
    return float(sun_earth_distance_correction(np.asarray(time, "datetime64[ns]")))


def angle_flags(angles: Angles) -> np.ndarray:
    """Bits of `nomenclature.QUALITY_FLAGS` that the directions set (y, x), uint8 (`flags_from`).

    ``grazing_sun`` is set by day and ``grazing_view`` where the satellite is in sight: neither
    comes with ``night`` or ``out_of_sight``.
    """
    return flags_from(np.radians(angles.solar_zenith), np.radians(angles.view_zenith))
