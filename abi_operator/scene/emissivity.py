"""Albedo of the ground in C07, where it shines: one less its emissivity."""

import warnings

import numpy as np
import xarray as xr

from ..files import InputError
from ..ranges import SHARE
from ..surface import EMISSIVITY_3900NM
from .land import FROM_MODEL, emissivity_by_land_use
from .snow_and_ice import sea_ice_cover, snow_cover

BY_LAND_USE = "land-use"
"""The emissivity to name where that of each column's land use is meant."""

Emissivity = float | str
"""A number [-], a type in `surface.EMISSIVITY_3900NM`, `FROM_MODEL` or `BY_LAND_USE`."""


def check_emissivity(emissivity: Emissivity | None, model: xr.Dataset | None = None) -> None:
    """Raise `InputError` for an emissivity that is none, or that the model does not have.

    Parameters
    ----------
    emissivity
        What was asked for.
    model
        A model Dataset; None where only what was asked for is to be looked at.
    """
    if emissivity is None:
        raise InputError(
            "C07 needs the emissivity of the ground: name a number, a type of surface "
            f"({', '.join(EMISSIVITY_3900NM)}), {BY_LAND_USE!r} for that of each column's land "
            f"use, or {FROM_MODEL!r} for the model's own."
        )
    if emissivity == FROM_MODEL:
        if model is not None and "surface_emissivity" not in model:
            raise InputError(
                "the model has no emissivity of its own (EMISS in WRF's files); name a number or a "
                "type of surface."
            )
    elif emissivity == BY_LAND_USE:
        if model is not None:
            emissivity_by_land_use(model)
    elif isinstance(emissivity, str):
        if emissivity not in EMISSIVITY_3900NM:
            raise InputError(
                f"no emissivity is known of {emissivity!r}; name a number, one of "
                f"{', '.join(EMISSIVITY_3900NM)}, {BY_LAND_USE!r} for that of each column's land "
                f"use, or {FROM_MODEL!r} for the model's own."
            )
    elif not SHARE.holds(emissivity):
        raise InputError(f"the emissivity is {emissivity:g}; it must be {SHARE.words}.")


def thermal_albedo(model: xr.Dataset, emissivity: Emissivity) -> tuple[np.ndarray, str]:
    """Albedo in C07 (y, x), 1 - emissivity [-]; and where it comes from.

    MODIS has no albedo at 3.9 um. An emissivity that is a number or a type of surface is that of
    land where the model has a land mask, and water has its own; without a mask it is that of all
    columns. By land use each column has that of its own type of surface, water among them. Snow on
    the ground and ice on the sea have that of snow, for their share of a column (ice without snow
    has 0.976 by Fresnel's law). The model's emissivity is of the whole thermal infrared, which is
    warned of: soil and sand emit less at 3.9 um.

    Parameters
    ----------
    model
        A model Dataset.
    emissivity
        What was asked for, checked.
    """
    check_emissivity(emissivity, model)
    if emissivity == FROM_MODEL:
        warnings.warn(
            "the emissivity in C07 is the model's, which is of the whole thermal infrared.",
            UserWarning,
            stacklevel=2,
        )
        return 1 - model["surface_emissivity"].values, "the model's broadband one"
    if emissivity == BY_LAND_USE:
        value, name = (
            emissivity_by_land_use(model),
            f"by land use ({model.attrs['land_use_scheme']})",
        )
    elif isinstance(emissivity, str):
        value = EMISSIVITY_3900NM[emissivity]
        name = f"{value:g} ({emissivity})"
    else:
        value, name = emissivity, f"{emissivity:g}"
    ice, water = sea_ice_cover(model), EMISSIVITY_3900NM["water"]
    if "land_mask" in model:
        bare = np.where((model["land_mask"].values > 0) & (ice == 0), value, water)
        source = f"{name} over land, {water:g} over water"
    else:
        bare, source = np.full(ice.shape, value), f"{name} in all columns"
    snow = EMISSIVITY_3900NM["snow"]
    frozen = np.where(ice > 0, ice, snow_cover(model))
    if frozen.any():
        source += f"; {snow:g} over snow and ice"
    return 1 - ((1 - frozen) * bare + frozen * snow), source
