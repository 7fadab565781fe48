"""Opening NetCDF files and checking what is in them; every complaint is an `InputError`."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import TypeAlias

import numpy as np
import xarray as xr

from ..nomenclature import variable
from .completeness import check_complete
from .errors import InputError
from .opening import opened_in_time

FilePath: TypeAlias = str | PathLike[str]

# What xarray and the NetCDF library raise for files they cannot read: of a damaged attribute they
# say that there is none, and of a damaged size that memory is too small.
_UNREADABLE = (
    *(OSError, ValueError, RuntimeError, TypeError, AttributeError, LookupError),
    *(OverflowError, MemoryError),
)
# With which numbers are unpacked.
_PACKING = ("scale_factor", "add_offset")


def open_netcdf(
    path: FilePath, *, mask_and_scale: bool = True, advice: str = "give a NetCDF file"
) -> xr.Dataset:
    """Open a NetCDF file lazily, with times left as numbers; one that broke off is refused, and
    one in which the library finds no end (`opening`).

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
        dataset = opened_in_time(path, mask_and_scale=mask_and_scale)
    except InputError:
        raise
    except _UNREADABLE as error:
        raise InputError(f"{path} cannot be read as NetCDF ({error}); {advice}.") from error
    try:
        _check_packing(dataset, path)
    except InputError:
        dataset.close()
        raise
    return dataset


def _check_packing(dataset: xr.Dataset, path: FilePath) -> None:
    for label, array in dataset.variables.items():
        for name in _PACKING:
            value = {**array.attrs, **array.encoding}.get(name, 1.0)
            if not (np.isscalar(value) or np.size(value) == 1) or isinstance(value, str):
                raise InputError(
                    f"{name} of {label} in {path} is {value!r}, which is no number; give the "
                    "file as its producer wrote it."
                )


@contextmanager
def reading(files: str) -> Iterator[None]:
    """Whatever the NetCDF library cannot read of what is lazily read in this block is told.

    Parameters
    ----------
    files
        Which they are, in words: the library does not say.

    Raises
    ------
    InputError
        In place of the library's error.
    """
    try:
        yield
    except RuntimeError as error:
        if not str(error).startswith("NetCDF: "):
            raise
        raise InputError(f"{files} cannot be read ({error}); copy it again.") from error


def require_variables(
    dataset: xr.Dataset, names: Iterable[str], path: FilePath, advice: str
) -> None:
    """Raise `InputError` naming every variable of `names` that `dataset` lacks."""
    missing = [name for name in names if name not in dataset.variables]
    if missing:
        raise InputError(f"{path} has no {', '.join(missing)}; {advice}.")


def require_dims(array: xr.DataArray, dims: tuple[str, ...], path: FilePath) -> None:
    """Raise `InputError` unless `array` has exactly the dimensions `dims`, in this order, and none
    of them is empty.
    """
    if array.dims != dims:
        raise InputError(
            f"{array.name} in {path} has dimensions {array.dims} where {dims} are expected; "
            "give the file as its producer wrote it."
        )
    require_values(array, path)


def require_values(array: xr.DataArray, path: FilePath) -> None:
    """Raise `InputError` where a dimension of `array` is empty, so that it has no values."""
    empty = [str(dim) for dim, size in array.sizes.items() if not size]
    if empty:
        raise InputError(
            f"{array.name} in {path} has no values, as {', '.join(empty)} is empty; give the file "
            "as its producer wrote it."
        )


def load(array: xr.DataArray, path: FilePath) -> np.ndarray:
    """Read the values of a lazy variable, which has some, from disk as float64."""
    require_values(array, path)
    try:
        return np.asarray(array.values, dtype=np.float64)
    except _UNREADABLE as error:
        raise InputError(
            f"{array.name} in {path} cannot be read ({error}); check that the file is complete."
        ) from error


def load_all(dataset: xr.Dataset, path: FilePath) -> xr.Dataset:
    """Read all that a lazy Dataset has from disk into memory."""
    try:
        return dataset.load()
    except _UNREADABLE as error:
        raise InputError(f"{path} cannot be read ({error}); copy it again.") from error


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
    """CF attributes of one of our variables: units, names, and what belongs to some of them."""
    entry = variable(name)
    if entry is None:
        return {}
    attributes = {
        "units": entry.units or None,
        "long_name": entry.long_name,
        "standard_name": entry.standard_name,
        "positive": entry.positive,
        "units_metadata": "temperature: on_scale" if entry.units == "K" else None,
    }
    return {key: value for key, value in attributes.items() if value is not None}
