"""The table of fires: where they burn, how hot, on how much ground, and when."""

import csv
from collections.abc import Callable, Iterator
from os import PathLike
from typing import Any

import numpy as np
import xarray as xr

from ..nomenclature import FIRE_TABLE
from ..ranges import WEATHER, Range
from .errors import InputError
from .utc import utc_time

_ALLOWED = {
    "latitude": WEATHER["latitude"],
    "longitude": WEATHER["longitude"],
    # From a bed of embers to metals that burn.
    "temperature": Range(400.0, 3000.0, "[]", "K"),
    "area": Range(0.0, 1.0e10, "(]", "m2"),
}
_TIMES = "start", "end"


def read_fires(path: str | PathLike[str]) -> xr.Dataset:
    """Read a table of fires, a text file with commas (CSV) whose first line names its columns.

    ``latitude`` and ``longitude`` [degrees north and east], ``temperature`` of the flames [K] and
    the ``area`` that burns [m2] have to be there, in any order; ``start`` and ``end``, times in UTC
    such as 2007-10-23T18:00, may be, and may be empty: the fire burns from the one to just before
    the other.

    Returns
    -------
    xarray.Dataset
        The variables of `nomenclature.FIRE_TABLE` along ``fire``; times that are not given are NaT.

    Raises
    ------
    InputError
        Where there is no such table, or a line of it has no fire.
    """
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            rows = list(_rows(file, path))
    except FileNotFoundError as error:
        raise InputError(f"{path} does not exist; check the path.") from error
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path} cannot be read as a table with commas ({error}).") from error
    if not rows:
        raise InputError(f"{path} has no fire; give each a line below that of the names.")
    columns = {name: np.array([row[name] for row in rows]) for name in (*_ALLOWED, *_TIMES)}
    return xr.Dataset({name: ("fire", x, _attributes(name)) for name, x in columns.items()})


def _attributes(name: str) -> dict[str, str]:
    entry = FIRE_TABLE[name]
    units = {"units": entry.units} if entry.units else {}
    return units | {"long_name": entry.long_name}


def _rows(file: Any, path: object) -> Iterator[dict[str, Any]]:
    reader = csv.DictReader(file, skipinitialspace=True, strict=True)
    names = [name.strip() for name in reader.fieldnames or ()]
    missing = [name for name in _ALLOWED if name not in names]
    unknown = [name for name in names if name not in FIRE_TABLE]
    if missing or unknown or len(set(names)) < len(names):
        raise InputError(
            f"the first line of {path} has to name {', '.join(_ALLOWED)}, each once, and may name "
            f"{' and '.join(_TIMES)}; it has {', '.join(names) or 'nothing'}."
        )
    reader.fieldnames = names
    for row in reader:
        where = f"{path}, line {reader.line_num}"
        if None in row or None in row.values():
            raise InputError(f"{where} has another number of values than the first line has names.")
        found: dict[str, Any] = {name: _value(row[name], name, where) for name in _ALLOWED}
        found |= {name: _time(row.get(name) or "", name, where) for name in _TIMES}
        if found["end"] <= found["start"]:
            raise InputError(f"{where}: the fire ends at {found['end']}, which is not after start.")
        yield found


def _value(text: str, name: str, where: str) -> float:
    value, allowed = _parsed(float, text, name, where, "a number"), _ALLOWED[name]
    if not allowed.holds(value):
        raise InputError(f"{where}: {name} is {value:g}; it must be {allowed.words}.")
    return value


def _time(text: str, name: str, where: str) -> np.datetime64:
    if not text.strip():
        return np.datetime64("NaT", "ns")
    return _parsed(_in_utc, text.strip(), name, where, "a time such as 2007-10-23T18:00")


def _in_utc(text: str) -> np.datetime64:
    time = utc_time(text.removesuffix("Z"))
    if np.isnat(time):
        raise ValueError
    return time


def _parsed(parse: Callable[[str], Any], text: str, name: str, where: str, what: str) -> Any:
    try:
        return parse(text)
    except ValueError:
        raise InputError(f"{where}: {name} is {text!r}; it must be {what}.") from None
