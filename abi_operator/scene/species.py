"""Plumes as variables of a scenario, one species after the other; which of them there are."""

from typing import NamedTuple

import jax
import numpy as np
import xarray as xr

from ..atmosphere import Plume
from ..files import InputError
from ..files.netcdf import cf_attributes
from ..nomenclature import PLUME

_HORIZONTAL_WEIGHT = "_brightness"
_MASS = "_mass_path"
_LIQUID = "liquid"


class PlumeSpecification(NamedTuple):
    """One plume of a scene: what it is, and where.

    Parameters
    ----------
    plume
        As `abi_operator.smoke` or `abi_operator.ash` makes it, with scalars: the same in all
        columns.
    brightness
        Horizontal weight (y, x) of the whole scene, 0 to 1, which multiplies the plume's. [-]
    """

    plume: Plume
    brightness: np.ndarray


def species_of(dataset: xr.Dataset) -> tuple[str, ...]:
    """Names of the species whose plumes a scenario has, in alphabetical order."""
    return _beginnings(dataset, _HORIZONTAL_WEIGHT)


def classes_of(dataset: xr.Dataset) -> tuple[str, ...]:
    """Classes of hydrometeors that a scenario has beside liquid cloud, in alphabetical order."""
    return tuple(name for name in _beginnings(dataset, _MASS) if name != _LIQUID)


def _beginnings(dataset: xr.Dataset, ending: str) -> tuple[str, ...]:
    names = (str(name) for name in dataset.data_vars)
    return tuple(sorted(name.removesuffix(ending) for name in names if name.endswith(ending)))


def plume_variables(
    species: str, specification: PlumeSpecification, bands: tuple[str, ...], rows: slice
) -> dict[str, xr.DataArray]:
    """Variables of one species for the rows of a block.

    Parameters
    ----------
    species
        Such as ``"smoke"``, with which the variables' names begin.
    specification
        The plume in the whole scene.
    bands
        Bands, in each of which the plume is specified.
    rows
        The rows of the scene that the block holds.
    """
    plume = specification.plume
    for leaf in jax.tree.leaves(plume):
        if np.ndim(leaf) != 0:
            raise ValueError(f"the plume {species!r} is specified by scalars; got {leaf!r}.")
    values = {}
    for quantity, entry in PLUME.items():
        value = getattr(plume, quantity)
        if entry.dims == ("band",):
            missing = [band for band in bands if band not in value]
            if missing:
                raise InputError(f"{quantity} of the plume {species!r} lacks bands {missing}.")
            value = np.array([value[band] for band in bands], dtype=np.float64)
        values[quantity] = np.asarray(value, dtype=np.float64)
    values["brightness"] = values["brightness"] * np.asarray(specification.brightness)[rows]
    return {
        f"{species}_{quantity}": xr.DataArray(
            value, dims=PLUME[quantity].dims, attrs=cf_attributes(f"{species}_{quantity}")
        )
        for quantity, value in values.items()
    }
