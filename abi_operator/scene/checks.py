"""The door at which the values of a scenario are checked, once, in NumPy."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..files import InputError
from ..nomenclature import QUALITY_FLAGS
from ..ranges import FINITE, STATE, WEATHER, Range
from .background import QUANTITIES
from .species import classes_of, species_of

_OF_PLUMES = (
    "brightness",
    "base",
    "top",
    "extinction_550",
    "relative_extinction",
    "ssa",
    "asymmetry",
)
_OF_GASES = "vapour", "ozone", "carbon_dioxide", "methane", "nitrous_oxide"
# Those of states, in degrees.
_ZENITH = Range(0.0, 180.0, "[]", "degrees")
_ANGLES = {
    "solar_zenith_angle": _ZENITH,
    "view_zenith_angle": _ZENITH,
    "relative_azimuth_angle": Range(-360.0, 360.0, "[]", "degrees"),
}
# What a scenario may have.
_OPTIONAL = {name: WEATHER[name] for name in ("temperature", "surface_temperature")}
_OPTIONAL |= {name: STATE[name] for name in _OF_GASES}
_OPTIONAL |= {"fire_fraction": STATE["fraction"], "water_share": STATE["water_share"]}
_OPTIONAL |= {"wind_speed": WEATHER["wind_speed"]}
_OPTIONAL |= dict.fromkeys(("volume_kernel_weight", "geometric_kernel_weight"), FINITE)


class Requirement(NamedTuple):
    """What a variable must be, in words, and where it is so."""

    name: str
    allowed: str
    holds: np.ndarray


def check_scenario(scenario: xr.Dataset, first_row: int = 0) -> None:
    """Raise `InputError` naming the first variable, column and value that cannot be simulated.

    Parameters
    ----------
    scenario
        A scenario with dimensions y and x, or ``column`` in their place.
    first_row
        Row of the scene at which this block of it begins; the message counts from there. [-]
    """
    for name, allowed, holds in _requirements(scenario):
        if holds.all():
            continue
        first = tuple(np.argwhere(~holds)[0].tolist())
        value = np.broadcast_to(scenario[name].values, holds.shape)[first]
        whole = scenario[name].ndim == holds.ndim
        dims = scenario[name].dims if whole else scenario["latitude"].dims
        place = dict(zip(dims, first, strict=True))
        if "y" in place:
            place["y"] += first_row
        where = ", ".join(f"{dim}={index}" for dim, index in place.items())
        raise InputError(
            f"{name} is {value:g}{f' at {where}' if where else ''}; it must be {allowed}."
        )


def _requirements(scenario: xr.Dataset) -> Iterator[Requirement]:
    for name, allowed in _ANGLES.items():
        yield _inside(name, scenario[name].values, allowed)
    for name in ("latitude", "longitude"):
        yield _inside(name, scenario[name].values, WEATHER[name])
    pressure, height = scenario["pressure"].values, scenario["height"].values
    yield _inside("pressure", pressure, STATE["pressure"])
    yield Requirement("pressure", "larger than in the level above", _rises(pressure))
    yield _inside("height", height, STATE["height"])
    yield Requirement("height", "smaller than in the level above", _rises(-height))
    for name in ("liquid", *classes_of(scenario)):
        mass, number = (scenario[f"{name}_{x}_path"].values for x in ("mass", "number"))
        yield _inside(f"{name}_mass_path", mass, WEATHER["mass_path"])
        yield _inside(f"{name}_number_path", number, STATE["number_path"])
        with_mass = (number > 0) | (mass == 0)
        yield Requirement(f"{name}_number_path", "positive where there is mass", with_mass)
    for name, allowed in _OPTIONAL.items():
        if name in scenario:
            yield _inside(name, scenario[name].values, allowed)
    if "background_aod_550" in scenario:
        for quantity in QUANTITIES:
            name = f"background_{quantity}"
            yield _inside(name, scenario[name].values, STATE[quantity])
    if "fire_fraction" in scenario:
        hot = _inside("fire_temperature", scenario["fire_temperature"].values, STATE["temperature"])
        yield hot._replace(holds=hot.holds | (scenario["fire_fraction"].values == 0))
    albedo = _inside("surface_albedo", scenario["surface_albedo"].values, STATE["albedo"])
    missing = (scenario["quality_flag"].values & QUALITY_FLAGS["no_albedo"]) > 0
    yield albedo._replace(holds=albedo.holds | missing)
    for species in species_of(scenario):
        yield from _plume_requirements(scenario, species, height[0] - height[-1])


def _plume_requirements(
    scenario: xr.Dataset, species: str, depth: np.ndarray
) -> Iterator[Requirement]:
    for quantity in _OF_PLUMES:
        name = f"{species}_{quantity}"
        yield _inside(name, scenario[name].values, STATE[quantity])
    top, base = scenario[f"{species}_top"].values, scenario[f"{species}_base"].values
    yield Requirement(f"{species}_top", "above the plume's base", np.asarray(top > base))
    allowed = f"within the column, which is {depth.min():.0f} m deep"
    yield Requirement(f"{species}_top", allowed, top <= depth)


def _inside(name: str, values: np.ndarray, allowed: Range) -> Requirement:
    """That values are in a range."""
    return Requirement(name, allowed.words, np.asarray(allowed.holds(values)))


def _rises(values: np.ndarray) -> np.ndarray:
    """Where values are larger than the one before along the first axis."""
    return np.concatenate([np.ones_like(values[:1], bool), values[1:] > values[:-1]])
