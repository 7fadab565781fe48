"""What values a model's variables can have, and what is said of those they cannot.

The ranges are meant to let all weather pass and to stop what is no weather: values that were never
written, that are in other units, or that a broken run left. Each is wider than what has been
observed, by more than a model errs, and narrower than a mistake in units would leave it.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..nomenclature import HYDROMETEORS, UNSIMULATED
from ..ranges import SHARE, WEATHER
from .errors import InputError

# What NetCDF's library puts where a float or double was never written (NC_FILL_FLOAT in netcdf.h).
_NEVER_WRITTEN = 9.969209968386869e36


class Range(NamedTuple):
    """Plausible values of a variable, in its units.

    Parameters
    ----------
    lowest, highest
        The range, ends included.
    traces
        How far below it are values that advection leaves, which count as `lowest`.
    """

    lowest: float
    highest: float
    traces: float = 0.0


# Of a range, what rounding in float32 may leave beyond its ends. [-]
_ROUNDING = 1e-6

# Advection that is not made to stay positive undershoots beside a steep edge (Skamarock and Weisman
# 2009, doi:10.1175/2008MWR2583.1, on WRF's, and on the water that comes of taking it for zero). A
# hundredth of the step is taken for that: -8e-14 kg kg-1 is usual behind a microphysics scheme that
# clips, and -3e-6 has been left where none does. Steps are 1e-3 kg kg-1 in clouds, 1e8 droplets and
# 1e6 other particles per kilogram.
_MASS_TRACES = 1e-5
_NUMBER_TRACES = {"cloud": 1e6}
_OTHER_NUMBER_TRACES = 1e4

# Cloud is what air of 30 g kg-1 of vapour, as moist as over the warmest seas, can condense at once;
# what falls gathers in a layer. [kg kg-1]
_MOST_MASS = {"cloud": 0.03, "ice": 0.03, "rain": 0.05, "snow": 0.05, "graupel": 0.1, "hail": 0.1}
_MOST_MASS |= dict.fromkeys(UNSIMULATED, 0.1)  # rimed ice, too
# Ten times the 1e4 droplets per cubic centimetre of clouds over fires, which may all freeze. [kg-1]
_MOST_NUMBER = {"cloud": 1e11, "ice": 1e11}
_OTHER_MOST_NUMBER = 1e10
# [m]
_LARGEST_RADIUS = {"cloud": 1e-3, "ice": 1e-3, "rain": 1e-2, "snow": 1e-2, "graupel": 1e-2}
_LARGEST_RADIUS |= {"hail": 0.1}

_SHARES = "surface_emissivity", "land_mask", "broadband_albedo", "sea_ice", "snow_cover"

PLAUSIBLE: dict[str, Range] = {
    **{
        name: Range(*WEATHER[name][:2]) for name in ("latitude", "longitude", "surface_temperature")
    },
    **{name: Range(*SHARE[:2]) for name in _SHARES},
    # From 80 km to the shore of the Dead Sea, where it is 1070 hPa.
    "layer_pressure": Range(1.0, 1.1e5),
    # From the top of Mount Everest, where it is 330 hPa.
    "surface_pressure": Range(3.0e4, 1.1e5),
    "height": Range(-1.0e3, 1.0e5),
    # From the mesopause to air that a fire has heated; cloud tops have been seen at 162 K (Proud
    # and Bachmeier 2021, doi:10.1029/2020GL092261), the polar stratosphere is at 180 K.
    "layer_temperature": Range(130.0, 500.0),
    # Of a gust on Barrow Island on 10 April 1996, 113 m/s, the strongest outside of a tornado.
    **{name: Range(-150.0, 150.0) for name in ("wind_along_x", "wind_along_y")},
    "land_use": Range(0, 255),  # of one byte in the files that models take it from
    "snow_mass": Range(0, 1e5),  # ice sheets, where a model does not stop counting before
    # A dew point of 43 degrees C at 1000 hPa; the highest observed, in Dhahran on 8 July 2003, is
    # 35, which is 0.037 kg kg-1.
    "vapour_mixing_ratio": Range(0, 0.06, _MASS_TRACES),
    **{f"{name}_mixing_ratio": Range(0, most, _MASS_TRACES) for name, most in _MOST_MASS.items()},
    **{
        f"{name}_number_mixing_ratio": Range(
            0,
            _MOST_NUMBER.get(name, _OTHER_MOST_NUMBER),
            _NUMBER_TRACES.get(name, _OTHER_NUMBER_TRACES),
        )
        for name in HYDROMETEORS
    },
    **{f"{name}_effective_radius": Range(0, _LARGEST_RADIUS[name]) for name in HYDROMETEORS},
}
"""Variable of a model Dataset: its plausible values, in the units of `nomenclature.MODEL`."""


def plausible(name: str) -> Range:
    """Plausible values of a variable, all that are finite where the table does not have it."""
    return PLAUSIBLE.get(name, Range(-np.inf, np.inf))


def check_written(values: np.ndarray, origin: str, where: Callable[..., str]) -> None:
    """Raise `InputError` where values are missing, infinite, or were never written.

    Parameters
    ----------
    values
        What was read, NaN where the file says that there is nothing.
    origin
        Variable and file, as the message is to call them.
    where
        What to call the place of a value, given its index in `values`.
    """
    if np.isfinite(values.sum()) and abs(values).max(initial=0) < 0.9 * _NEVER_WRITTEN:
        return
    for wrong, words in (
        (np.isnan(values), "is missing (NaN, or the fill value that the file names)"),
        (np.isinf(values), "is infinite"),
        (
            np.isclose(values, _NEVER_WRITTEN, rtol=1e-6),
            f"was never written (it is NetCDF's own fill value, {_NEVER_WRITTEN:.5g})",
        ),
    ):
        if wrong.any():
            raise InputError(
                f"{origin} {words} {_place(wrong, where)}; repair it, or leave it out of the file "
                "if nothing needs it."
            )


def check_values(
    values: np.ndarray, allowed: Range, units: str, origin: str, where: Callable[..., str]
) -> None:
    """Raise `InputError` for the first value that is not plausible.

    Parameters
    ----------
    values
        Of one variable, finite.
    allowed
        What is plausible.
    units
        Of the values.
    origin, where
        As in `check_written`.
    """
    lowest = allowed.lowest - allowed.traces
    rounding = _ROUNDING * (allowed.highest - allowed.lowest)
    wrong = (values < lowest - rounding) | (values > allowed.highest + rounding)
    if not wrong.any():
        return
    value = values[tuple(np.argwhere(wrong)[0])]
    unit = "" if units == "1" else f" {units}"
    slack = f", or {lowest:g} as advection leaves it" if allowed.traces and value < 0 else ""
    raise InputError(
        f"{origin} is {value:.6g}{unit} {_place(wrong, where)}; plausible is {allowed.lowest:g} to "
        f"{allowed.highest:g}{unit}{slack}: check its units, and the run that wrote it."
    )


def without_traces(values: np.ndarray, allowed: Range) -> tuple[np.ndarray, dict]:
    """Values with what advection leaves below the range set to its end, and attributes that tell.

    Returns
    -------
    The values, and ``num_negative_set_to_zero`` and, where there are any, ``smallest_negative``.
    """
    below = values < allowed.lowest
    attributes: dict[str, int | float] = {"num_negative_set_to_zero": int(below.sum())}
    if below.any():
        attributes["smallest_negative"] = float(values.min())
        values = np.where(below, allowed.lowest, values)
    return values, attributes


def _place(wrong: np.ndarray, where: Callable[..., str]) -> str:
    """Where the first wrong value is, and how many there are."""
    first = tuple(np.argwhere(wrong)[0].tolist())
    return f"at {where(first)} ({np.count_nonzero(wrong)} of the {wrong.size} values read)"
