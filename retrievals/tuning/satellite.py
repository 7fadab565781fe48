"""Whether a scene is seen from where it was observed: another satellite has other angles."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from abi_operator.files import InputError
from abi_operator.scene import SATELLITE_LONGITUDE

LARGEST_DISTANCE = 1.0
"""How far apart in longitude two satellites may stand and be one: files have the nominal place,
some tenths of a degree from where it is. [degree]"""


def longitude_of_file(file: xr.Dataset) -> float | None:
    """Longitude beneath the satellite of a file with a grid of scan angles, None without. [degree]

    A longitude that is no number is left to who needs it as one.
    """
    if "goes_imager_projection" not in file.variables:
        return None
    origin = file["goes_imager_projection"].attrs.get("longitude_of_projection_origin")
    try:
        return None if origin is None else float(np.squeeze(origin))
    except (TypeError, ValueError):
        return None


def longitude_of_result(attributes: Mapping[Any, Any]) -> float | None:
    """Longitude of a result's satellite, by its attributes; None if they do not say. [degree]"""
    if "satellite_longitude" in attributes:
        return float(attributes["satellite_longitude"])
    return SATELLITE_LONGITUDE.get(str(attributes.get("satellite")))


def check_satellite(longitude: float | None, image: xr.Dataset, path: object) -> None:
    """Refuse what was observed from elsewhere than the scene is seen from.

    Parameters
    ----------
    longitude
        Of the satellite that observed, None where nobody says. [degree]
    image
        The scene.
    path
        The observation's file, for what is said of it.

    Raises
    ------
    InputError
        Where the satellites stand more than `LARGEST_DISTANCE` apart.
    """
    own = longitude_of_result(image.attrs)
    if own is None or longitude is None:
        return
    apart = abs((longitude - own + 180) % 360 - 180)
    if not apart <= LARGEST_DISTANCE:
        name = str(image.attrs.get("satellite", "its satellite"))
        raise InputError(
            f"{path} was observed from a satellite at longitude {longitude:g} and the scene is "
            f"seen from {name} at {own:g}, under other angles; simulate the scene for that "
            f"satellite, with --satellite or --satellite-longitude {longitude:g}."
        )
