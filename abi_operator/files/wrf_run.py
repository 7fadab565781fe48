"""When a WRF file is, and what it says of the run that wrote it."""

import numpy as np
import xarray as xr

from .errors import InputError
from .netcdf import FilePath, load_finite
from .utc import utc_time

SCHEMES: dict[int, str] = {
    1: "kessler",
    2: "lin",
    3: "wsm3",
    4: "wsm5",
    6: "wsm6",
    7: "goddard",
    8: "thompson",
    9: "milbrandt",
    10: "morrison",
    14: "wdm5",
    16: "wdm6",
    17: "nssl",
    18: "nssl",
    22: "nssl",
    28: "thompson",  # aware of aerosol, which adds the number of droplets
    40: "morrison",  # likewise
    50: "p3",
    51: "p3",
    52: "p3",
    55: "ishmael",
}
"""MP_PHYSICS, WRF's number of a microphysics scheme: its name. (Registry.EM_COMMON of WRF)"""

ADVICE = "give a WRF output file (wrfout_*) that holds them"
"""What to do about a file that lacks what is needed."""


_SECONDS = {"seconds": 1, "minutes": 60, "hours": 3600, "days": 86400}
_SINCE = " since "


def times_of(file: xr.Dataset, path: FilePath) -> np.ndarray:
    """The times of a file, from `Times` or, failing that, from `XTIME` in the units that it has:
    minutes since the start of the run where they do not say."""
    if "Times" in file:
        texts = [
            text.decode("latin-1") if isinstance(text, bytes) else str(text)
            for text in np.atleast_1d(file["Times"].values)
        ]
        return np.array([_time(text, "Times", path) for text in texts])
    start = file.attrs.get("SIMULATION_START_DATE", file.attrs.get("START_DATE"))
    units = str(file["XTIME"].attrs.get("units", "")).strip() if "XTIME" in file else ""
    unit, since, reference = units.partition(_SINCE)
    if "XTIME" not in file or (start is None and not since):
        raise InputError(f"{path} has no Times, nor XTIME with SIMULATION_START_DATE; {ADVICE}.")
    step = _SECONDS.get(unit.strip() or "minutes")
    if step is None:
        raise InputError(
            f"XTIME in {path} is in {units!r}; it should be in minutes since the start of the run, "
            f"or in {', '.join(_SECONDS)}{_SINCE}a time."
        )
    begin = (
        _time(reference, "the units of XTIME", path)
        if since
        else _time(str(start), "SIMULATION_START_DATE", path)
    )
    seconds = np.rint(step * np.atleast_1d(load_finite(file["XTIME"], path)).astype(float))
    return begin + seconds.astype("timedelta64[s]").astype("timedelta64[ns]")


def _time(text: str, name: str, path: FilePath) -> np.datetime64:
    """Parse WRF's way of writing a time, ``2007-10-23_18:00:00``."""
    time = utc_time(text.strip("\0 ").replace("_", "T"))
    if np.isnat(time):
        raise InputError(
            f"{name} in {path} is {text!r}, which is no time of 1678 to 2261; "
            "it should be written as 2007-10-23_18:00:00."
        )
    return time


def moves(file: xr.Dataset) -> bool:
    """Whether the grid is elsewhere at another time."""
    corners = {"south_north": [0, -1], "west_east": [0, -1]}
    return any(
        "Time" in file[name].dims and bool(np.ptp(file[name].isel(corners).values, axis=0).any())
        for name in ("XLAT", "XLONG")
    )


def run_attributes(file: xr.Dataset) -> dict[str, str | int]:
    """What later steps need to know of the run."""
    attributes: dict[str, str | int] = {}
    if "TITLE" in file.attrs:
        attributes["title"] = str(file.attrs["TITLE"]).strip()
    if "MP_PHYSICS" in file.attrs:
        number = int(file.attrs["MP_PHYSICS"])
        attributes["microphysics_scheme"] = SCHEMES.get(number, f"MP_PHYSICS={number}")
    if "BOTTOM-TOP_GRID_DIMENSION" in file.attrs:
        num_levels = int(file.attrs["BOTTOM-TOP_GRID_DIMENSION"])
        attributes["bottom_top_levels_of_run"] = num_levels - 1
    if "MMINLU" in file.attrs:
        attributes["land_use_scheme"] = str(file.attrs["MMINLU"]).strip("\0 ")
    return attributes
