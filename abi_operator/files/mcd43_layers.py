"""Layers of a file of MCD43A1 in NetCDF: kernel weights, their quality, the grid and the dates."""

import warnings
from typing import NamedTuple

import netCDF4
import numpy as np
import xarray as xr

from ..nomenclature import MODEL
from ..surface.ross_li import WHITE_SKY
from .errors import InputError
from .nearest_date import nearest_date
from .netcdf import (
    FilePath,
    cf_attributes,
    load,
    load_finite,
    require_dims,
    require_variables,
)
from .plausible import check_values, plausible

VARIABLE_MAP = {
    "BRDF_Albedo_Parameters_": "surface_albedo",
    "BRDF_Albedo_Band_Mandatory_Quality_": "albedo_quality",
}
"""Beginning of a variable's name in the file, before the MODIS band: ours."""

ADVICE = (
    "request MCD43A1 from AppEEARS as an area sample in NetCDF-4 with the projection Geographic"
)
"""What to give in place of another file."""

PARAMETERS, QUALITY = VARIABLE_MAP
GRID = ("time", "lat", "lon")
NO_INVERSION = 255
"""Quality where there are no weights."""

# Of dates: before the first no MODIS flew, and from the last on no number of days is meant.
_FIRST_YEAR, _YEARS_END = 2000, 2200


class Layers(NamedTuple):
    """What a file has of some bands of MODIS.

    Parameters
    ----------
    weights
        Kernel weights (time, lat, lon, kernel), NaN where there are none, by band. [-]
    quality
        Mandatory quality (time, lat, lon) of those bands that have one.
    coordinates
        ``time``, ``lat`` and ``lon``, for a Dataset.
    num_invalid
        How many weights were outside the file's valid range.
    """

    weights: dict[str, np.ndarray]
    quality: dict[str, np.ndarray]
    coordinates: dict
    num_invalid: int


def read_layers(
    file: xr.Dataset, names: tuple[str, ...], path: FilePath, times: np.ndarray | None = None
) -> Layers:
    """Read what bands of MODIS have on the dates that `times` need, or on all.

    Dates are in the order of the file.
    """
    advice = "request the area from AppEEARS in NetCDF format"
    require_variables(file, ["time", "lat", "lon"], path, advice)
    coordinates: dict = {name: _axis(file, name, path) for name in ("lat", "lon")}
    dates = _times(file, path)
    if times is not None:
        chosen = sorted({nearest_date(dates, time)[0] for time in times})
        file, dates = file.isel(time=chosen), dates[chosen]
    coordinates["time"] = ("time", dates, {"standard_name": "time"})
    weights, quality, num_invalid = {}, {}, 0
    for name in names:
        weights[name], invalid = _kernel_weights(file, name, path)
        if QUALITY + name in file:
            quality[name] = _quality(file, name, path)
        num_invalid += invalid
    return Layers(weights, quality, coordinates, num_invalid)


def check_grid(file: xr.Dataset, path: FilePath) -> None:
    """Refuse a grid that is regular in metres, as that of MODIS itself is, not in degrees."""
    if "lat" in file.variables and file["lat"].dims == ("lat",):
        return
    mappings = (array.attrs.get("grid_mapping_name") for array in file.variables.values())
    projections = [str(name) for name in mappings if name is not None]
    if not projections and {str(dim).lower() for dim in file.dims} >= {"xdim", "ydim"}:
        projections = ["sinusoidal"]
    if projections and projections[0] != "latitude_longitude":
        raise InputError(f"{path} is in {projections[0]} projection; {ADVICE}.")


def _kernel_weights(file: xr.Dataset, name: str, path: FilePath) -> tuple[np.ndarray, int]:
    """Kernel weights (time, lat, lon, kernel) of a MODIS band, and how many were out of range."""
    parameters = file[PARAMETERS + name]
    require_dims(parameters, (*GRID, "Num_Parameters"), path)
    if parameters.sizes["Num_Parameters"] != len(WHITE_SKY):
        raise InputError(
            f"{parameters.name} in {path} has {parameters.sizes['Num_Parameters']} kernel weights "
            f"where {len(WHITE_SKY)} are expected; request MCD43A1 from AppEEARS."
        )
    packed = np.issubdtype(parameters.encoding.get("dtype", np.float64), np.integer)
    if packed and "scale_factor" not in parameters.encoding:
        raise InputError(
            f"{parameters.name} in {path} has no scale_factor; give the file as AppEEARS wrote it."
        )
    values = load(parameters, path)
    invalid = _outside_valid_range(values, parameters)
    values[invalid] = np.nan
    return values, int(invalid.sum())


def _outside_valid_range(values: np.ndarray, array: xr.DataArray) -> np.ndarray:
    """Where unpacked values lie outside the range that the file states for packed ones."""
    scale = float(array.encoding.get("scale_factor", 1.0))
    offset = float(array.encoding.get("add_offset", 0.0))
    tolerance = 0.5 * scale  # half a count: packed values are whole
    lowest = float(array.attrs.get("valid_min", -np.inf)) * scale + offset - tolerance
    highest = float(array.attrs.get("valid_max", np.inf)) * scale + offset + tolerance
    return (values < lowest) | (values > highest)


def _quality(file: xr.Dataset, name: str, path: FilePath) -> np.ndarray:
    """Mandatory quality of a MODIS band, 255 where there is none."""
    quality = file[QUALITY + name]
    require_dims(quality, GRID, path)
    return np.nan_to_num(load(quality, path), nan=NO_INVERSION).astype(np.uint8)


def _axis(file: xr.Dataset, name: str, path: FilePath) -> xr.DataArray:
    """Latitude or longitude of the grid: finite and monotonic."""
    axis = file[name]
    require_dims(axis, (name,), path)
    values = load(axis, path)
    steps = np.diff(values)
    if not np.isfinite(values).all() or not ((steps > 0).all() or (steps < 0).all()):
        raise InputError(f"{name} in {path} is not monotonic; give the file as AppEEARS wrote it.")
    ours = {"lat": "latitude", "lon": "longitude"}[name]
    units = MODEL[ours].units
    check_values(
        values, plausible(ours), units, f"{name} in {path}", lambda index: f"{name}={index[0]}"
    )
    return xr.DataArray(values, dims=(name,), attrs=cf_attributes(ours))


def _times(file: xr.Dataset, path: FilePath) -> np.ndarray:
    """Dates of a file; AppEEARS counts days in the julian calendar and means the usual one."""
    time = file["time"]
    require_dims(time, ("time",), path)
    numbers = load_finite(time, path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of years that are refused below
            dates = netCDF4.num2date(
                numbers, time.attrs["units"], time.attrs.get("calendar", "standard")
            )
    except (KeyError, ValueError, OverflowError) as error:
        raise InputError(
            f"time in {path} cannot be read as dates ({error}); give the file as AppEEARS wrote it."
        ) from error
    for date in np.asarray(dates, object):
        if not _FIRST_YEAR <= date.year < _YEARS_END:
            raise InputError(
                f"time in {path} has the year {date.year}, and MODIS flies since {_FIRST_YEAR}; "
                "give the file as AppEEARS wrote it."
            )
    texts = [
        f"{date.year:04d}-{date.month:02d}-{date.day:02d}" for date in np.asarray(dates, object)
    ]
    return np.array(texts, dtype="datetime64[ns]")
