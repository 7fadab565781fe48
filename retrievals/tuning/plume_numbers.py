"""The few numbers of a plume that a whole image tells: each one for all of its pixels."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from abi_operator import BANDS, Plume

from ..declarations.plumes import effective_radius_um, lifted, ssa_shift
from ..quantities import Derived, Quantity, itself
from ..state_vector import StateVector
from ..transforms import Bounded, Unbounded

LARGEST_FACTOR = 10.0
"""The optical depth of a plume may become so many times what it was, or its inverse. [-]"""
HIGHEST = 20e3
"""No plume is higher above the ground. [m]"""

THINNEST = 1.0
"""No plume is made thinner: without any thickness its extinction would be infinite. [m]"""

_REFERENCE_UM = 0.55


def plume_numbers(names: Sequence[str], species: str, plume: Plume) -> StateVector:
    """State vector of numbers that are the same in all pixels.

    Parameters
    ----------
    names
        Some of `NUMBERS`.
    species
        Name of the plume.
    plume
        The plume as the scene has it, in one of its pixels, from which its heights are known.

    Raises
    ------
    ValueError
        Where a name is unknown or there twice, heights are asked for that exclude each other, or
        the plume lies on the ground and cannot be shifted.
    """
    names = tuple(names)
    unknown = [name for name in names if name not in NUMBERS]
    if unknown or not names:
        raise ValueError(
            f"what is fitted is some of {', '.join(NUMBERS)}; got {', '.join(unknown) or 'none'}."
        )
    if len(set(names)) < len(names):
        raise ValueError(f"each number is fitted once; got {', '.join(names)}.")
    if {"height", "top"} <= set(names):
        raise ValueError(
            "height moves both edges of the plume and top the upper one; fit one of them."
        )
    # The last one is put into a state first: what a radius sets the others refine.
    ordered = sorted(names, key=list(NUMBERS).index)
    quantities = tuple(NUMBERS[name](species, plume) for name in ordered)
    derived = []
    if "ssa" in names:
        place = f"atmosphere.plumes.{species}.ssa"
        words = f"single-scattering albedo of the {species} plume"
        derived.append(Derived("ssa", "1", words, place, itself))
    return StateVector(quantities, tuple(derived))


def _strength(species: str, _: Plume) -> Quantity:
    return Quantity(
        "strength",
        "1",
        f"factor on the optical depth of the {species} plume",
        f"atmosphere.plumes.{species}",
        Bounded(1 / LARGEST_FACTOR, LARGEST_FACTOR, logarithmic=True),
        strengthened,
        sigma=0.6,  # a factor of two
        mean=1.0,
    )


def _ssa(species: str, _: Plume) -> Quantity:
    return ssa_shift(species)


def _height(species: str, plume: Plume) -> Quantity:
    base, top = float(plume.base), float(plume.top)
    if not base > 0:
        raise ValueError(
            f"the {species} plume begins on the ground, so that it has no height to shift; fit top."
        )
    middle, half = (base + top) / 2, (top - base) / 2
    limits = half, max(HIGHEST, middle + half)
    return Quantity(
        "height",
        "m",
        f"height above the ground of the middle of the {species} plume, its thickness kept",
        f"atmosphere.plumes.{species}",
        Bounded(*limits),
        with_middle,
        sigma=_sigma(limits, middle),
        mean=middle,
    )


def _top(species: str, plume: Plume) -> Quantity:
    base, top = float(plume.base), float(plume.top)
    # At the lower limit, too, it is a plume: doublings are those that its extremes need.
    limits = base + min(THINNEST, (top - base) / 2), max(HIGHEST, 2 * top - base)
    return Quantity(
        "top",
        "m",
        f"height above the ground of the upper edge of the {species} plume, its base kept",
        f"atmosphere.plumes.{species}",
        Bounded(*limits),
        with_top,
        sigma=_sigma(limits, top),
        mean=top,
    )


def _angstrom(species: str, _: Plume) -> Quantity:
    return Quantity(
        "angstrom_shift",
        "1",
        f"change of the Angstrom exponent of the {species} plume's extinction",
        f"atmosphere.plumes.{species}.relative_extinction",
        Unbounded(),
        steeper,
        sigma=0.5,
        mean=0.0,
    )


def _radius(species: str, _: Plume) -> Quantity:
    return effective_radius_um(species)


NUMBERS = {
    "strength": _strength,
    "ssa": _ssa,
    "height": _height,
    "top": _top,
    "angstrom": _angstrom,
    "radius": _radius,
}
"""What can be fitted: a factor on the optical depth, one shift of the logit of the
single-scattering albedo in all bands, the height of the middle or of the upper edge, a change of
the Angstrom exponent, and the effective radius of Mie tables, from which extinction by wavelength,
single-scattering albedo and asymmetry factor are then taken, in place of the scene's."""

SPREAD_OF_HEIGHT = 1500.0
"""Standard deviation of heights where nobody says more. [m]"""


def _sigma(limits: tuple[float, float], value: float) -> float:
    """Standard deviation of x that is `SPREAD_OF_HEIGHT` at a height."""
    transform = Bounded(*limits)
    slope = transform.slope(transform.x(jnp.asarray(value, float)))
    return SPREAD_OF_HEIGHT / float(slope)


def strengthened(plume: Plume, value: Float[Array, "*batch"]) -> Plume:
    """A plume of so many times the optical depth."""
    return eqx.tree_at(lambda p: p.extinction_550, plume, plume.extinction_550 * value)


def with_middle(plume: Plume, value: Float[Array, "*batch"]) -> Plume:
    """A plume with its middle at a height, of the same thickness and optical depth. [m]"""
    moved = lifted(plume, value - (plume.base + plume.top) / 2)
    assert isinstance(moved, Plume)
    return moved


def with_top(plume: Plume, value: Float[Array, "*batch"]) -> Plume:
    """A plume with its upper edge at a height, of the same optical depth. [m]"""
    thinner = plume.extinction_550 * (plume.top - plume.base) / (value - plume.base)
    return eqx.tree_at(lambda p: (p.top, p.extinction_550), plume, (value, thinner))


def steeper(
    relative_extinction: dict[str, Array], value: Float[Array, "*batch"]
) -> dict[str, Array]:
    r"""Extinction times :math:`(\lambda / 0.55\,\mu m)^{-s}`, which keeps that at 550 nm."""
    return {
        band: extinction * (BANDS[band].wavelength_um / _REFERENCE_UM) ** -value
        for band, extinction in relative_extinction.items()
    }
