"""The result of a scene as a CF NetCDF file, written and read block by block of rows."""

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Self

import netCDF4
import numpy as np
import xarray as xr

from .._version import __version__
from ..nomenclature import BY_BAND, HORIZONTAL, QUALITY_FLAGS, SCENARIO, variable
from .errors import InputError
from .netcdf import cf_attributes, open_netcdf, require_dims, require_variables

CONVENTIONS = "CF-1.11"

_SOURCE = "abi_operator "
_FILES = "files_made_of_this_one"
_TIME_UNITS = "seconds since 1970-01-01 00:00:00"
_CALENDAR = "standard"
_POSITION = ("latitude", "longitude")
_ADVICE = "give a result that a simulation wrote"
_REQUIRED = (*_POSITION, "quality_flag")


class ResultWriter:
    """Write result Datasets of one time and a block of rows each into one NetCDF-4 file.

    A context manager. Only the block at hand is in memory. The first block decides which
    variables there are: those with ``y x`` are filled block by block and get a leading ``time``
    (but for latitude and longitude, unless the grid moves), all others (an aerosol's properties,
    say) are written once and must be the same in every block. Attributes of a variable are those
    of the nomenclature and of the first block. A block that contradicts the first, and rows that
    nobody wrote, are a `ValueError`; after any exception the file is deleted.

    Parameters
    ----------
    path
        The file to write.
    times
        All times of the scene. [datetime64]
    shape
        Numbers of rows and columns of the scene. [-]
    moving
        Whether latitude and longitude change from time to time.
    attributes
        Global attributes besides ``Conventions`` and ``source``; ``title`` has a default, and a
        ``history`` goes on below the line of this file.
    grid
        Coordinates ``x``, ``y`` and ``crs`` of `projected`; None where there is no such map.
    command
        The command that is run, for ``history``.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        times: np.ndarray,
        shape: tuple[int, int],
        moving: bool = False,
        attributes: Mapping[str, str | int | float] | None = None,
        grid: xr.Dataset | None = None,
        command: str | None = None,
    ) -> None:
        self._grid = grid
        self._path = Path(path).absolute()
        self._times = np.atleast_1d(np.asarray(times)).astype("datetime64[ns]")
        self._shape = shape
        self._moving = moving
        self._variables: dict[str, tuple[str, ...]] = {}
        self._written = np.zeros((len(self._times), shape[0]), dtype=bool)
        try:
            self._file = netCDF4.Dataset(self._path, "w", format="NETCDF4")
        except OSError as error:
            raise InputError(
                f"{path} cannot be written ({error.strerror}); give a path in a folder that can."
            ) from error
        given = dict(attributes or {})
        before = str(given.get("history", ""))
        now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        source = f"abi_operator {__version__}"
        event = f"written by {source}" if command is None else f"{command} ({source})"
        self._file.setncatts(
            {"title": "Synthetic imagery of the GOES-R Advanced Baseline Imager"}
            | given
            | {
                "Conventions": CONVENTIONS,
                "source": source,
                "history": "\n".join(filter(None, (f"{now} {event}", before))),
            }
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        complete = kind is None and bool(self._written.all())
        try:
            self._file.close()
        except RuntimeError:  # what a full disk refuses to take
            complete = False
            raise
        finally:
            if not complete:
                self._path.unlink(missing_ok=True)
        if kind is None and not complete:
            num_missing = np.count_nonzero(~self._written)
            raise ValueError(
                f"{num_missing} of {self._written.size} rows of {self._path} were never written."
            )

    def write(self, time_index: int, rows: slice, dataset: xr.Dataset) -> None:
        """Write one block.

        Parameters
        ----------
        time_index
            Which of the times the block is of. [-]
        rows
            Which rows ``y`` of the scene it holds; its step is 1. [-]
        dataset
            Variables with dimensions among ``band level layer y x``; see
            `abi_operator.nomenclature` for names. A coordinate ``time`` must be the block's.
        """
        time = self._times[time_index]
        if "time" in dataset.variables and (dataset["time"].values != time).any():
            raise ValueError(f"the block is of {dataset['time'].values}, not of {time}.")
        dataset = dataset.drop_vars("time", errors="ignore")
        row_range = range(self._shape[0])[rows]
        sizes = (len(row_range), self._shape[1])
        if row_range.step != 1 or tuple(dataset.sizes.get(dim) for dim in HORIZONTAL) != sizes:
            raise ValueError(f"{rows=} of a scene {self._shape} is no block of {dataset.sizes}.")
        first = not self._variables
        if first:
            self._define(dataset)
        dims = {str(name): _dims(array) for name, array in dataset.variables.items()}
        if dims != self._variables:
            raise ValueError(f"the block has {dims}, the first one had {self._variables}.")
        rows = slice(row_range.start, row_range.stop)
        for name in dims:
            self._write_variable(name, time_index, rows, dataset[name].values, first)
        self._written[time_index, rows] = True

    def add_attributes(self, attributes: Mapping[str, str | int | float]) -> None:
        """Add global attributes, such as those that are known only after the last block."""
        self._file.setncatts(attributes)

    def _write_variable(
        self, name: str, time_index: int, rows: slice, values: np.ndarray, first: bool
    ) -> None:
        """Write the block's values of one variable, or see that they are as before."""
        target = self._file[name]
        if "y" not in target.dimensions:
            if first:
                target[...] = values.astype(object) if _is_text(values.dtype) else values
            elif not _same(np.asarray(target[...]), values):
                raise ValueError(f"{name} differs from block to block but has no dimension y.")
            return
        if "time" in target.dimensions:
            target[(time_index, ..., rows, slice(None))] = values
            return
        known = self._written[:, rows].any(axis=0)
        if not _same(np.asarray(target[rows])[known], values[known]):
            raise ValueError(f"{name} differs from time to time; say that the grid is moving.")
        target[rows] = values

    def _define(self, dataset: xr.Dataset) -> None:
        """Define dimensions and variables after the first block."""
        self._file.createDimension("time", len(self._times))
        full_sizes = {"y": self._shape[0], "x": self._shape[1]}
        for dim, size in dataset.sizes.items():
            full = full_sizes.get(str(dim), size)
            self._file.createDimension(str(dim), full)
        time = self._file.createVariable("time", "f8", ("time",))
        time.setncatts(
            {"standard_name": "time", "long_name": "time", "axis": "T"}
            | {"units": _TIME_UNITS, "calendar": _CALENDAR}
            | {"units_metadata": "leap_seconds: none"}
        )
        time[:] = self._times.astype(np.int64) / 1e9
        for name, array in {} if self._grid is None else self._grid.coords.items():
            created = self._file.createVariable(str(name), array.dtype, array.dims)
            created.setncatts(array.attrs)
            created[...] = array.values
        self._variables = {str(name): _dims(array) for name, array in dataset.variables.items()}
        for name, array in dataset.variables.items():
            self._define_variable(str(name), array, dataset.sizes["y"])

    def _define_variable(self, name: str, array: xr.Variable, num_rows: int) -> None:
        """Define one variable; a chunk is one time and as many rows as the first block has."""
        dims = _dims(array)
        horizontal = "y" in dims
        if horizontal != ("x" in dims) or (horizontal and dims[-2:] != HORIZONTAL):
            raise ValueError(f"{name} has dimensions {dims}; y and x come together, and last.")
        timed = horizontal and (self._moving or name not in _POSITION)
        kind = np.dtype(np.uint8) if name == "quality_flag" else array.dtype
        text = _is_text(array.dtype)
        chunks = [1] * timed + [num_rows if d == "y" else s for d, s in array.sizes.items()]
        created = self._file.createVariable(
            name,
            str if text else kind,
            ("time", *dims) if timed else dims,
            compression="zlib" if horizontal else None,
            complevel=1,
            chunksizes=chunks if horizontal else None,
            fill_value=np.nan if kind.kind == "f" and horizontal else False,
        )
        if horizontal:
            # A chunk is a block, written once: the library would keep 64 MB of each variable's.
            created.set_var_chunk_cache(size=1, nelems=1)
        created.set_auto_mask(False)
        created.setncatts(_attributes(name, array))
        if horizontal and name not in _POSITION and self._grid is not None:
            created.grid_mapping = "crs"
        if coordinates := " ".join(self._coordinates_of(name, array)):
            created.coordinates = coordinates

    def _coordinates_of(self, name: str, array: xr.Variable) -> Iterator[str]:
        """Coordinates of a variable beside those of the same names as its dimensions."""
        if name in (*_POSITION, *BY_BAND):
            return
        if "band" in array.dims and "band_wavelength" in self._variables:
            yield "band_wavelength"
        if "level" in array.dims and name != "height" and "height" in self._variables:
            yield "height"
        if "y" in array.dims:
            yield from _POSITION


def read_result(path: str | PathLike[str]) -> xr.Dataset:
    """Open a result file lazily, with the names and dimensions it was written with.

    Parameters
    ----------
    path
        A file that `ResultWriter` wrote.

    Returns
    -------
    xarray.Dataset
        Dimensions ``time band level layer y x``; latitude and longitude are coordinates, and so are
        x and y where the file has them. It keeps the file open: close it, or use it as a context
        manager.
    """
    dataset = open_netcdf(path)
    try:
        require_variables(dataset, ("time", "band", *_REQUIRED), path, _ADVICE)
        for name in (name for name in ("reflectance_factor", *SCENARIO) if name in dataset):
            entry = variable(name)
            assert entry is not None
            timed = "time" in dataset[name].dims or name not in _POSITION
            require_dims(dataset[name], ("time", *entry.dims) if timed else entry.dims, path)
        for name in ("time", "band"):
            require_dims(dataset[name], (name,), path)
        if dataset["time"].attrs.get("units") != _TIME_UNITS:
            raise InputError(f"time in {path} is not in {_TIME_UNITS}; {_ADVICE}.")
    except InputError:
        dataset.close()
        raise
    microseconds = np.rint(1e6 * dataset["time"].values).astype("datetime64[us]")
    for array in dataset.variables.values():
        array.attrs.pop("coordinates", None)
    others = [name for name in ("band_wavelength", "crs") if name in dataset.variables]
    result = dataset.set_coords([*_POSITION, *others]).assign_coords(
        time=("time", microseconds.astype("datetime64[ns]"), {"standard_name": "time"}),
        band=("band", dataset["band"].values.astype(str), dataset["band"].attrs),
    )
    result.set_close(dataset.close)  # which a Dataset does not hand on
    return result


def note_files(path: str | PathLike[str], names: Sequence[str]) -> None:
    """Note in a result file which other files, in its folder, were made of it."""
    with netCDF4.Dataset(Path(path).absolute(), "a") as file:
        file.setncattr(_FILES, "; ".join(names))


def noted_files(path: str | PathLike[str]) -> list[str]:
    """Names of files beside a result file that were made of it and are still there.

    None of what is no result.
    """
    folder = Path(path).absolute().parent
    try:
        with open_netcdf(path) as result:
            attributes = result.attrs
    except InputError:
        return []
    if not str(attributes.get("source", "")).startswith(_SOURCE):
        return []
    names = str(attributes.get(_FILES, "")).split("; ")
    return [name for name in names if Path(name).name == name and (folder / name).is_file()]


def _attributes(name: str, array: xr.Variable) -> dict[str, object]:
    """Attributes of a variable: the project's, the block's own, and those of flags."""
    attributes: dict[str, object] = {**cf_attributes(name)}
    attributes |= {str(k): v for k, v in array.attrs.items() if k != "_FillValue"}
    if name in ("reflectance_factor", "brf", "radiance", "brightness_temperature"):
        attributes["ancillary_variables"] = "quality_flag"
    if name == "quality_flag":
        attributes["flag_masks"] = np.array(list(QUALITY_FLAGS.values()), np.uint8)
        attributes["flag_meanings"] = " ".join(QUALITY_FLAGS)
    return attributes


def _dims(array: xr.Variable) -> tuple[str, ...]:
    return tuple(str(dim) for dim in array.dims)


def _is_text(dtype: np.dtype) -> bool:
    return dtype.kind in "OUST"


def _same(ours: np.ndarray, theirs: np.ndarray) -> bool:
    """Whether two arrays are equal, NaN being equal to NaN."""
    if _is_text(theirs.dtype):
        return ours.astype(str).tolist() == theirs.astype(str).tolist()
    return np.array_equal(ours, theirs, equal_nan=True)
