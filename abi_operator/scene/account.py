"""What a scenario had to assume or leave out: attributes that add over the blocks of a scene."""

from collections.abc import Iterable, Iterator, Mapping

import numpy as np
import xarray as xr

from ..nomenclature import MODEL
from .hydrometeors import Hydrometeors

Attribute = str | int | float

COUNTED_OVER = "counted_over"
"""Attribute of a scene of several times: over how many of them its counts are sums."""

_TOTAL = "condensate_mass"
_SHARES = {"unsimulated_condensate_share": "unsimulated_condensate_mass"}


def condensate_account(found: Hydrometeors) -> dict[str, Attribute]:
    """Attributes that tell which of a model's condensate is simulated, and by what assumptions.

    Masses are sums over columns [kg m-2], shares refer to all condensate [-].
    """
    classes = [name for name in found.paths if name != "cloud"]
    weighed = found.condensate
    attributes: dict[str, Attribute] = {
        "hydrometeors": "; ".join(["cloud", *classes]),
        "microphysics": found.scheme,
        _TOTAL: weighed.total,
        "unsimulated_condensate_mass": sum(weighed.left_out.values(), 0.0),
    }
    if weighed.left_out:
        attributes["unsimulated_condensate"] = "; ".join(weighed.left_out)
    attributes |= {
        f"assumed_{name}_number_count": found.paths[name].num_assumed
        for name in classes
        if found.paths[name].num_assumed
    }
    return _with_shares(attributes)


def condensate_warnings(found: Hydrometeors) -> list[str]:
    """Sentences to warn with, which are the same in all blocks of a scene that have the kinds."""
    return [
        f"{kind} of the model is not simulated (unsimulated_condensate_share tells how much)."
        for kind in found.condensate.left_out
    ]


def negative_account(model: xr.Dataset) -> dict[str, Attribute]:
    """Attributes that tell of the small negative numbers in a model's output that count as 0.

    By variable of the model, ``negative_{name}_count`` says of how many cells, and
    ``smallest_negative_{name}`` how far below 0, in the units of `nomenclature.MODEL`.
    """
    attributes: dict[str, Attribute] = {}
    for name, array in model.data_vars.items():
        if array.attrs.get("num_negative_set_to_zero"):
            attributes[f"negative_{name}_count"] = int(array.attrs["num_negative_set_to_zero"])
            attributes[f"smallest_negative_{name}"] = float(array.attrs["smallest_negative"])
    return attributes


def negative_lines(account: Mapping[str, Attribute]) -> Iterator[str]:
    """The same, in a line for each variable."""
    for name, entry in MODEL.items():
        if f"negative_{name}_count" in account:
            yield (
                f"{name.replace('_', ' ')} below 0, taken as 0: in "
                f"{account[f'negative_{name}_count']} cells, down to "
                f"{account[f'smallest_negative_{name}']:.2g} {entry.units}"
            )


def pressure_range(top_pressure: np.ndarray) -> dict[str, Attribute]:
    """Attributes that tell from where the columns were completed. [Pa]"""
    return {
        "smallest_model_top_pressure": float(top_pressure.min()),
        "largest_model_top_pressure": float(top_pressure.max()),
    }


def add_accounts(datasets: Iterable[Mapping[str, Attribute]]) -> dict[str, Attribute]:
    """Attributes of a scene from those of its blocks.

    Attributes that end in ``_count`` or ``_mass`` are added, shares derived anew, the ``smallest_``
    and ``largest_`` kept; texts that differ are listed, other numbers are the last block's.
    """
    scene: dict[str, Attribute] = {}
    for attributes in datasets:
        for name, value in attributes.items():
            scene[name] = _joined(name, scene[name], value) if name in scene else value
    return _with_shares(scene)


def _joined(name: str, one: Attribute, other: Attribute) -> Attribute:
    """One attribute of two blocks."""
    if isinstance(one, str) or isinstance(other, str):
        return "; ".join(dict.fromkeys([*str(one).split("; "), *str(other).split("; ")]))
    if name.startswith("smallest_"):
        return min(one, other)
    if name.startswith("largest_"):
        return max(one, other)
    return one + other if name.endswith(("_count", "_mass")) else other


def _with_shares(attributes: dict[str, Attribute]) -> dict[str, Attribute]:
    """Derive shares from the masses that are there."""
    total = attributes.get(_TOTAL, 0.0)
    shares = {
        share: float(attributes[mass]) / float(total) if total else 0.0
        for share, mass in _SHARES.items()
        if mass in attributes
    }
    return attributes | shares


def model_attributes(model: xr.Dataset) -> dict[str, Attribute]:
    """What a model Dataset says of the run, under names that tell so."""
    return {f"model_{name}": value for name, value in model.attrs.items()}


def droplet_account(condensate: Hydrometeors, model: xr.Dataset) -> dict[str, Attribute]:
    """What was assumed of the number of droplets."""
    droplets = condensate.droplets
    return {
        "assumed_droplet_number": droplets.number.describe(model),
        "assumed_droplet_number_source": droplets.source,
        "assumed_droplet_number_count": condensate.paths["cloud"].num_assumed,
    }
