"""The door at which the values of a scenario are checked, once, in NumPy."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..files import InputError
from ..files.plausible import PLAUSIBLE
from ..nomenclature import QUALITY_FLAGS
from .species import classes_of, species_of

_INF = float("inf")
_GROUND = PLAUSIBLE["surface_temperature"][:2]
# What a whole column of air weighs. [kg m-2]
_MOST_CONDENSATE = 1.0e4

# Quantity of a plume: smallest and largest value, and how to say so.
_PLUME_RANGES = {
    "brightness": (0.0, 1.0, "0 to 1"),
    "base": (0.0, _INF, "0 m or more"),
    "top": (0.0, _INF, "0 m or more"),
    "extinction_550": (0.0, _INF, "0 m-1 or more"),
    "relative_extinction": (0.0, _INF, "0 or more"),
    "ssa": (0.0, 1.0, "0 to 1"),
    "asymmetry": (-1.0, 1.0, "-1 to 1"),
}
# The same of what a scenario may have.
_OPTIONAL_RANGES = {
    "temperature": (100.0, 500.0, "100 to 500 K"),
    "surface_temperature": (*_GROUND, f"{_GROUND[0]:g} to {_GROUND[1]:g} K"),
    "vapour": (0.0, _INF, "0 kg m-2 or more"),
    "ozone": (0.0, _INF, "0 DU or more"),
    "carbon_dioxide": (0.0, 1.0, "0 to 1"),
    "methane": (0.0, 1.0, "0 to 1"),
    "nitrous_oxide": (0.0, 1.0, "0 to 1"),
}


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
        A scenario with dimensions y and x.
    first_row
        Row of the scene at which this block of it begins; the message counts from there. [-]
    """
    for name, allowed, holds in _requirements(scenario):
        if holds.all():
            continue
        first = tuple(np.argwhere(~holds)[0].tolist())
        value = np.broadcast_to(scenario[name].values, holds.shape)[first]
        dims = scenario[name].dims if scenario[name].ndim == holds.ndim else ("y", "x")
        place = dict(zip(dims, first, strict=True))
        if "y" in place:
            place["y"] += first_row
        where = ", ".join(f"{dim}={index}" for dim, index in place.items())
        raise InputError(
            f"{name} is {value:g}{f' at {where}' if where else ''}; it must be {allowed}."
        )


def _requirements(scenario: xr.Dataset) -> Iterator[Requirement]:
    for name in ("solar_zenith_angle", "view_zenith_angle"):
        yield Requirement(name, "finite", np.isfinite(scenario[name].values))
    for name in ("latitude", "longitude"):
        lowest, highest, _ = PLAUSIBLE[name]
        holds = _between(scenario[name].values, lowest, highest)
        yield Requirement(name, f"{lowest:g} to {highest:g} degrees", holds)
    pressure, height = scenario["pressure"].values, scenario["height"].values
    yield Requirement("pressure", "finite and 0 Pa or more", _between(pressure, 0, _INF))
    yield Requirement("pressure", "larger than in the level above", _rises(pressure))
    yield Requirement("height", "finite", np.isfinite(height))
    yield Requirement("height", "smaller than in the level above", _rises(-height))
    for name in ("liquid", *classes_of(scenario)):
        mass, number = (scenario[f"{name}_{x}_path"].values for x in ("mass", "number"))
        allowed = f"0 to {_MOST_CONDENSATE:g} kg m-2"
        yield Requirement(f"{name}_mass_path", allowed, _between(mass, 0, _MOST_CONDENSATE))
        yield Requirement(f"{name}_number_path", "0 m-2 or more", _between(number, 0, _INF))
        with_mass = (number > 0) | (mass == 0)
        yield Requirement(f"{name}_number_path", "positive where there is mass", with_mass)
    for name, (lowest, highest, allowed) in _OPTIONAL_RANGES.items():
        if name in scenario:
            values = scenario[name].values
            yield Requirement(name, allowed, _between(values, lowest, highest))
    albedo = scenario["surface_albedo"].values
    missing = (scenario["quality_flag"].values & QUALITY_FLAGS["no_albedo"]) > 0
    yield Requirement("surface_albedo", "0 to 1", _between(albedo, 0, 1) | missing)
    for species in species_of(scenario):
        yield from _plume_requirements(scenario, species, height[0] - height[-1])


def _plume_requirements(
    scenario: xr.Dataset, species: str, depth: np.ndarray
) -> Iterator[Requirement]:
    for quantity, (lowest, highest, allowed) in _PLUME_RANGES.items():
        name = f"{species}_{quantity}"
        yield Requirement(name, allowed, _between(scenario[name].values, lowest, highest))
    top, base = scenario[f"{species}_top"].values, scenario[f"{species}_base"].values
    yield Requirement(f"{species}_top", "above the plume's base", np.asarray(top > base))
    allowed = f"within the column, which is {depth.min():.0f} m deep"
    yield Requirement(f"{species}_top", allowed, top <= depth)


def _between(values: np.ndarray, lowest: float, highest: float) -> np.ndarray:
    """Where finite values lie in a closed range."""
    return np.asarray(np.isfinite(values) & (values >= lowest) & (values <= highest))


def _rises(values: np.ndarray) -> np.ndarray:
    """Where values are larger than the one before along the first axis."""
    return np.concatenate([np.ones_like(values[:1], bool), values[1:] > values[:-1]])
