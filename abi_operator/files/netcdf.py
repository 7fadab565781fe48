"""Opening NetCDF files and checking what is in them; every complaint is an `InputError`."""

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import TypeAlias

import numpy as np
import xarray as xr

from ..nomenclature import variable
from .completeness import check_complete
from .errors import InputError

FilePath: TypeAlias = str | PathLike[str]

# What xarray and the NetCDF library raise for files they cannot read.
_UNREADABLE = (OSError, ValueError, RuntimeError)


def open_netcdf(
    path: FilePath, *, mask_and_scale: bool = True, advice: str = "give a NetCDF file"
) -> xr.Dataset:
    """Open a NetCDF file lazily, with times left as numbers; one that broke off is refused.

    Parameters
    ----------
    path
        The file; any name will do, as WRF's have colons and no suffix.
    mask_and_scale
        Whether to apply ``_FillValue``, ``scale_factor`` and ``add_offset``.
    advice
        What to give in place of a file of another format.
    """
    if not Path(path).is_file():
        raise InputError(f"{path} does not exist or is not a file; check the path.")
    try:
        check_complete(path, advice)
    except OSError as error:
        raise InputError(
            f"{path} cannot be read ({error.strerror}); check who may read it."
        ) from error
    try:
        return xr.open_dataset(
            Path(path).absolute(),
            engine="netcdf4",
            decode_times=False,
            decode_timedelta=False,
            decode_coords=False,
            mask_and_scale=mask_and_scale,
        )
    except _UNREADABLE as error:
        raise InputError(f"{path} cannot be read as NetCDF ({error}); {advice}.") from error


def require_variables(
    dataset: xr.Dataset, names: Iterable[str], path: FilePath, advice: str
) -> None:
    """Raise `InputError` naming every variable of `names` that `dataset` lacks."""
    missing = [name for name in names if name not in dataset.variables]
    if missing:
        raise InputError(f"{path} has no {', '.join(missing)}; {advice}.")


def require_dims(array: xr.DataArray, dims: tuple[str, ...], path: FilePath) -> None:
    """Raise `InputError` unless `array` has exactly the dimensions `dims`, in this order."""
    if array.dims != dims:
        raise InputError(
            f"{array.name} in {path} has dimensions {array.dims} where {dims} are expected; "
            "give the file as its producer wrote it."
        )


def load(array: xr.DataArray, path: FilePath) -> np.ndarray:
    """Read the values of a lazy variable from disk as float64."""
    try:
        return np.asarray(array.values, dtype=np.float64)
    except _UNREADABLE as error:
        raise InputError(
            f"{array.name} in {path} cannot be read ({error}); check that the file is complete."
        ) from error


def load_finite(array: xr.DataArray, path: FilePath) -> np.ndarray:
    """Read the values of a lazy variable as float64, refusing missing and infinite ones."""
    values = load(array, path)
    num_bad = np.count_nonzero(~np.isfinite(values))
    if num_bad:
        raise InputError(
            f"{array.name} in {path} has {num_bad} missing or non-finite values; "
            "repair them or cut them out of the file."
        )
    return values


def cf_attributes(name: str) -> dict[str, str]:
    """Attributes ``units``, ``long_name`` and ``standard_name`` of one of our variables."""
    entry = variable(name)
    if entry is None:
        return {}
    attributes = {"units": entry.units, "long_name": entry.long_name}
    if entry.standard_name is not None:
        attributes["standard_name"] = entry.standard_name
    return attributes
