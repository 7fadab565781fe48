"""Output files of one run of WRF as one series of times; one time a file is the rule."""

import glob
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from .errors import InputError
from .netcdf import FilePath, open_netcdf
from .wrf import block_of_wrf, opened_wrf, read_wrf, wrf_coordinates

# What files of one grid of one run have in common.
_DIMENSIONS = ("south_north", "west_east", "bottom_top")
_ATTRIBUTES = (
    "GRID_ID",
    "MAP_PROJ",
    "DX",
    "DY",
    "TRUELAT1",
    "TRUELAT2",
    "STAND_LON",
    "MP_PHYSICS",
)
# Times that are told where another one was asked for.
_TOLD = 6


class WrfSeries(NamedTuple):
    """Times of one grid, in one file or several.

    Parameters
    ----------
    places
        File of each time, and its index there. [-]
    times
        The times. [datetime64[ns]]
    moving
        Whether latitude and longitude change from time to time.
    """

    places: tuple[tuple[Path, int], ...]
    times: np.ndarray
    moving: bool

    @property
    def name(self) -> str:
        """The file, or how many there are, to begin a sentence with."""
        files = list(dict.fromkeys(path for path, _ in self.places))
        return str(files[0]) if len(files) == 1 else f"the series of {len(files)} files"

    def coordinates(self, index: int) -> xr.Dataset:
        """As `wrf_coordinates`, of one of all times."""
        path, time = self.places[index]
        found = wrf_coordinates(path, time).drop_vars("time")
        return found.assign_coords(time=self.times).assign_attrs(moving_nest=int(self.moving))

    def read(self, index: int, rows: slice = slice(None)) -> xr.Dataset:
        """As `read_wrf`, of one of all times."""
        path, time = self.places[index]
        return read_wrf(path, time, rows)

    @contextmanager
    def opened(self) -> Iterator[Callable[[int, slice], xr.Dataset]]:
        """`read` for blocks one after the other, as a context manager.

        A file stays open until another is read: of one that is compressed the library unpacks a
        chunk, often of half the rows, for all blocks of its rows, and not for each again.
        """
        files: dict[Path, xr.Dataset] = {}

        def read(index: int, rows: slice = slice(None)) -> xr.Dataset:
            path, time = self.places[index]
            if path not in files:
                close()
                files[path] = opened_wrf(path)
            return block_of_wrf(files[path], path, time, rows)

        def close() -> None:
            for file in files.values():
                file.close()
            files.clear()

        try:
            yield read
        finally:
            close()

    def find(self, wanted: int | str | None) -> tuple[int, ...]:
        """Indices of times.

        Parameters
        ----------
        wanted
            An index, from 0; the name of a time, as ``2005-08-28T12:00``, which may be as short as
            that of a day, for all times in it; several, separated by commas; None for all.
        """
        if wanted is None:
            return tuple(range(len(self.times)))
        found = [self._find(text.strip()) for text in str(wanted).split(",")]
        return tuple(sorted({index for indices in found for index in indices}))

    def _find(self, text: str) -> list[int]:
        """Indices of what one word names."""
        if text.lstrip("-").isdigit():
            if not 0 <= int(text) < len(self.times):
                raise InputError(
                    f"{self.name} has {len(self.times)} times; ask for one of them, from 0, "
                    f"not {text}."
                )
            return [int(text)]
        try:
            if text.lower() in ("", "nat"):  # NumPy's own names of no time
                raise ValueError
            moment = np.datetime64(text.replace("_", "T").removesuffix("Z"))
        except ValueError:
            raise InputError(
                f"{text!r} is no time; write it as 2005-08-28T12:00, or as a number from 0."
            ) from None
        found = np.flatnonzero(self.times.astype(moment.dtype) == moment).tolist()
        if not found:
            names = np.datetime_as_string(self.times, unit="s").tolist()
            if len(names) > _TOLD:
                names = [*names[: _TOLD - 1], f"... ({len(names)} times)", names[-1]]
            raise InputError(f"{self.name} has no time {text}; it has {', '.join(names)}.")
        return found


def open_wrf_series(wrf: FilePath | Sequence[FilePath]) -> WrfSeries:
    """Open files of one grid, see that they are, and put their times in order.

    Parameters
    ----------
    wrf
        A wrfout file, or some, or patterns of their names (``wrfout_d01_*``).

    Raises
    ------
    InputError
        Where a file cannot be read, is of another grid or run, or has a time twice, or one that
        another file has.
    """
    paths = _files([wrf] if isinstance(wrf, str | PathLike) else wrf)
    first, moving = wrf_coordinates(paths[0]), False
    common = described = _described(paths[0])
    places, moments = [], []
    for path in paths:
        own = first
        if path is not paths[0]:
            described = _described(path)
            _check_alike(paths[0], common, path, described)
            own = wrf_coordinates(path)
        if not all(np.array_equal(first[x], own[x]) for x in ("latitude", "longitude")):
            if int(described["GRID_ID"] or 1) == 1:  # the outermost domain, which does not move
                raise InputError(
                    f"{path} is of another place than {paths[0]}; give files of one domain."
                )
            moving = True
        moving = moving or bool(own.attrs["moving_nest"])
        places += [(path, index) for index in range(own.sizes["time"])]
        moments.append(own["time"].values)
    times = np.concatenate(moments).astype("datetime64[ns]")
    order = np.argsort(times, kind="stable")
    for i, k in zip(order[:-1], order[1:], strict=True):
        if times[i] == times[k]:
            (one, _), (other, _) = places[i], places[k]
            moment = np.datetime_as_string(times[i], unit="s")
            if one == other:
                raise InputError(
                    f"{one} has the time {moment} twice; cut one of the two out of it."
                )
            raise InputError(f"{one} and {other} both have the time {moment}; give it once.")
    if len(paths) > 1:
        places, times = [places[i] for i in order], times[order]
    return WrfSeries(tuple(places), times, moving)


def _files(given: Sequence[FilePath]) -> list[Path]:
    """Each file once; what is no file but a pattern stands for all files that match it."""
    paths: list[Path] = []
    for one in map(Path, given):
        if one.exists() or not glob.has_magic(str(one)):
            paths.append(one)
            continue
        matching = sorted(path for path in map(Path, glob.glob(str(one))) if path.is_file())
        if not matching:
            raise InputError(f"no file matches {one}; check the pattern.")
        paths += matching
    if not paths:
        raise InputError("no WRF output was given; give one file or more.")
    return list(dict.fromkeys(paths))


def _described(path: Path) -> dict[str, Any]:
    """What files of one grid of one run have in common; None for what a file does not say."""
    with open_netcdf(path) as file:
        sizes = {name: file.sizes.get(name) for name in _DIMENSIONS}
        return sizes | {name: file.attrs.get(name) for name in _ATTRIBUTES}


def _check_alike(first: Path, one: dict[str, Any], other: Path, two: dict[str, Any]) -> None:
    """Raise `InputError` where two files are not of one grid of one run."""
    for name in one:
        if one[name] is not None and two[name] is not None and one[name] != two[name]:
            raise InputError(
                f"{name} is {two[name]} in {other} and {one[name]} in {first}; give files of one "
                "domain of one run."
            )
