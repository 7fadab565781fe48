"""Which variables of a scene go into its result, and in what precision.

Most of a result is the state in which it was computed, by layer and level. It is kept, as a
retrieval starts from it, in single precision, as models write it; and it is rounded before it is
simulated (`rounded`), so that what is in the file is the truth to the last digit. Double precision
have the reflectance factor and the depths of plumes, by which retrievals without noise are judged,
and the angles, whose cosines vanish at the horizon.
"""

from collections.abc import Collection, Sequence

import numpy as np
import xarray as xr

from ..nomenclature import BY_BAND, MODEL, OPTIONAL, SCENARIO, variable
from .errors import InputError

ALL, IMAGE = "all", "image"

_DOUBLE = (
    "reflectance_factor",
    "solar_zenith_angle",
    "view_zenith_angle",
    "relative_azimuth_angle",
)
_DOUBLE_ENDING = "_aod_550"
_ALWAYS = "quality_flag"
# Go along with whatever is kept.
_COORDINATES = ("time", "latitude", "longitude", *BY_BAND)
_VERTICAL = {"layer", "level"}


def check_variables(
    names: Sequence[str], present: Collection[str] | None = None
) -> tuple[str, ...]:
    """Return the names as a tuple, or raise `InputError` where one is none of a result's.

    Parameters
    ----------
    names
        As `stored` takes them.
    present
        All that the result has, or will have; None for what any may have.
    """
    names = tuple(names)
    if names in ((ALL,), (IMAGE,)):
        return names
    of_models = set(MODEL) - set(SCENARIO) - set(OPTIONAL)
    unknown = [name for name in names if variable(name) is None or name in of_models]
    if unknown or not names:
        raise InputError(
            f"variables {unknown} are not those of a result; give {ALL}, {IMAGE} or names such as "
            "reflectance_factor,radiance (abi_operator/nomenclature.py has all of them)."
        )
    missing = [] if present is None else [name for name in names if name not in present]
    if missing:
        raise InputError(
            f"the result has no {', '.join(missing)}; choose of "
            f"{', '.join(sorted(set(present or ()) - {*_COORDINATES}))}."
        )
    return names


def rounded(scenario: xr.Dataset) -> xr.Dataset:
    """A scenario with the values that its result will keep, in double precision."""
    fields = {
        name: array.astype(np.float32).astype(np.float64)
        for name, array in _singles(scenario, keep_double=True).items()
    }
    return scenario.assign(fields)


def stored(result: xr.Dataset, names: Sequence[str] = (ALL,)) -> xr.Dataset:
    """The part of a result that its file keeps.

    Parameters
    ----------
    result
        Of `scene.simulate`, from a scenario that is `rounded`.
    names
        ``("all",)`` for everything; ``("image",)`` for all that has neither layers nor levels, in
        single precision throughout; or names of variables, likewise. Positions, bands and
        ``quality_flag`` go along.

    Raises
    ------
    InputError
        Where the result has no variable of a name.
    """
    everything = tuple(names) == (ALL,)
    kept = result
    if tuple(names) == (IMAGE,):
        kept = result.drop_vars([n for n, a in result.variables.items() if _VERTICAL & {*a.dims}])
    elif not everything:
        names = check_variables(names, {str(name) for name in result.variables})
        along_bands = {name: result[name] for name, a in result.coords.items() if "band" in a.dims}
        data = [name for name in dict.fromkeys([*names, _ALWAYS]) if name in result.data_vars]
        kept = result[data].assign_coords(along_bands)
    fields = _singles(kept, keep_double=everything)
    return kept.assign({name: array.astype(np.float32) for name, array in fields.items()})


def _singles(dataset: xr.Dataset, *, keep_double: bool) -> dict[str, xr.DataArray]:
    """Variables of a scene's columns that are kept in single precision."""
    names = (
        str(name)
        for name, array in dataset.variables.items()
        if "y" in array.dims and array.ndim > 1 and array.dtype.kind == "f"
    )
    return {
        name: dataset[name]
        for name in names
        if not (keep_double and (name in _DOUBLE or name.endswith(_DOUBLE_ENDING)))
    }
