"""Inputs that have short names: of plumes, ground, cloud and gases, of angles and of fires."""

from collections.abc import Callable
from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..atmosphere import State
from ..ranges import STATE
from .ground_albedo import albedo
from .inputs import Input, added, factor, leaf, part, several

_DEGREE = np.pi / 180
# Of a plume's picture: what is fainter has no strength that could be a depth, as nobody drew it.
_FAINTEST = 1e-6


def aod_550(species: str, step: float = 0.1) -> Input:
    """Optical depth of a plume at 550 nm, also where its picture has none.

    What changes is the plume's extinction. Its brightness stays what it is, so that an input that
    multiplies or adds to it means the same beside this one; where it is 0 there is no extinction
    that gives a depth, and it becomes 1.
    """
    place = f"atmosphere.plumes.{species}"

    def change(state: State, by: Array) -> State:
        plume = part(state, place)
        drawn = plume.brightness >= _FAINTEST
        brightness = jnp.where(drawn, plume.brightness, 1)
        own = plume.extinction_550 * jnp.where(drawn, 1, plume.brightness)
        more = by / (brightness * (plume.top - plume.base))
        new = replace(plume, brightness=brightness, extinction_550=own + more)
        return eqx.tree_at(lambda s: part(s, place), state, new)

    def holds(state: State) -> np.ndarray:
        return np.asarray(STATE["aod_550"].holds(np.asarray(part(state, place).aod_550)))

    words = f"optical depth of the {species} plume at 550 nm"
    return Input(
        "aod_550", "1", words, step, change, lambda state: part(state, place).aod_550, holds
    )


def declared(name: str, species: str | None = None) -> Input:
    """The input of a short name, of a band as ``ssa_C03``, or of any place as ``leaf`` takes it.

    Parameters
    ----------
    name
        One of `SHORT_NAMES`, those of `BY_BAND` with a band behind them, or a place, which is
        changed by factors.
    species
        Name of the plume that is meant.

    Raises
    ------
    ValueError
        Where the name is none of these, or a plume is meant and none is named.
    """
    if "." in name:
        return factor(name, 0.01)
    quantity, _, band = name.rpartition("_")
    if quantity in BY_BAND and name not in SHORT_NAMES:
        if quantity == "albedo":
            return albedo(band)
        every = declared(quantity, species)
        place, step = _BY_BAND[quantity]
        place = f"{place.format(species=species)}.{band}"
        return leaf(place, step, name=name, long_name=f"{every.long_name} {band} alone")
    if name not in SHORT_NAMES:
        raise ValueError(
            f"no input {name!r}; choose from {', '.join(SHORT_NAMES)}, from "
            f"{', '.join(f'{x}_C03' for x in BY_BAND)}, or a path such as atmosphere.gases.methane."
        )
    if name in _OF_PLUMES and species is None:
        raise ValueError(f"{name} is of a plume, and the scene has none of that name.")
    return _DECLARED[name](species or "")


# Places of what a plume has by band, and steps. [-]
_BY_BAND = {
    "ssa": ("atmosphere.plumes.{species}.ssa", 0.01),
    "asymmetry": ("atmosphere.plumes.{species}.asymmetry", 0.02),
}
BY_BAND = (*_BY_BAND, "albedo")
"""Short names that take a band, too."""


def _plume_height(species: str) -> Input:
    places = tuple(f"atmosphere.plumes.{species}.{end}" for end in ("base", "top"))
    words = f"height of the {species} plume, base and top"
    return several(places, added, 500.0, "plume_height", "m", words, 1.0)


def _by_band(name: str, words: str) -> Callable[[str], Input]:
    place, step = _BY_BAND[name]

    def of(species: str) -> Input:
        long_name = f"{words.format(species=species)} in all bands"
        return leaf(place.format(species=species), step, name=name, long_name=long_name)

    return of


def _angle(name: str, words: str) -> Callable[[str], Input]:
    def of(_species: str) -> Input:
        place = f"geometry.{name}"
        return leaf(place, 1.0, name=name, units="degree", long_name=words, scale=_DEGREE)

    return of


def _plain(place: str, step: float, name: str, words: str) -> Callable[[str], Input]:
    return lambda _species: leaf(place, step, name=name, long_name=words)


def _relative(place: str, step: float, name: str, words: str) -> Callable[[str], Input]:
    return lambda _species: factor(place, step, name=name, long_name=words)


_DECLARED: dict[str, Callable[[str], Input]] = {
    "aod_550": aod_550,
    "ssa": _by_band("ssa", "single-scattering albedo of the {species} plume"),
    "asymmetry": _by_band("asymmetry", "asymmetry factor of the {species} plume"),
    "plume_height": _plume_height,
    "albedo": lambda _species: albedo(),
    "liquid_mass": _relative(
        "atmosphere.liquid.mass_path", 0.1, "liquid_mass", "relative change of cloud water"
    ),
    "droplet_number": _relative(
        "atmosphere.liquid.number_path", 0.1, "droplet_number", "relative change of cloud droplets"
    ),
    "vapour": _relative("atmosphere.gases.vapour", 0.1, "vapour", "relative change of vapour"),
    "ozone": _relative("atmosphere.gases.ozone", 0.1, "ozone", "relative change of ozone"),
    "solar_zenith": _angle("solar_zenith", "solar zenith angle"),
    "view_zenith": _angle("view_zenith", "satellite zenith angle"),
    "relative_azimuth": _angle("relative_azimuth", "azimuth between satellite and sun"),
    "fire_fraction": _plain("fire.fraction", 0.01, "fire_fraction", "share that burns"),
    "fire_temperature": _plain("fire.temperature", 25.0, "fire_temperature", "of the flames"),
}
SHORT_NAMES = tuple(_DECLARED)
"""Inputs with a short name."""
_OF_PLUMES = ("aod_550", "ssa", "asymmetry", "plume_height")
