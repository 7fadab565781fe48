"""Albedo of the ground under a block of columns."""

import warnings

import numpy as np
import xarray as xr

from ..files import InputError
from ..radiance import THERMAL
from .emissivity import Emissivity, check_emissivity, thermal_albedo

# Further from a date of the albedo file, a scene's albedo is warned of. [day] (the length of the
# period over which MODIS observations are inverted)
_FARTHEST = 16


def surface_albedo(
    model: xr.Dataset,
    bands: tuple[str, ...],
    albedo: xr.Dataset | None,
    ocean_albedo: float | None,
    emissivity: Emissivity | None = None,
) -> tuple[np.ndarray, dict[str, str]]:
    """Albedo by band (band, y, x), NaN where there is none [-]; and attributes that say whence.

    In C07 it is 1 - `emissivity` (`thermal_albedo`). In the other bands it is that of the cell of
    the albedo file that is nearest in time, the day's own first, and then in space; over water of
    the model's land mask `ocean_albedo`. Without a land mask, `ocean_albedo` fills what the file
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
        One albedo for all bands but C07. [-]
    emissivity
        Of the ground in C07; see `thermal_albedo`.

    Raises
    ------
    InputError
        Where an albedo is missing, or the file does not reach as far as the columns that need it.
    """
    solar = tuple(band for band in bands if band not in THERMAL)
    check_ground(model, bands, albedo, ocean_albedo, emissivity)
    attributes, found = {}, {}
    if solar:
        values, attributes["surface_albedo_source"] = _solar_albedo(
            model, solar, albedo, ocean_albedo
        )
        found |= dict(zip(solar, values, strict=True))
    for band in bands:
        if band in THERMAL and emissivity is not None:
            found[band], attributes["emissivity_source"] = thermal_albedo(model, emissivity)
    return np.stack([found[band] for band in bands]), attributes


def _solar_albedo(
    model: xr.Dataset,
    bands: tuple[str, ...],
    albedo: xr.Dataset | None,
    ocean_albedo: float | None,
) -> tuple[np.ndarray, str]:
    """Albedo in bands of sunlight alone (band, y, x), and where it comes from."""
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
    coordinates: xr.Dataset,
    bands: tuple[str, ...],
    albedo: xr.Dataset | None,
    ocean_albedo: float | None,
    emissivity: Emissivity | None = None,
) -> None:
    """Raise `InputError` where there is no albedo, or the file's cells do not cover the scene.

    Parameters
    ----------
    coordinates
        ``latitude`` and ``longitude`` (y, x) [degree] and perhaps ``land_mask``, as in a model
        Dataset.
    bands
        Bands to be simulated.
    albedo
        As `files.read_mcd43a1` returns. [-]
    ocean_albedo
        If given, water of the land mask needs no file. [-]
    emissivity
        Of the ground in C07, needed there.
    """
    if set(bands) & set(THERMAL):
        check_emissivity(emissivity)
    if set(bands) <= set(THERMAL):
        return
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
    """Albedo of the day of `time`, or else of the nearest; warn where that is far away.

    A date of MODIS's albedo is a day, in the middle of the 16 from which it is made, and so not the
    midnight at which it begins. Of two days that are equally far the one nearer to `time` is taken.
    """
    days = albedo["time"].values.astype("datetime64[D]")
    away = np.abs(days - np.asarray(time).astype("datetime64[D]")) / np.timedelta64(1, "D")
    noons = days.astype("datetime64[ns]") + np.timedelta64(12, "h")
    best = np.lexsort((np.abs(noons - time), away))[0]
    nearest = albedo["surface_albedo"].isel(time=int(best))
    if away[best] > _FARTHEST:
        warnings.warn(
            f"the nearest date of the albedo file, {_date(nearest)}, is {away[best]:.0f} days away "
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
