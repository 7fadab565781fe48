"""Temperature and absorbing gases of a model's columns, completed to the top of the atmosphere."""

import warnings

import numpy as np
import xarray as xr

from ..files import InputError
from ..optics import ALL_GASES
from ..radiance import WARMEST_WITHOUT_FIRE
from .column_air import dry_air_path
from .standard_profile import StandardProfile

# Height over which the difference between a model and the standard atmosphere fades above the
# model's top. [m]
_FADING_HEIGHT = 5e3

_NO_GASES = "none"


def gases_of(dataset: xr.Dataset) -> tuple[str, ...]:
    """Gases that absorb in a scenario or result.

    Those that its attribute ``gases`` names; all where there is none; none where the Dataset has no
    vapour.
    """
    if "vapour" not in dataset:
        return ()
    names = str(dataset.attrs.get("gases", " ".join(ALL_GASES)))
    return () if names == _NO_GASES else tuple(names.split())


def gases_attribute(gases: tuple[str, ...]) -> str:
    """Gases as the attribute that `gases_of` reads."""
    return " ".join(gases) or _NO_GASES


def check_gases(gases: tuple[str, ...]) -> tuple[str, ...]:
    """Return names of gases, or raise `InputError` for those that are not known."""
    unknown = [name for name in gases if name not in ALL_GASES]
    if unknown:
        raise InputError(f"gases {unknown} are not known; choose from {', '.join(ALL_GASES)}.")
    return gases


def level_temperature(
    model: xr.Dataset, height: np.ndarray, standard: StandardProfile
) -> np.ndarray:
    r"""Temperature at the levels of completed columns (level, y, x). [K]

    Linear in height between the model's mid-layers, and beyond the outermost ones up to the model's
    top and down to the ground. Above the top, at height :math:`h_t`, the difference to the standard
    atmosphere fades, :math:`T(h) = T_s(h) + (T(h_t) - T_s(h_t)) \exp(-(h - h_t) / 5\ \mathrm{km})`.

    Parameters
    ----------
    model
        A model Dataset.
    height
        Of the levels (level, y, x), of which the lowest are the model's, top first. [m]
    standard
        What is above.
    """
    layers = model["layer_temperature"].values
    own = model["height"].values
    middle = (own[1:] + own[:-1]) / 2
    if len(layers) == 1:
        levels = np.repeat(layers, 2, axis=0)
    else:
        slope = np.diff(layers, axis=0) / np.diff(middle, axis=0)
        inner = layers[1:] + slope * (own[1:-1] - middle[1:])
        top = layers[:1] + slope[:1] * (own[:1] - middle[:1])
        ground = layers[-1:] + slope[-1:] * (own[-1:] - middle[-1:])
        levels = np.concatenate([top, inner, ground])
    above = height[: len(height) - len(own)]
    difference = levels[0] - standard.temperature_at(own[0])
    fading = np.exp(-(above - own[0]) / _FADING_HEIGHT)
    return np.concatenate([standard.temperature_at(above) + difference * fading, levels])


def gas_amounts(
    model: xr.Dataset, height: np.ndarray, standard: StandardProfile
) -> dict[str, np.ndarray]:
    """Vapour and ozone of the layers (layer, y, x), and mole fractions of the other gases ().

    Vapour is the model's, and above its top that of the standard atmosphere times what the model's
    uppermost layer has of it. Ozone is the standard atmosphere's from the ground up.

    Parameters
    ----------
    model, height, standard
        As in `level_temperature`.

    Returns
    -------
    ``vapour`` [kg m-2], ``ozone`` [DU], ``carbon_dioxide``, ``methane`` and ``nitrous_oxide`` [-].
    """
    own = dry_air_path(model) * model["vapour_mixing_ratio"].values
    published = standard.vapour_between(height)
    num_added = len(height) - len(own) - 1
    at_top = published[num_added]
    share = np.where(at_top > 0, own[0] / np.where(at_top > 0, at_top, 1), 1)
    return {
        "vapour": np.concatenate([share * published[:num_added], own]),
        "ozone": standard.ozone_between(height),
        "carbon_dioxide": np.asarray(standard.carbon_dioxide),
        "methane": np.asarray(standard.methane),
        "nitrous_oxide": np.asarray(standard.nitrous_oxide),
    }


def has_hot_ground(model: xr.Dataset) -> bool:
    """Whether the ground of a model shines in C05 and C06 somewhere, as a fire would (`light`)."""
    if "surface_temperature" not in model:
        return False
    return bool(np.any(model["surface_temperature"].values > WARMEST_WITHOUT_FIRE))


def air_fields(
    model: xr.Dataset,
    height: np.ndarray,
    standard: StandardProfile,
    gases: tuple[str, ...],
    *,
    emits: bool,
) -> tuple[dict[str, np.ndarray], dict[str, str | int | float]]:
    """What only gases and emission need of the air and the ground, and what was assumed of it.

    Parameters
    ----------
    model, height, standard
        A model Dataset, heights of the completed levels (level, y, x) [m], and the profile that
        completes it.
    gases
        Gases that absorb.
    emits
        Whether something shines in the bands that are simulated.
    """
    fields: dict[str, np.ndarray] = {}
    attributes: dict[str, str | int | float] = {}
    if gases:
        fields |= gas_amounts(model, height, standard)
    if gases or emits:
        fields["temperature"] = level_temperature(model, height, standard)
        attributes["standard_atmosphere"] = standard.name
    if emits and "surface_temperature" in model:
        fields["surface_temperature"] = model["surface_temperature"].values
        attributes["surface_temperature_source"] = "the model's"
    elif emits:
        fields["surface_temperature"] = fields["temperature"][-1]
        attributes["surface_temperature_source"] = "that of the air at the ground"
        warnings.warn(
            "the model has no temperature of the ground (TSK in WRF's files); it is taken to be "
            "that of the air.",
            UserWarning,
            stacklevel=3,
        )
    return fields, attributes
