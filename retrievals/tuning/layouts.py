"""How observed reflectances lie in a file: what is read of each layout, as it is there.

Three layouts are known by their variables, whatever the file's name: a **result** of ``simulate``
or ``observe`` (``reflectance_factor`` with a dimension ``band``); an **ABI file**, of a band's
radiance (L1b, ``Rad``) or of reflectance (L2 cloud and moisture imagery, ``CMI`` or ``CMI_C01``
and so on), on its own grid of scan angles; and **named variables** (``C01``, ``brf_C01``,
``reflectance_factor_C01``; of MODIS ``Band3`` and so on) with latitude and longitude.
"""

import re
from typing import NamedTuple

import numpy as np
import xarray as xr

from abi_operator.files import InputError
from abi_operator.files.netcdf import load
from abi_operator.files.units import check_units

MODIS: dict[str, str] = {"3": "C01", "1": "C02", "2": "C03", "7": "C06"}
"""Band of ABI that each band of MODIS stands for. Centres are 0.469, 0.645, 0.858 and 2.130 um
where ABI's are 0.471, 0.640, 0.864 and 2.243: responses differ, and nothing is corrected for it."""

_ABI_BAND = re.compile(
    r"(?:(?P<quantity>reflectance_factor|brf|cmi|reflectance)_)?(?P<band>c0[1-6])"
)
_MODIS_BAND = re.compile(
    r"(?:(?P<quantity>reflectance_factor|brf|reflectance|modis)_)?band_?(?P<band>[1237])"
)
_IS_BRF = {"brf": True, "reflectance_factor": False, "cmi": False}
"""What names say of a division by the cosine of the solar zenith angle: others, such as a bare
``reflectance``, say nothing."""
_LATITUDE = ("latitude", "lat", "XLAT")
_LONGITUDE = ("longitude", "lon", "XLONG")
_LARGEST_QUALITY = 1
"""Of ABI's data quality flags, 0 is good and 1 usable under conditions; others are no values."""


class Found(NamedTuple):
    """What a file has of one band.

    Parameters
    ----------
    band
        Name of ABI's band.
    values
        Reflectance (row, column), NaN where there is none. [-]
    is_brf
        Whether it says itself that it was divided by the cosine of the solar zenith angle, or that
        it was not; None where it says neither.
    source
        The variable, in words.
    is_counts
        Whether the values were rounded to the counts of ABI's files.
    """

    band: str
    values: np.ndarray
    is_brf: bool | None
    source: str
    is_counts: bool = False


class Grid(NamedTuple):
    """Where the pixels of a file are: latitude and longitude, or axes of scan angles.

    Parameters
    ----------
    first, second
        Latitude and longitude (row, column) [degree], or y (row) and x (column) [rad].
    projection
        Attributes of the grid of scan angles; None for latitude and longitude.
    """

    first: np.ndarray
    second: np.ndarray
    projection: dict | None = None


def is_result(file: xr.Dataset) -> bool:
    """Whether a file is a result of this project."""
    return "reflectance_factor" in file and "band" in file["reflectance_factor"].dims


def found_in(file: xr.Dataset, path: object) -> tuple[list[Found], Grid]:
    """Bands of a file that is no result of ours, and its grid.

    Raises
    ------
    InputError
        Where there is none, a unit or dimension is not as it should be, or places are missing.
    """
    found = [_radiance_file(file, path)] if "Rad" in file else _named(file, path)
    if not found:
        names = ", ".join(sorted(map(str, file.data_vars))) or "none"
        raise InputError(
            f"{path} has no reflectances: neither reflectance_factor by band, nor Rad or CMI of "
            f"ABI, nor variables such as C01, brf_C01 or Band3 (its variables: {names})."
        )
    twice = [one.band for k, one in enumerate(found) if one.band in [x.band for x in found[:k]]]
    if twice:
        raise InputError(f"{path} has {twice[0]} twice; keep one of them.")
    shape = found[0].values.shape
    grid = _grid(file, shape, path)
    for one in found:
        if one.values.shape != shape:
            raise InputError(
                f"{one.source} in {path} has {one.values.shape} pixels and {found[0].source} "
                f"{shape}; bring them to one grid."
            )
    return found, grid


def _radiance_file(file: xr.Dataset, path: object) -> Found:
    """Reflectance factor of an L1b file, pi d2 L / E0 with its own constants."""
    needed = ("esun", "earth_sun_distance_anomaly_in_AU", "band_id")
    missing = [name for name in needed if name not in file.variables]
    if missing:
        raise InputError(f"{path} has Rad but no {', '.join(missing)}; give an L1b file of ABI.")
    band = _band_of_file(file, path)
    if not _ABI_BAND.fullmatch(band.lower()):
        raise InputError(f"{path} is of band {band}, which is no reflectance; give C01 to C06.")
    check_units(file["Rad"], "W m-2 sr-1 um-1", str(path))
    distance, irradiance = (
        _constant(file, name, path) for name in ("earth_sun_distance_anomaly_in_AU", "esun")
    )
    values = np.pi * distance**2 / irradiance * _plane(file, "Rad", path)
    return Found(band, _of_quality(file, values, path), False, "Rad", is_counts=True)


def _band_of_file(file: xr.Dataset, path: object) -> str:
    return f"C{int(_constant(file, 'band_id', path)):02d}"


def _constant(file: xr.Dataset, name: str, path: object) -> float:
    """A number of the whole file, which is above 0."""
    values = np.ravel(load(file[name], str(path)))
    if values.size == 0 or not 0 < values[0] < np.inf:
        raise InputError(
            f"{name} in {path} is {values[:1].tolist()} where a number above 0 is expected; give "
            "the file as it was written."
        )
    return float(values[0])


def _named(file: xr.Dataset, path: object) -> list[Found]:
    found = []
    if "CMI" in file and "band_id" in file.variables:
        band = _band_of_file(file, path)
        if _ABI_BAND.fullmatch(band.lower()):
            check_units(file["CMI"], "1", str(path))
            values = _of_quality(file, _plane(file, "CMI", path), path)
            found.append(Found(band, values, False, "CMI", is_counts=True))
    for label in map(str, file.data_vars):
        match = _ABI_BAND.fullmatch(label.lower()) or _MODIS_BAND.fullmatch(label.lower())
        if match is None:
            continue
        check_units(file[label], "1", str(path))
        name = match["band"]
        band, source = (
            (MODIS[name], f"{label} of MODIS") if name in MODIS else (name.upper(), label)
        )
        is_brf, values = _IS_BRF.get(match["quantity"]), _plane(file, label, path)
        is_imagery = match["quantity"] == "cmi"
        if is_imagery:  # a file of several bands has the flags of each
            values = _of_quality(file, values, path, f"DQF_{band}")
        found.append(Found(band, values, is_brf, source, is_counts=is_imagery))
    return found


def _plane(file: xr.Dataset, name: str, path: object) -> np.ndarray:
    """Values of a variable (row, column), behind axes of length 1."""
    array = _of_one_time(file[name])
    if array.ndim != 2:
        raise InputError(
            f"{name} in {path} has the dimensions {file[name].dims}; an image of one time has two."
        )
    return load(array, str(path))


def _of_one_time(array: xr.DataArray) -> xr.DataArray:
    """A variable without the axes of length 1 that stand before its last two."""
    return array.squeeze([dim for dim in array.dims[:-2] if array.sizes[dim] == 1])


def _of_quality(
    file: xr.Dataset, values: np.ndarray, path: object, name: str = "DQF"
) -> np.ndarray:
    """Values without those that flags of a name, where a file has any, call none."""
    if name not in file.variables:
        return values
    quality = _plane(file, name, path)
    if quality.shape != values.shape:
        raise InputError(f"{name} in {path} has {quality.shape} pixels, its image {values.shape}.")
    return np.where(quality <= _LARGEST_QUALITY, values, np.nan)


def _grid(file: xr.Dataset, shape: tuple[int, ...], path: object) -> Grid:
    names = [
        next((x for x in names if x in file.variables), None) for names in (_LATITUDE, _LONGITUDE)
    ]
    if names[0] is not None and names[1] is not None:
        latitude, longitude = (load(_of_one_time(file[name]), str(path)) for name in names)
        if latitude.ndim == 1 and longitude.ndim == 1:
            latitude, longitude = np.meshgrid(latitude, longitude, indexing="ij")
        if latitude.shape != shape or longitude.shape != shape:
            raise InputError(
                f"{names[0]} and {names[1]} in {path} have the shapes {latitude.shape} and "
                f"{longitude.shape}, and the reflectances {shape}."
            )
        return Grid(latitude, longitude)
    if "goes_imager_projection" in file.variables and {"x", "y"} <= set(file.variables):
        rows, columns = (load(file[name], str(path)) for name in ("y", "x"))
        if (rows.size, columns.size) != shape:
            raise InputError(f"axes x and y in {path} do not fit its image of {shape} pixels.")
        return Grid(rows, columns, dict(file["goes_imager_projection"].attrs))
    raise InputError(
        f"{path} has neither latitude and longitude nor a goes_imager_projection with x and y, so "
        "that it cannot be laid on the scene."
    )
