"""Kinds of a result's pixels: with cloud or without, over open water or over land."""

import numpy as np
import xarray as xr

from ..nomenclature import HYDROMETEORS
from ..radiance import THERMAL
from ..scene import classes_of

CLOUD = 0.01
"""Optical depth of all hydrometeors from which a pixel is cloudy: less does not show. [-]"""

EITHER = "water or land"
"""Kind of a ground of which a result does not tell what it is."""

NOT_TOLD = (
    "Where the ground has one albedo in all bands it may be water or land: land or snow of the "
    "result has such an albedo, too, as by --land-albedo; --ocean-wind would tell them apart."
)
"""What to say of `EITHER`."""

_SAME = 1e-6  # of albedos in single precision [-]


def cloud_depth(image: xr.Dataset, band: str) -> np.ndarray:
    """Optical depth of all hydrometeors in a band (y, x). [-]"""
    return np.sum([image[name].sel(band=band).values for name in depths_of(image)], axis=0)


def depths_of(image: xr.Dataset) -> list[str]:
    """Names of the optical depths of all hydrometeors, also where layers were not kept."""
    there = [name for name in HYDROMETEORS if f"{name}_optical_depth" in image]
    classes = dict.fromkeys(["liquid", *classes_of(image), *there])
    return [f"{name}_optical_depth" for name in classes]


def even_ground(image: xr.Dataset) -> np.ndarray:
    """Whether the ground has one albedo in all bands of sunlight (y, x).

    In C07 every ground has an albedo of its own, one less its emissivity.
    """
    return np.ptp(_albedo(image), axis=0) < _SAME


def ground_kinds(image: xr.Dataset) -> dict[str, np.ndarray]:
    """Pixels (y, x) over ``water`` and over ``land``, or over `EITHER`, by these names.

    Where the result has ``water_share`` (water is rough by a wind), water is what is open water by
    more than half. Elsewhere water is told by its albedo, one number for all bands and pixels,
    while that of land in a map differs between bands, and so does that of ice on water, which
    counts as land. Where land can have one albedo in all bands, too, a pixel that does is
    ``water or land``: where some was filled in (``last_resort_albedo_count``), and where there is
    more than one such albedo, as of snow that is given by a number.
    """
    if "water_share" in image:
        water = image["water_share"].values > 0.5
        return {"water": water, "land": ~water}
    even = even_ground(image)
    of_even = _albedo(image)[0][even]
    filled = int(image.attrs.get("last_resort_albedo_count", 0)) > 0
    told = not filled and (not of_even.size or np.ptp(of_even) < _SAME)
    return {"water" if told else EITHER: even, "land": ~even}


def _albedo(image: xr.Dataset) -> np.ndarray:
    """In bands of sunlight (band, y, x). [-]"""
    solar = [band for band in image["band"].values.tolist() if band not in THERMAL]
    return image["surface_albedo"].sel(band=solar).transpose("band", "y", "x").values
