"""By which theory the liquid cloud of a scene scatters: an attribute of scenarios and results."""

import xarray as xr

from ..atmosphere import LIQUID_OPTICS
from ..files import InputError

ATTRIBUTE = "cloud_optics"


def cloud_optics_of(dataset: xr.Dataset) -> str:
    """Optics of the liquid cloud in a scenario or result, as `LiquidCloud` takes it.

    What its attribute ``cloud_optics`` says; where there is none, the default. (Results older than
    the attribute were of ``"mitchell"``; to be retrieved from they need it.)

    Raises
    ------
    InputError
        Where the attribute is no such name.
    """
    return check_cloud_optics(str(dataset.attrs.get(ATTRIBUTE, LIQUID_OPTICS[0])))


def check_cloud_optics(name: str) -> str:
    """Return a name of optics of liquid cloud, or raise `InputError` for any other."""
    if name not in LIQUID_OPTICS:
        raise InputError(
            f"cloud optics {name!r} are not known; choose from {', '.join(LIQUID_OPTICS)}."
        )
    return name
