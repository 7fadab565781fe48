"""The same ground with a little more, or less, that it reflects evenly to all sides."""

from dataclasses import replace
from typing import Any

from jaxtyping import Array, Float

from ..lambertian import Lambertian
from .land_and_sea import LandAndSea
from .ocean import Ocean
from .ross_li import RossLi


def brightened(ground: Any, change: Float[Array, "*#batch"]) -> Any:
    """A ground whose reflectance is larger by one number in all directions, and so is its albedo.

    Parameters
    ----------
    ground
        Albedo of a Lambertian ground, or any of this room's surfaces.
    change
        What is added to it, below 0 to make it darker. [-]
    """
    if isinstance(ground, LandAndSea):
        return replace(
            ground, land=brightened(ground.land, change), sea=brightened(ground.sea, change)
        )
    if isinstance(ground, RossLi):
        return replace(ground, f_iso=ground.f_iso + change)
    if isinstance(ground, Ocean):
        return replace(
            ground,
            water_reflectance=ground.water_reflectance + change,
            foam_reflectance=ground.foam_reflectance + change,
        )
    if isinstance(ground, Lambertian):
        return replace(ground, albedo=ground.albedo + change)
    return ground + change
