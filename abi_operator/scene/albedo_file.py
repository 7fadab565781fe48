"""Albedo of columns from that of a map, MODIS's: which date, and which of its cells."""

import warnings

import numpy as np
import xarray as xr

from ..files import InputError
from ..files.cell_bounds import cell_bounds
from ..files.nearest_date import nearest_date
from .cell_means import CellMeans, cell_means

# Further from a date of the albedo file, a scene's albedo is warned of. [day] (the length of the
# period over which MODIS observations are inverted)
_FARTHEST = 16

_BOUNDS = "latitude_bounds", "longitude_bounds"


def albedo_of_file(
    model: xr.Dataset, bands: tuple[str, ...], albedo: xr.Dataset, needed: np.ndarray
) -> tuple[np.ndarray, list[str], dict[str, int]]:
    """Albedo (band, y, x) [-]; where it comes from; and in how many columns from what.

    It is that of the scene's day, or else of the nearest. A column whose cell is larger than the
    file's gets the mean of those that have a value in a band, of all whose centres lie in it, and
    none where less than `LEAST_SHARE` have one. In smaller cells, and where nothing tells how large
    they are (a single row or line of columns), it is that of the nearest cell. Columns that the
    file does not reach have none.

    Parameters
    ----------
    model
        A model Dataset. Where it has no ``latitude_bounds`` and ``longitude_bounds`` (y, x,
        corner), edges of cells lie midway between its columns (`files.cell_bounds`).
    bands
        Bands to look up.
    albedo
        As `files.read_mcd43a1` returns.
    needed
        True for columns that take their albedo from the file (y, x); only they are counted.
    """
    of_day = _nearest_time(albedo, model["time"].values)
    if bands != tuple(of_day["band"].values):  # it would be a copy
        of_day = of_day.sel(band=list(bands))
    beside = ~_reached(model, albedo)
    values, date = np.where(beside, np.nan, _nearest_cell(of_day, model)), _date(of_day)
    means = _means(of_day, model)
    if means is None:
        return (
            values,
            [f"nearest cell of the albedo file's {date}"],
            {"nearest_albedo_count": int(needed.sum())},
        )
    larger = means.larger & ~beside
    averaged, single = larger & needed, ~larger & needed
    sources = []
    if averaged.any():
        sources.append(f"mean of the albedo file's {date} over each column's cell")
    if single.any() or not averaged.any():
        sources.append(f"nearest cell of the albedo file's {date}")
    counts = {
        "mean_albedo_count": int(averaged.sum()),
        "incomplete_mean_albedo_count": int((averaged & (means.num_missing > 0)).sum()),
        "nearest_albedo_count": int(single.sum()),
    }
    return np.where(larger, means.mean, values), sources, counts


def _reached(model: xr.Dataset, albedo: xr.Dataset) -> np.ndarray:
    """True for columns in the cells of a file (y, x)."""
    south, north = _edges(albedo["lat"].values)
    west, east = _edges(albedo["lon"].values)
    latitude = model["latitude"].values
    longitude = _about_the_file(model["longitude"].values, albedo)
    return (latitude >= south) & (latitude <= north) & (longitude >= west) & (longitude <= east)


def check_extent(coordinates: xr.Dataset, albedo: xr.Dataset, needed: np.ndarray) -> None:
    """Raise `InputError` where a file does not reach as far as the columns that need it.

    Parameters
    ----------
    coordinates
        ``latitude`` and ``longitude`` (y, x). [degree]
    albedo
        As `files.read_mcd43a1` returns.
    needed
        True where a column needs it (y, x), in one at least.
    """
    latitude = coordinates["latitude"].values[needed]
    longitude = _about_the_file(coordinates["longitude"].values, albedo)[needed]
    extents = {}
    for axis, values in (("lat", latitude), ("lon", longitude)):
        lowest, highest = _edges(albedo[axis].values)
        inside = values.min() >= lowest and values.max() <= highest
        extents[axis] = (values.min(), values.max(), lowest, highest, inside)
    if not all(inside for *_, inside in extents.values()):
        south, north, file_south, file_north, _ = extents["lat"]
        west, east, file_west, file_east, _ = extents["lon"]
        raise InputError(
            f"the scene extends from {south:.2f} to {north:.2f} N and {west:.2f} to {east:.2f} E, "
            f"but the albedo file only from {file_south:.2f} to {file_north:.2f} N and "
            f"{file_west:.2f} to {file_east:.2f} E; request albedo for the whole scene."
        )


def _nearest_time(albedo: xr.Dataset, time: np.datetime64 | np.ndarray) -> xr.DataArray:
    """Albedo of the day of `time`, or else of the nearest; warn where that is far away."""
    best, away = nearest_date(albedo["time"].values, time)
    nearest = albedo["surface_albedo"].isel(time=best)
    if away > _FARTHEST:
        warnings.warn(
            f"the nearest date of the albedo file, {_date(nearest)}, is {away:.0f} days away "
            "from the scene.",
            UserWarning,
            stacklevel=3,
        )
    return nearest


def _date(albedo: xr.DataArray) -> str:
    return str(albedo["time"].values.astype("datetime64[D]"))


def _nearest_cell(albedo: xr.DataArray, model: xr.Dataset) -> np.ndarray:
    """Albedo (band, y, x) of the cells whose centres are nearest to the columns."""
    latitude = xr.DataArray(model["latitude"].values, dims=("y", "x"))
    longitude = _about_the_file(model["longitude"].values, albedo)
    nearest = albedo.sel(
        lat=latitude, lon=xr.DataArray(longitude, dims=("y", "x")), method="nearest"
    )
    return nearest.transpose("band", "y", "x").values


def _means(albedo: xr.DataArray, model: xr.Dataset) -> CellMeans | None:
    """Means over the columns' cells; None where their size is not known."""
    centre = model["longitude"].values
    if min(albedo.sizes["lat"], albedo.sizes["lon"]) < 2:
        return None
    if all(name in model.variables for name in _BOUNDS):
        latitude, longitude = (model[name].values for name in _BOUNDS)
    elif min(centre.shape) > 1:
        latitude, longitude = cell_bounds(model["latitude"].values, centre)
    else:
        return None
    return cell_means(
        albedo, latitude, _near(longitude, _about_the_file(centre, albedo)[..., None])
    )


def _about_the_file(longitude: np.ndarray, albedo: xr.Dataset | xr.DataArray) -> np.ndarray:
    """The same longitudes, counted so that they lie about those of the file. [degree]"""
    return _near(longitude, albedo["lon"].values.mean())


def _near(longitude: np.ndarray, other: np.ndarray | float) -> np.ndarray:
    """The same longitudes, counted so as to lie within half a turn of others. [degree]"""
    return longitude + 360 * np.rint((other - longitude) / 360)


def _edges(axis: np.ndarray) -> tuple[float, float]:
    """Outer edges of the first and last cell along an axis. [degree]"""
    half = abs(np.diff(axis)).max() / 2 if len(axis) > 1 else 0.0
    return axis.min() - half, axis.max() + half
