"""By which theory clouds of a scene scatter: two attributes of scenarios and results."""

import xarray as xr

from ..atmosphere import ICE_OPTICS, LIQUID_OPTICS
from ..files import InputError

_KNOWN = {"cloud_optics": LIQUID_OPTICS, "ice_optics": ICE_OPTICS}


def cloud_optics_of(dataset: xr.Dataset) -> str:
    """Optics of the liquid cloud in a scenario or result, as `LiquidCloud` takes it.

    What its attribute ``cloud_optics`` says; where there is none, the default. (Results older than
    the attribute were of ``"mitchell"``; to be retrieved from they need it.)

    Raises
    ------
    InputError
        Where the attribute is no such name.
    """
    return check_cloud_optics(str(dataset.attrs.get("cloud_optics", LIQUID_OPTICS[0])))


def ice_optics_of(dataset: xr.Dataset) -> str:
    """The same of its crystals, as `Hydrometeor` takes it: what its ``ice_optics`` says."""
    return check_ice_optics(str(dataset.attrs.get("ice_optics", ICE_OPTICS[0])))


def optics_attributes(cloud_optics: str, ice_optics: str) -> dict[str, str]:
    """Both as the attributes that are read by these functions."""
    return {"cloud_optics": cloud_optics, "ice_optics": ice_optics}


def check_cloud_optics(name: str) -> str:
    """Return a name of optics of liquid cloud, or raise `InputError` for any other."""
    return _checked("cloud_optics", name)


def check_ice_optics(name: str) -> str:
    """Return a name of optics of ice, or raise `InputError` for any other."""
    return _checked("ice_optics", name)


def _checked(what: str, name: str) -> str:
    if name not in _KNOWN[what]:
        raise InputError(
            f"{what.replace('_', ' ')} {name!r} are not known; choose from "
            f"{', '.join(_KNOWN[what])}."
        )
    return name
