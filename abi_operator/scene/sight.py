"""Whether a satellite sees a scene, and which one would."""

import numpy as np
import xarray as xr

from ..files import InputError
from .angles import SATELLITE_LONGITUDE, view_zenith

# Latitudes beyond which no satellite above the equator is above the horizon. [degree]
_HIGHEST_LATITUDE = 81.3


def check_sight(
    place: xr.Dataset, satellite: str, satellite_longitude: float | None = None
) -> None:
    """Raise `InputError` where no column of a scene is in the satellite's sight.

    Parameters
    ----------
    place
        With ``latitude`` and ``longitude`` (y, x). [degree]
    satellite, satellite_longitude
        Name of the satellite, and where it stands if not at its `SATELLITE_LONGITUDE`. [degree]
    """
    longitude = (
        SATELLITE_LONGITUDE[satellite]
        if satellite_longitude is None
        else float(satellite_longitude)
    )
    zenith = _zenith(place, longitude)
    if (zenith < 90).any():
        return
    others = [
        name for name, there in SATELLITE_LONGITUDE.items() if (_zenith(place, there) < 90).all()
    ]
    best = _middle(place["longitude"].values)
    advice = [f"--satellite {' or '.join(others)}"] if others else []
    if (_zenith(place, best) < 90).any():
        advice.append(f"--satellite-longitude {best:.0f}")
    found = (
        f"give {', or '.join(advice)}, from where it is in sight"
        if advice
        else f"no satellite above the equator sees latitudes beyond {_HIGHEST_LATITUDE} degrees"
    )
    raise InputError(
        f"the whole scene ({_range(place, 'latitude')}, {_range(place, 'longitude')}) is out of "
        f"sight of {satellite} at longitude {longitude:g}, where the zenith angle of the view is "
        f"{zenith.min():.0f} degrees or more and has to be below 90; {found}."
    )


def _zenith(place: xr.Dataset, satellite_longitude: float) -> np.ndarray:
    return view_zenith(place["latitude"].values, place["longitude"].values, satellite_longitude)


def _middle(longitude: np.ndarray) -> float:
    """Mean of longitudes, also across the date line, -180 to 180. [degree]"""
    turned = np.exp(1j * np.radians(longitude)).mean()
    return float(np.round(np.degrees(np.angle(turned))))


def _range(place: xr.Dataset, name: str) -> str:
    values = place[name].values
    return f"{name} {values.min():.1f} to {values.max():.1f}"
