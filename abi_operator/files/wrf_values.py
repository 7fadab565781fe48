"""What is checked of a block of WRF's values, and how the place of a wrong one is called."""

import numpy as np
import xarray as xr

from ..nomenclature import MODEL
from .netcdf import FilePath
from .plausible import Range, check_values, check_written, plausible
from .units import check_units

DIMENSIONS = {
    "bottom_top": "layer",
    "bottom_top_stag": "level",
    "south_north": "y",
    "west_east": "x",
}
"""WRF's name of a dimension: ours."""

SUMS = {
    "layer_pressure": "P + PB",
    "layer_temperature": "the temperature by T, P and PB",
    "height": "(PH + PHB) / 9.81",
}
"""Ours that are made of several of WRF's: how to call what is made."""

# Units of what is not read in ours, and plausible values of what is not in the range of ours.
_UNITS = {"PH": "m2 s-2", "PHB": "m2 s-2"}
_RANGES = {"XLAND": Range(1, 2)}


def check_stated_units(array: xr.DataArray, ours: str, path: FilePath) -> None:
    """Raise `InputError` where one of WRF's variables states other units than it should."""
    check_units(array, _UNITS.get(str(array.name), MODEL[ours].units), path)


def check_block(
    values: np.ndarray, ours: str, theirs: str, *, time: int, rows: slice, path: FilePath
) -> None:
    """Raise `InputError` for values that were never written or are not plausible.

    Of a part of one of `SUMS` it is only asked whether it was written.

    Parameters
    ----------
    values
        In our dimensions, top first.
    ours
        Our name of the variable.
    theirs
        WRF's, or the words of `SUMS`.
    time, rows, path
        What was read: index of the time, rows counted from the south, and the file.
    """

    def where(index: tuple[int, ...]) -> str:
        place = dict(zip(MODEL[ours].dims, index, strict=True))
        place["y"] += rows.start or 0
        for dim in {"layer", "level"} & place.keys():
            place[dim] = len(values) - 1 - place[dim]
        words = [f"{name}={place[dim]}" for name, dim in DIMENSIONS.items() if dim in place]
        return ", ".join([f"Time={time}", *words])

    origin = f"{theirs} in {path}"
    check_written(values, origin, where)
    if ours not in SUMS or theirs == SUMS[ours]:
        check_values(values, _RANGES.get(theirs, plausible(ours)), MODEL[ours].units, origin, where)
