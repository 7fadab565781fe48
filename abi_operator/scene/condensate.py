"""A model's condensate by class, and how much of it is simulated as what it is."""

from typing import NamedTuple

import numpy as np
import xarray as xr

from ..constants import FREEZING
from ..files import InputError
from ..nomenclature import HYDROMETEORS, UNSIMULATED

CLASSES = tuple(name for name in HYDROMETEORS if name != "cloud")
"""Classes that are simulated beside liquid cloud."""

_WORDS = HYDROMETEORS | UNSIMULATED

# The scheme whose cloud water and rain are ice and snow below 0 C. (Hong et al. 2004,
# doi:10.1175/1520-0493(2004)132<0103:ARATIM>2.0.CO;2)
_ICE_IN_DISGUISE = "wsm3"
_FROZEN = {"cloud": "ice", "rain": "snow"}


def scheme_of(model: xr.Dataset, microphysics: str | None = None) -> str:
    """Microphysics scheme by which a model is understood: the one that is named, or its own."""
    return microphysics or str(model.attrs.get("microphysics_scheme", "unknown"))


def mixing_ratios(model: xr.Dataset, microphysics: str | None = None) -> dict[str, np.ndarray]:
    """Mass of each class of condensate per mass of dry air (layer, y, x). [kg kg-1]

    Cloud water and rain of WSM3 are ice and snow below 0 C. What is not simulated
    (`nomenclature.UNSIMULATED`) is among them.

    Parameters
    ----------
    model
        A model Dataset.
    microphysics
        Scheme by which it is understood; None for the model's own.
    """
    found = {
        name: model[f"{name}_mixing_ratio"].values
        for name in _WORDS
        if f"{name}_mixing_ratio" in model
    }
    if scheme_of(model, microphysics) == _ICE_IN_DISGUISE:
        frozen = model["layer_temperature"].values < FREEZING
        for liquid, solid in _FROZEN.items():
            if liquid in found:
                found[solid] = found.get(solid, 0) + np.where(frozen, found[liquid], 0)
                found[liquid] = np.where(frozen, 0, found[liquid])
    return found


def classes_present(model: xr.Dataset, microphysics: str | None = None) -> tuple[str, ...]:
    """Classes beside cloud water of which a model Dataset has any mass; see `mixing_ratios`."""
    ratios = mixing_ratios(model, microphysics)
    return tuple(name for name in CLASSES if name in ratios and ratios[name].any())


def check_classes(classes: tuple[str, ...]) -> tuple[str, ...]:
    """Return names of classes, or raise `InputError` for those that are not known."""
    unknown = [name for name in classes if name not in CLASSES]
    if unknown:
        raise InputError(f"hydrometeors {unknown} are not known; choose from {', '.join(CLASSES)}.")
    return classes


class Condensate(NamedTuple):
    """Condensate of a model, summed over layers and columns. [kg m-2]

    Parameters
    ----------
    total
        All condensate.
    left_out
        By kind, what is not simulated; kinds of which there is none are not listed.
    """

    total: float
    left_out: dict[str, float]


def weigh(model_paths: dict[str, np.ndarray], simulated: dict[str, np.ndarray]) -> Condensate:
    """Weigh the condensate of a model that is simulated, and that is not.

    Parameters
    ----------
    model_paths
        Mass of each class in the layers of the model. [kg m-2]
    simulated
        Of these, what is simulated; a class that is missing is left out altogether. [kg m-2]
    """
    left_out = {}
    for name, mass in model_paths.items():
        lost = float((mass - simulated[name]).sum()) if name in simulated else float(mass.sum())
        if lost > 0:
            words = _WORDS[name]
            left_out[f"{words} without number" if name in simulated else words] = lost
    return Condensate(float(sum(mass.sum() for mass in model_paths.values())), left_out)
