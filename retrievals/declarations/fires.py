"""Fires: temperature and burning share, and what the ground beside them is assumed to be."""

from collections.abc import Sequence

from jaxtyping import Array, Float

from abi_operator import Fire

from ..quantities import Derived, Quantity, itself, replaced
from ..state_vector import StateVector
from ..transforms import Bounded, Unbounded
from .ground import albedo

STEFAN_BOLTZMANN = 5.670374419e-8
"""Exact in the SI of 2019: CODATA 2018. [W m-2 K-4]"""


def fire() -> StateVector:
    """State vector of a fire: its temperature, and the share of the pixel that burns.

    What surrounds it, the temperature and the albedo of the ground, is known from the state. A
    state needs a `Fire`, with any values, temperatures, and the bands C05, C06 or C07.
    """
    temperature = Quantity(
        "fire_temperature",
        "K",
        "temperature of the fire",
        "fire.temperature",
        Bounded(350.0, 1800.0),
        replaced,
        sigma=1.0,
        mean=800.0,
        get=itself,
        starts=(500.0, 700.0, 1000.0),
    )
    fraction = Quantity(
        "fire_fraction",
        "1",
        "share of the pixel that burns",
        "fire.fraction",
        Bounded(1e-7, 1.0, logarithmic=True),
        replaced,
        sigma=0.5,
        mean=1e-3,
        get=itself,
        starts=(3e-4, 3e-3, 3e-2),
    )
    power = Derived(
        "fire_emitted_power",
        "W m-2",
        "power that a black fire of this temperature and share emits per area of the pixel",
        "fire",
        emitted_power,
    )
    return StateVector((temperature, fraction), (power,))


def assumed_of_fire(bands: Sequence[str]) -> StateVector:
    """What a retrieval of a fire assumes of the ground: its albedo, to 0.01, and its heat, to 1 K.

    A fire emits 1 minus the albedo of what a black one would.
    """
    ground = Quantity(
        "surface_temperature",
        "K",
        "temperature of the ground beside the fire",
        "surface_temperature",
        Unbounded(),
        replaced,
        sigma=1.0,
        get=itself,
    )
    return StateVector((*(albedo(band) for band in bands), ground))


def emitted_power(fire: Fire) -> Float[Array, "*batch"]:
    """Power of a black fire per area of the pixel, p sigma T^4, better known than both. [W m-2]

    A fire emits 1 minus the ground's albedo of that in a band, and an albedo is known in the bands
    alone: what a fire emits at all wavelengths is as much less as its mean emissivity is below 1.
    """
    return STEFAN_BOLTZMANN * fire.fraction * fire.temperature**4
