"""Albedo of the ground under a block of columns."""

import warnings

import numpy as np
import xarray as xr

from ..files import InputError

# Further from a date of the albedo file, a scene's albedo is warned of. [day] (the length of the
# period over which MODIS observations are inverted)
_FARTHEST = 16


def surface_albedo(
    model: xr.Dataset,
    bands: tuple[str, ...],
    albedo: xr.Dataset | None,
    ocean_albedo: float | None,
) -> tuple[np.ndarray, str]:
    """Albedo by band (band, y, x), NaN where there is none [-]; and where it comes from.

    The cell of the albedo file that is nearest in time and then in space; over water of the
    model's land mask `ocean_albedo`. Without a land mask, `ocean_albedo` fills what the file
    leaves missing in all of the bands.

    Parameters
    ----------
    model
        A model Dataset.
    bands
        Bands to look up.
    albedo
        ``surface_albedo`` (band, time, lat, lon), as `files.read_mcd43a1` returns. [-]
    ocean_albedo
        One albedo for all bands. [-]

    Raises
    ------
    InputError
        Where neither albedo is given, or the file does not reach as far as the columns that need
        it.
    """
    check_ground(model, albedo, ocean_albedo)
    shape = (len(bands), model.sizes["y"], model.sizes["x"])
    values, source = np.full(shape, np.nan), []
    if albedo is not None:
        nearest = _nearest_time(albedo, model["time"].values)
        values = _nearest_cell(nearest.sel(band=list(bands)), model)
        source.append(f"nearest cell of the albedo file's {_date(nearest)}")
    if ocean_albedo is not None:
        water = _water(model)
        missing = np.isnan(values).all(axis=0)
        values = np.where(missing if water is None else water, ocean_albedo, values)
        place = "water" if water is not None else "all columns" if albedo is None else "the rest"
        source.append(f"{place} {ocean_albedo:g}")
    return values, ", ".join(source)


def check_ground(
    coordinates: xr.Dataset, albedo: xr.Dataset | None, ocean_albedo: float | None
) -> None:
    """Raise `InputError` where there is no albedo, or the file's cells do not cover the scene.

    Parameters
    ----------
    coordinates
        ``latitude`` and ``longitude`` (y, x) [degree] and perhaps ``land_mask``, as in a model
        Dataset.
    albedo
        As `files.read_mcd43a1` returns. [-]
    ocean_albedo
        If given, water of the land mask needs no file. [-]
    """
    if albedo is None and ocean_albedo is None:
        raise InputError(
            "the ground has no albedo; name an albedo file, an albedo of the ocean, or both."
        )
    if albedo is None:
        return
    water = _water(coordinates) if ocean_albedo is not None else None
    needed = np.full(coordinates["latitude"].shape, True) if water is None else ~water
    if not needed.any():
        return
    latitude = coordinates["latitude"].values[needed]
    longitude = _wrapped(coordinates["longitude"].values, albedo)[needed]
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


def _water(dataset: xr.Dataset) -> np.ndarray | None:
    """True over water (y, x); None without a land mask."""
    return dataset["land_mask"].values == 0 if "land_mask" in dataset else None


def _nearest_time(albedo: xr.Dataset, time: np.datetime64 | np.ndarray) -> xr.DataArray:
    """Albedo at the date that is nearest to `time`; warn where that is far away."""
    away = np.abs(albedo["time"].values - time) / np.timedelta64(1, "D")
    nearest = albedo["surface_albedo"].isel(time=int(np.argmin(away)))
    if away.min() > _FARTHEST:
        warnings.warn(
            f"the nearest date of the albedo file, {_date(nearest)}, is {away.min():.0f} days away "
            "from the scene.",
            UserWarning,
            stacklevel=2,
        )
    return nearest


def _date(albedo: xr.DataArray) -> str:
    return str(albedo["time"].values.astype("datetime64[D]"))


def _nearest_cell(albedo: xr.DataArray, model: xr.Dataset) -> np.ndarray:
    """Albedo (band, y, x) of the cells whose centres are nearest to the columns."""
    latitude = xr.DataArray(model["latitude"].values, dims=("y", "x"))
    longitude = xr.DataArray(_wrapped(model["longitude"].values, albedo), dims=("y", "x"))
    nearest = albedo.sel(lat=latitude, lon=longitude, method="nearest")
    return nearest.transpose("band", "y", "x").values


def _wrapped(longitude: np.ndarray, albedo: xr.Dataset | xr.DataArray) -> np.ndarray:
    """The same longitudes, counted so that they lie about those of the file. [degree]"""
    centre = albedo["lon"].values.mean()
    return (longitude - centre + 180) % 360 - 180 + centre


def _edges(axis: np.ndarray) -> tuple[float, float]:
    """Outer edges of the first and last cell along an axis. [degree]"""
    half = abs(np.diff(axis)).max() / 2 if len(axis) > 1 else 0.0
    return axis.min() - half, axis.max() + half
