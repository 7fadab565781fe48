"""Through what layers a low sun shines on a scene: an attribute of scenarios and results."""

import numpy as np
import xarray as xr

from ..files import InputError
from ..sun_path import FLAT_ZENITH

SUN_PATHS = "spherical", "flat"
"""Layers of a sphere, the default of new scenarios, or flat ones."""


def sun_path_of(dataset: xr.Dataset) -> str:
    """Path of the sun's beam in a scenario or result: what its attribute ``sun_path`` says.

    Results that lack it are older than the attribute, and flat.

    Raises
    ------
    InputError
        Where the attribute is none of `SUN_PATHS`.
    """
    name = str(dataset.attrs.get("sun_path", "flat"))
    if name not in SUN_PATHS:
        raise InputError(f"sun path {name!r} is not known; choose from {', '.join(SUN_PATHS)}.")
    return name


def spherical_somewhere(dataset: xr.Dataset, solar_zenith: np.ndarray) -> bool:
    """Whether any sun shines on a different path than in flat layers, as `Geometry` takes it.

    Of a block without a low sun the program is that of flat layers, and so are its time and its
    values.

    Parameters
    ----------
    dataset
        A scenario or a result.
    solar_zenith
        Of its columns. [rad]
    """
    low = (solar_zenith > FLAT_ZENITH) & (solar_zenith < np.pi / 2)
    return sun_path_of(dataset) == "spherical" and bool(low.any())
