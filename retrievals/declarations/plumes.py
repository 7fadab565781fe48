"""Plumes of smoke, ash and dust: how much there is, how it absorbs, how large its particles are."""

from collections.abc import Sequence
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from abi_operator import MiePlume, Plume
from abi_operator.optics import mie_optics

from ..mass_loading import DENSITY, MassLoading
from ..quantities import Derived, Quantity, itself, logit_shifted
from ..results import expected_error
from ..state_vector import StateVector
from ..transforms import Bounded, Unbounded
from .ground import albedo

SCANNED_AOD_550 = (0.02, 0.06, 0.15, 0.35, 0.8, 1.8, 4.5)
"""Optical depths of a scan; those above a limit are left out. [-]"""
AOD_LIMIT = 10.0
"""Optical depth that plumes stay below where nothing else is asked for. [-]"""

# Effective radii that a table is meant for, and where a scan looks. [um]
_RADII = {"smoke": (0.043, 0.56), "ash": (0.28, 17.9), "dust": (0.28, 17.9)}
_SCANNED_RADII = {"smoke": (0.08, 0.14, 0.25), "ash": (1.0, 3.0, 8.0), "dust": (0.7, 1.5, 4.0)}
_MEAN_RADIUS = {"smoke": 0.14, "ash": 3.0, "dust": 1.5}


def plume(
    species: str,
    *,
    ssa: bool = False,
    effective_radius: bool = False,
    aod_limit: float = AOD_LIMIT,
) -> StateVector:
    """State vector of a plume: optical depth, and what else is asked for.

    Parameters
    ----------
    species
        Name of the plume in the state: ``"smoke"``, ``"ash"`` or ``"dust"`` where the effective
        radius is asked for.
    ssa
        Whether its single-scattering albedo is retrieved; not of a `MiePlume`, which has none of
        its own.
    effective_radius
        Whether its effective radius is; of ash and dust the mass loading follows.
    aod_limit
        Optical depths from here on are out of reach. [-]
    """
    quantities, derived = [aod_550(species, aod_limit)], []
    if ssa:
        quantities.append(ssa_shift(species))
        place = f"atmosphere.plumes.{species}.ssa"
        derived.append(
            Derived("ssa", "1", f"single-scattering albedo of the {species} plume", place, itself)
        )
    if effective_radius:
        if species not in _RADII:
            raise ValueError(f"no Mie table of {species!r}; choose from {list(_RADII)}.")
        quantities.append(effective_radius_um(species))
        if species in DENSITY:
            words = f"mass of the {species} plume, at {DENSITY[species]:g} kg m-3"
            needs = ("aod_550", "effective_radius_um")
            place, read = f"atmosphere.plumes.{species}", MassLoading(species)
            derived.append(Derived("mass_loading", "g m-2", words, place, read, needs))
    return StateVector(tuple(quantities), tuple(derived))


def aod_550(species: str, limit: float = AOD_LIMIT) -> Quantity:
    """Optical depth of a plume at 550 nm; a success is known to the expected error of MODIS.

    Parameters
    ----------
    species
        Name of the plume in the state.
    limit
        Optical depths from here on are out of reach. [-]
    """
    if not limit > 0:
        raise ValueError(f"aod_limit must be positive; got {limit}.")
    return Quantity(
        "aod_550",
        "1",
        f"optical depth of the {species} plume at 550 nm",
        f"atmosphere.plumes.{species}",
        Bounded(0.0, limit),
        with_aod_550,
        sigma=1.5,
        mean=min(0.4, limit / 2),
        get=_aod_550,
        starts=tuple(x for x in SCANNED_AOD_550 if x < limit) or (limit / 2,),
        largest_error=expected_error,
    )


def ssa_shift(species: str) -> Quantity:
    """One shift of the logit of a plume's single-scattering albedo in all bands.

    A scan begins at -0.8 and 0.8: 2.2 times as much absorption, relative to scattering, as the
    scenario specifies, and 0.45 times as much.
    """
    return Quantity(
        "ssa_shift",
        "1",
        f"shift of the logit of the single-scattering albedo of the {species} plume",
        f"atmosphere.plumes.{species}.ssa",
        Unbounded(),
        logit_shifted,
        sigma=0.7,
        mean=0.0,
        starts=(-0.8, 0.8),
    )


def effective_radius_um(species: str) -> Quantity:
    """Effective radius of a plume's particles, of smoke that of its fine mode, by Mie tables.

    A `MiePlume` has that radius. Of a `Plume`, specified by band, relative extinction, asymmetry
    factor and single-scattering albedo become those of the table at that radius, and its phase
    function stays that of Henyey and Greenstein.
    """
    lower, upper = _RADII[species]
    return Quantity(
        "effective_radius_um",
        "um",
        f"effective radius of the particles of the {species} plume",
        f"atmosphere.plumes.{species}",
        Bounded(lower, upper, logarithmic=True),
        WithEffectiveRadius(species),
        sigma=1.0,
        mean=_MEAN_RADIUS[species],
        get=_effective_radius_um,
        starts=_SCANNED_RADII[species],
    )


def height_shift(species: str) -> Quantity:
    """Shift of both edges of a plume, its extinction and thickness kept. [m]

    Where it is retrieved or assumed, levels go with the edges (`ForwardModel.plume_edges`).
    """
    return Quantity(
        "height_shift",
        "m",
        f"shift of the height of the {species} plume",
        f"atmosphere.plumes.{species}",
        Unbounded(),
        lifted,
        sigma=500.0,
        mean=0.0,
    )


def assumed_of_plume(
    species: str, bands: Sequence[str], *, effective_radius: bool = False
) -> StateVector:
    """What a retrieval of a plume assumes, and how well that may be known.

    Albedo of the ground in each band, to 0.01; height of the plume, to 500 m; its asymmetry factor,
    to a shift of the logit of 0.1, which is 0.023 at 0.65.

    Parameters
    ----------
    species
        Name of the plume in the state.
    bands
        Names of the bands.
    effective_radius
        Whether the effective radius is retrieved, or the plume is a `MiePlume`: then the asymmetry
        factor is that of the radius, and nothing is assumed of it.
    """
    known = [*(albedo(band) for band in bands), height_shift(species)]
    if effective_radius:
        return StateVector(tuple(known))
    asymmetry = Quantity(
        "asymmetry_shift",
        "1",
        f"shift of the logit of the asymmetry factor of the {species} plume",
        f"atmosphere.plumes.{species}.asymmetry",
        Unbounded(),
        logit_shifted,
        sigma=0.1,
        mean=0.0,
    )
    return StateVector((*known, asymmetry))


def lifted(plume: Plume | MiePlume, value: Float[Array, "*batch"]) -> Plume | MiePlume:
    """A plume higher up by a value. [m]"""
    edges = (plume.base + value, plume.top + value)
    return eqx.tree_at(lambda p: (p.base, p.top), plume, edges)


def with_aod_550(plume: Plume | MiePlume, value: Float[Array, "*batch"]) -> Plume | MiePlume:
    """A plume of another optical depth, of which all else is kept."""
    extinction = value / (plume.top - plume.base)
    return eqx.tree_at(
        lambda p: (p.extinction_550, p.brightness), plume, (extinction, jnp.ones_like(extinction))
    )


@dataclass(frozen=True)
class WithEffectiveRadius:
    """A plume of another effective radius, by the table of its species (`effective_radius_um`)."""

    species: str

    def __call__(self, plume: Plume | MiePlume, value: Float[Array, "*batch"]) -> Plume | MiePlume:
        """The plume with an effective radius. [um]"""
        if isinstance(plume, MiePlume):
            return eqx.tree_at(lambda p: p.effective_radius_um, plume, value)
        optics = {band: mie_optics(self.species, value, band) for band in plume.ssa}
        return eqx.tree_at(
            lambda p: (p.relative_extinction, p.ssa, p.asymmetry),
            plume,
            (
                {band: spheres.relative_extinction for band, spheres in optics.items()},
                {band: 1 - spheres.coalbedo for band, spheres in optics.items()},
                {band: spheres.asymmetry for band, spheres in optics.items()},
            ),
        )


def _aod_550(plume: Plume | MiePlume) -> Array:
    return plume.aod_550


def _effective_radius_um(plume: Plume | MiePlume) -> Array:
    """Radius of a `MiePlume`; a plume by band has none, which is NaN."""
    if isinstance(plume, MiePlume):
        return plume.effective_radius_um
    return jnp.full_like(jnp.asarray(plume.brightness), jnp.nan)
