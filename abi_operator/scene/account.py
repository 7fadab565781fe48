"""What a scenario had to assume or leave out: attributes that add over the blocks of a scene."""

from collections.abc import Iterable, Mapping

import numpy as np
import xarray as xr

from .liquid import Condensate

Attribute = str | int | float

_TOTAL = "condensate_mass"
_SHARES = {
    "unsimulated_condensate_share": "unsimulated_condensate_mass",
    "ice_as_droplets_share": "ice_as_droplets_mass",
}


def condensate_account(weighed: Condensate) -> dict[str, Attribute]:
    """Attributes that tell how much of a model's condensate is simulated as what it is.

    Masses are sums over columns [kg m-2], shares refer to all condensate [-].
    """
    attributes: dict[str, Attribute] = {
        _TOTAL: weighed.total,
        "unsimulated_condensate_mass": sum(weighed.left_out.values()),
        "ice_as_droplets_mass": weighed.ice_as_droplets,
    }
    if weighed.left_out:
        attributes["unsimulated_condensate"] = "; ".join(weighed.left_out)
    return _with_shares(attributes)


def condensate_warnings(weighed: Condensate) -> list[str]:
    """Sentences to warn with, which are the same in all blocks of a scene that have the kinds."""
    sentences = [
        f"{kind} of the model is not simulated (unsimulated_condensate_share tells how much)."
        for kind in weighed.left_out
    ]
    if weighed.ice_as_droplets > 0:
        sentences.append(
            "cloud water below 0 C is ice in this model's microphysics (WSM3), but is simulated as "
            "droplets (ice_as_droplets_share tells how much)."
        )
    return sentences


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
