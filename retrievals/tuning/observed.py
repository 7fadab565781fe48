"""Observed reflectances, laid on the grid of a scene."""

from collections.abc import Sequence
from os import PathLike
from typing import Literal

import numpy as np
import xarray as xr

from abi_operator.bands import check_bands
from abi_operator.files import InputError, read_result
from abi_operator.files.netcdf import cf_attributes, open_netcdf

from ..images import REFLECTIVE
from ..observation import LARGEST_REFLECTANCE_FACTOR, imager_of
from .fixed_grid import nearest_on_axis, scan_angles
from .layouts import Found, Grid, found_in, is_result
from .placing import once_each, placed
from .satellite import check_satellite, longitude_of_file, longitude_of_result

Quantity = Literal["reflectance_factor", "brf"]
LARGEST_DELAY = np.timedelta64(30, "m")
"""How far apart in time scene and observation may be: the sun moves by 7.5 degrees meanwhile."""

SMALLEST_REFLECTANCE = -0.1
"""What noise and the space between counts leave of the dark: radiances of ABI reach down to 0.04
below 0, as reflectance factors. [-]"""

_TOLD = ("observed_variables", "regridding", "observed_time", "error_budget")
_TIMES = ("time_coverage_start", "time_coverage_end")


def read_observed(
    paths: Sequence[str | PathLike[str]],
    image: xr.Dataset,
    *,
    nearest_km: float | None = None,
    quantity: Quantity = "reflectance_factor",
) -> xr.Dataset:
    """Read what was observed of a scene; files are only read.

    Parameters
    ----------
    paths
        One file or several of other bands, in the layouts of `layouts`.
    image
        The scene's result, of one time.
    nearest_km
        How far the nearest observed pixel may be from one of the scene, which takes its value; None
        where the grids have to be the same. Of a grid of scan angles a place on the ground has the
        pixel that it is seen in, without this. An observed pixel counts once: of several of the
        scene that would have it the nearest does, and the others have none. [km]
    quantity
        What the numbers are where their names do not say (``C01``, ``reflectance_C01``, ``Band3``):
        ``"reflectance_factor"`` as in ABI files, or ``"brf"``, divided by the cosine of the solar
        zenith angle. Those of ABI's own files and of results are known. [-]

    Returns
    -------
    xarray.Dataset
        ``reflectance_factor`` (band, y, x), NaN where nothing was observed or it is above
        `LARGEST_REFLECTANCE_FACTOR`, ``saturated`` (1 where a band could tell no more) and
        ``quantised`` (band), 1 where its values are counts, as those of ABI's own files are;
        attributes ``observed_files``, ``observed_variables``, ``regridding`` and, where the
        observation says so, ``observed_time``.

    Raises
    ------
    InputError
        Where a file has no reflectances, other units (such as per cent), another grid, another time
        or another satellite's place than the scene, or nothing that is finite.
    """
    if quantity not in ("reflectance_factor", "brf"):
        raise InputError(f"observed is 'reflectance_factor' or 'brf'; got {quantity!r}.")
    if not paths:
        raise InputError("there is no file of what was observed; give one.")
    parts = [_read_one(path, image, nearest_km, quantity) for path in paths]
    bands = [str(band) for part in parts for band in part["band"].values]
    twice = sorted({band for band in bands if bands.count(band) > 1})
    if twice:
        raise InputError(f"{', '.join(twice)} was observed by more than one of the files.")
    observed = xr.concat([p.drop_attrs(deep=False) for p in parts], "band", join="exact")
    observed = observed.sel(band=sorted(bands))
    for part, path in zip(parts, paths, strict=True):
        _check_time(part, image, path)
    told = {key: [str(part.attrs[key]) for part in parts if key in part.attrs] for key in _TOLD}
    words = {key: "; ".join(dict.fromkeys(each)) for key, each in told.items() if each}
    return observed.assign_attrs({"observed_files": "; ".join(map(str, paths))} | words)


def _read_one(
    path: str | PathLike[str], image: xr.Dataset, nearest_km: float | None, quantity: Quantity
) -> xr.Dataset:
    with open_netcdf(path, advice="give a NetCDF file of reflectances") as file:
        if is_result(file):
            found, grid, told = _of_result(path, image)
        else:
            check_satellite(longitude_of_file(file), image, path)
            found, grid = found_in(file, path)
            told = _times_of(file)
        index, how = _index(grid, image, nearest_km, path)
        fields = {one.band: _laid(one, index, image, quantity, path) for one in found}
    bands = list(fields)
    values = np.stack([values for values, _ in fields.values()])
    dims = ("band", "y", "x")
    about = cf_attributes("reflectance_factor") | {"long_name": "observed reflectance factor"}
    observed = xr.Dataset(
        {
            "reflectance_factor": (dims, values, about),
            "saturated": (dims, np.stack([x for _, x in fields.values()]).astype(np.int8)),
            "quantised": ("band", np.array([one.is_counts for one in found], np.int8)),
        },
        {"band": bands},
    )
    told |= {"observed_variables": ", ".join(one.source for one in found), "regridding": how}
    return observed.assign_attrs(told)


def _of_result(
    path: str | PathLike[str], image: xr.Dataset
) -> tuple[list[Found], Grid, dict[str, str]]:
    """Of a result the time that is nearest to the scene's."""
    with read_result(path) as result:
        check_satellite(longitude_of_result(result.attrs), image, path)
        apart = np.abs(result["time"].values - np.asarray(image["time"].values))
        result = result.isel(time=int(np.argmin(apart)))
        bands = [str(b) for b in result["band"].values if str(b) in REFLECTIVE]
        if not bands:
            raise InputError(f"{path} has none of {', '.join(REFLECTIVE)}.")
        factor = result["reflectance_factor"].transpose("band", "y", "x")
        values = factor.sel(band=bands).values.astype(np.float64)
        if "saturated" in result:
            limited = result["saturated"].transpose("band", "y", "x").sel(band=bands).values == 1
            values = np.where(limited, np.inf, values)
        latitude, longitude = (result[x].values.astype(float) for x in ("latitude", "longitude"))
        told = {"observed_time": str(result["time"].values.astype("datetime64[s]"))}
        if "error_budget" in result.attrs:
            told["error_budget"] = f"{float(result.attrs['error_budget']):g}"
        counts = imager_of(result).quantised
    names = [Found(band, x, False, band, counts) for band, x in zip(bands, values, strict=True)]
    return names, Grid(latitude, longitude), told


def _index(
    grid: Grid, image: xr.Dataset, nearest_km: float | None, path: object
) -> tuple[np.ndarray, str]:
    """Observed pixel, of all in a row, for each of the scene (y, x), -1 for none; and in words."""
    if grid.projection is None:
        found, apart = placed(grid.first, grid.second, image, nearest_km, path)
        how = "none" if nearest_km is None else f"nearest pixel within {nearest_km:g} km"
    else:
        found, apart = _seen_in(grid, grid.projection, image, path)
        how = "pixel in which a place is seen"
    index = once_each(found, apart)
    left_out = np.count_nonzero(index != found)
    if left_out:
        how += f" ({left_out} pixels of the scene left out, as nearer ones have what they would)"
    return index, how


def _seen_in(
    grid: Grid, projection: dict, image: xr.Dataset, path: object
) -> tuple[np.ndarray, np.ndarray]:
    """As `placed`, of a grid of scan angles; distances are angles. [rad]"""
    latitude, longitude = (image[name].values.astype(float) for name in ("latitude", "longitude"))
    x, y = scan_angles(latitude, longitude, projection)
    (row, off_y), (column, off_x) = nearest_on_axis(grid.first, y), nearest_on_axis(grid.second, x)
    inside = (row >= 0) & (column >= 0)
    if not inside.any():
        raise InputError(f"{path} shows nothing of the scene; give one that covers it.")
    return np.where(inside, row * grid.second.size + column, -1), np.hypot(off_y, off_x)


def _laid(
    one: Found, index: np.ndarray, image: xr.Dataset, quantity: Quantity, path: object
) -> tuple[np.ndarray, np.ndarray]:
    """Reflectance factor and where it is saturated (y, x)."""
    finite = one.values[np.isfinite(one.values)]
    if finite.size == 0:
        raise InputError(f"{one.source} in {path} has no finite value.")
    if np.mean(finite > LARGEST_REFLECTANCE_FACTOR) > 0.01:
        raise InputError(
            f"{one.source} in {path} reaches {finite.max():.3g}, where a bright cloud has 1: it "
            "seems to be in per cent, or counts; convert it to reflectance."
        )
    outside = np.isfinite(one.values) & (one.values < SMALLEST_REFLECTANCE)
    if outside.any():
        raise InputError(
            f"{one.source} in {path} is {one.values[outside].min():.3g} somewhere, less than noise "
            f"leaves of the dark ({SMALLEST_REFLECTANCE:g}): leave it out of the file, as missing."
        )
    values = np.where(index >= 0, one.values.ravel()[np.maximum(index, 0)], np.nan)
    saturated = np.isposinf(values)
    # Beyond what is reflected the instrument tells nothing: no value, and not a large one.
    values = np.where(np.isfinite(values) & (values <= LARGEST_REFLECTANCE_FACTOR), values, np.nan)
    if one.is_brf or (one.is_brf is None and quantity == "brf"):
        values = values * np.cos(np.radians(image["solar_zenith_angle"].values))
    return values, saturated


def _times_of(file: xr.Dataset) -> dict[str, str]:
    """Time of a file that says it in its global attributes, or by a CF variable ``time``."""
    stated = [str(file.attrs[name]).rstrip("Z") for name in _TIMES if name in file.attrs]
    try:
        if stated:
            return {"observed_time": str(np.datetime64(stated[0], "s"))}
        if "time" in file.variables and "since" in str(file["time"].attrs.get("units", "")):
            time = np.ravel(xr.decode_cf(file[["time"]])["time"].values)[0]
            return {"observed_time": str(time.astype("datetime64[s]"))}
    except ValueError:
        pass  # a time that cannot be read is none
    return {}


def _check_time(part: xr.Dataset, image: xr.Dataset, path: object) -> None:
    if "observed_time" not in part.attrs or "time" not in image.coords:
        return
    apart = image["time"].values - np.datetime64(part.attrs["observed_time"])
    if not -LARGEST_DELAY <= apart <= LARGEST_DELAY:
        own = np.datetime_as_string(image["time"].values, "s")
        raise InputError(
            f"{path} was observed at {part.attrs['observed_time']} and the scene is of {own}: more "
            "than 30 minutes apart, the sun stands elsewhere."
        )


def bands_in_common(
    image: xr.Dataset, observed: xr.Dataset, bands: Sequence[str] | None = None
) -> tuple[str, ...]:
    """Bands that both have, or those of them that are asked for.

    Raises
    ------
    InputError
        Where there is none, or one of those asked for is missing.
    """
    have = [str(b) for b in image["band"].values if str(b) in observed["band"].values]
    if bands is None:
        if not have:
            raise InputError(
                f"scene ({', '.join(map(str, image['band'].values))}) and observation "
                f"({', '.join(map(str, observed['band'].values))}) have no band in common."
            )
        return tuple(have)
    try:
        chosen = check_bands(bands, REFLECTIVE)
    except ValueError as error:
        raise InputError(str(error)) from None
    missing = [band for band in chosen if band not in have]
    if missing:
        raise InputError(
            f"{', '.join(missing)} is not in both scene and observation, which share "
            f"{', '.join(have) or 'none'}."
        )
    return chosen
