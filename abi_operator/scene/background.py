"""Aerosol beside the plumes as variables of a scenario: the same in all columns."""

import numpy as np
import xarray as xr

from ..files import InputError
from ..files.netcdf import cf_attributes
from ..optics import background_aerosol
from ..ranges import STATE

QUANTITIES = ("aod_550", "scale_height", "relative_extinction", "ssa", "asymmetry")
"""Fields of `BackgroundAerosol`, as variables behind ``background_``."""
BY_BAND = ("relative_extinction", "ssa", "asymmetry")
"""Those of them that are specified by band."""


def check_background_aerosol(aod_550: float | None) -> None:
    """Raise `InputError` unless an optical depth is none or in the range of one."""
    if aod_550 is not None:
        check_aod_550(aod_550, "the background aerosol")


def check_aod_550(aod_550: float, whose: str) -> None:
    """Raise `InputError` unless an optical depth at 550 nm is in its range. [-]"""
    allowed = STATE["aod_550"]
    if not allowed.holds(aod_550):
        raise InputError(
            f"the optical depth of {whose} is {aod_550:g}; it must be {allowed.words}."
        )


def background_variables(aod_550: float, bands: tuple[str, ...]) -> dict[str, xr.DataArray]:
    """Variables of a background aerosol (`optics.background_aerosol`) for a scenario.

    Parameters
    ----------
    aod_550
        Its optical depth at 550 nm. [-]
    bands
        Bands of the scenario.
    """
    check_background_aerosol(aod_550)
    aerosol = background_aerosol(aod_550, bands=bands)
    found = {}
    for quantity in QUANTITIES:
        value, name = getattr(aerosol, quantity), f"background_{quantity}"
        by_band = quantity in BY_BAND
        values = np.array([value[band] for band in bands] if by_band else value, np.float64)
        dims = ("band",) if by_band else ()
        found[name] = xr.DataArray(values, dims=dims, attrs=cf_attributes(name))
    return found


def background_attribute(aod_550: float) -> dict[str, str]:
    """What is said of it."""
    words = f"optical depth {aod_550:g} at 550 nm, falling by 1 / e in 2 km, optics of smoke"
    return {"background_aerosol": words}
