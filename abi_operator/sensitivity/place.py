"""Where and when the maps of a study are."""

import xarray as xr

_KEPT = "latitude", "longitude", "time", "crs", "y", "x"


def with_place(study: xr.Dataset, image: xr.Dataset) -> xr.Dataset:
    """A study with the coordinates of the result that it is of, those that the result has.

    Its maps name the projection, where there is one.
    """
    study = study.assign_coords({x: image[x] for x in _KEPT if x in image.variables})
    if "time" in study.coords:
        study["time"].attrs["units_metadata"] = "leap_seconds: none"
    if "crs" in study.coords:
        for array in study.data_vars.values():
            if {"y", "x"} <= set(array.dims):
                array.attrs["grid_mapping"] = "crs"
    return study
