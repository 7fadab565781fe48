"""What a result must have for a study: one time, all that the columns are made of, the bands."""

from collections.abc import Sequence

import xarray as xr

from ..files import InputError
from ..nomenclature import PLUME, QUALITY_FLAGS, SCENARIO
from ..scene import classes_of, species_of

DARK = QUALITY_FLAGS["night"] | QUALITY_FLAGS["no_albedo"] | QUALITY_FLAGS["out_of_sight"]
"""Flags of pixels whose sunlight was not simulated."""


def check_result(image: xr.Dataset, needed: Sequence[str], bands: Sequence[str] = ()) -> None:
    """Raise `InputError` where a result has several times, or not all that a study reads.

    Parameters
    ----------
    image
        Result of a simulation.
    needed
        Variables, such as those `of_columns` and the `pixel_kinds.depths_of` hydrometeors.
    bands
        Bands that are looked at.
    """
    if "time" in image.dims:
        raise InputError(f"one time at a time is looked at; the result has {image.sizes['time']}.")
    missing = [name for name in dict.fromkeys(needed) if name not in image.variables]
    if missing:
        raise InputError(
            f"the result has no {', '.join(missing)}; keep all of it (abi-operator simulate "
            "without --variables)."
        )
    lacking = sorted(set(bands) - set(image["band"].values.tolist()))
    if lacking:
        raise InputError(f"the result has no band {', '.join(lacking)}; simulate it.")


def of_columns(image: xr.Dataset) -> list[str]:
    """Variables that states of the columns are made of, as far as they must be there."""
    plumes = [f"{species}_{name}" for species in species_of(image) for name in PLUME]
    classes = [f"{name}_{x}_path" for name in classes_of(image) for x in ("mass", "number")]
    return [*SCENARIO, *plumes, *classes]
