"""Land by what the model tells of it: an albedo of last resort, and types by land use."""

import warnings

import numpy as np
import xarray as xr

from ..files import InputError
from ..ranges import SHARE
from ..surface import EMISSIVITY_3900NM, LAND_USE

FROM_MODEL = "model"
"""What to name where the model's own albedo or emissivity is meant."""

LandAlbedo = float | str
"""Albedo of land: a number [-] for all bands, or `FROM_MODEL`."""


def check_land_albedo(albedo: LandAlbedo | None, model: xr.Dataset | None = None) -> None:
    """Raise `InputError` for an albedo of land that is none, or that the model does not have.

    Parameters
    ----------
    albedo
        What was asked for.
    model
        A model Dataset; None where only what was asked for is to be looked at.
    """
    if albedo == FROM_MODEL:
        if model is not None and "broadband_albedo" not in model:
            raise InputError(
                "the model has no albedo of its own (ALBEDO in WRF's files); name a number."
            )
    elif isinstance(albedo, str):
        raise InputError(
            f"no albedo of land is known by the name of {albedo!r}; name a number, or "
            f"{FROM_MODEL!r} for the model's own."
        )
    elif albedo is not None and not SHARE.holds(albedo):
        raise InputError(f"the albedo of land is {albedo:g}; it must be {SHARE.words}.")


def with_last_resort(
    values: np.ndarray, model: xr.Dataset, land: np.ndarray, albedo: LandAlbedo
) -> tuple[np.ndarray, str, dict[str, int]]:
    """Albedo (band, y, x) with what was missing on land filled in; its source; how many columns.

    The model's own albedo is one for all sunlight, which is warned of: plants reflect ten times as
    much beyond 0.7 um as below.

    Parameters
    ----------
    values
        Albedo (band, y, x), NaN where there is none. [-]
    model
        A model Dataset.
    land
        True where it may be filled in (y, x).
    albedo
        Checked.
    """
    check_land_albedo(albedo, model)
    missing = np.isnan(values) & land
    counts = {"last_resort_albedo_count": int(missing.any(axis=0).sum())}
    if albedo != FROM_MODEL:
        return np.where(missing, albedo, values), f"land without any other {albedo:g}", counts
    if missing.any():
        warnings.warn(
            "the albedo of land is the model's, which is one for all sunlight "
            "(last_resort_albedo_count tells in how many columns): plants reflect ten times as "
            "much in the near infrared as below it.",
            UserWarning,
            stacklevel=4,
        )
    own = model["broadband_albedo"].values
    return np.where(missing, own, values), "land without any other the model's broadband", counts


def emissivity_by_land_use(model: xr.Dataset) -> np.ndarray:
    """Emissivity near 3.9 um (y, x) of the types of surface that the model's land use is. [-]

    Raises
    ------
    InputError
        Where the model does not tell of its land use, or by a scheme or number that is not known.
    """
    if "land_use" not in model or "land_use_scheme" not in model.attrs:
        raise InputError(
            "the model does not tell of its land use (LU_INDEX or IVGTYP in WRF's files, with the "
            "attribute MMINLU); name a number or a type of surface."
        )
    scheme = model.attrs["land_use_scheme"]
    if scheme not in LAND_USE:
        raise InputError(
            f"the model's land use is by {scheme!r}; known are only {', '.join(LAND_USE)}; name a "
            "number or a type of surface."
        )
    categories = model["land_use"].values
    emissivity = np.full(categories.shape, np.nan)
    for number, name in LAND_USE[scheme].items():
        emissivity[categories == number] = EMISSIVITY_3900NM[name]
    unknown = np.isnan(emissivity)
    if unknown.any():
        raise InputError(
            f"the model's land use is {categories[unknown][0]:g} in {unknown.sum()} of the "
            f"{unknown.size} columns read, which is no category of {scheme}; name a number or a "
            "type of surface."
        )
    return emissivity
