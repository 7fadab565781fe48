"""Which pixels of an image are retrieved, and why the others are not."""

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
import xarray as xr

from .observation import UNUSABLE
from .results import ResultCode

Where = Literal["plume", "cloud", "all"]
WHERE: tuple[Where, ...] = get_args(Where)
"""Where an image is retrieved, see `usable`."""


def check_where(where: str, allowed: Sequence[str]) -> None:
    """Raise `ValueError` where it is none of those that are allowed."""
    if where not in allowed:
        raise ValueError(f"where must be one of {', '.join(allowed)}; got {where!r}.")


def usable(
    image: xr.Dataset,
    bands: tuple[str, ...],
    species: str | None,
    where: Where,
) -> np.ndarray:
    """Result code of the pixels that are not to be attempted, 0 (success) elsewhere.

    Parameters
    ----------
    image
        A result of one time.
    bands
        Bands that are to be used.
    species
        Name of the plume, None if none is retrieved.
    where
        ``"plume"``: only where the specified plume is (its brightness above 0), as if a plume mask
        had been made beforehand, and everywhere if none is retrieved; ``"cloud"``: only where there
        is cloud water; ``"all"``: everywhere.

    Raises
    ------
    ValueError
        Where `where` is none of these.
    """
    check_where(where, WHERE)
    codes = np.full((image.sizes["y"], image.sizes["x"]), ResultCode.SUCCESS, np.int8)
    measured = image["reflectance_factor"].sel(band=list(bands)).transpose("band", "y", "x")
    codes[~np.isfinite(measured.values).any(axis=0)] = ResultCode.INVALID_INPUT
    codes[(image["quality_flag"].values & UNUSABLE) != 0] = ResultCode.UNUSABLE
    if where == "plume" and species is not None:
        codes[~(image[f"{species}_brightness"].values > 0)] = ResultCode.NO_PLUME
    if where == "cloud":
        codes[~(image["liquid_mass_path"].sum("layer").values > 0)] = ResultCode.NO_PLUME
    return codes
