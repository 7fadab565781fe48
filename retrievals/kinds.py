"""What the command retrieves, by name: a state vector, its bands and where it is looked for."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import xarray as xr

from abi_operator.radiance import FIRE_BANDS

from .declarations import AOD_LIMIT, assumed_of_plume, fire, liquid_cloud, plume
from .fires import WhereOfFires, retrieve_fires
from .images import retrieve_image
from .state_vector import StateVector
from .usable_pixels import Where, check_where

BANDS = ("C01", "C02", "C03")
"""Bands that are used by default for smoke: in C06, it is hardly seen."""


class Kind(NamedTuple):
    """Defaults of a retrieval.

    Parameters
    ----------
    bands
        Bands that tell of it.
    species
        Name of the plume in a scenario, None for cloud and fire.
    """

    bands: tuple[str, ...]
    species: str | None


KINDS = {
    "smoke": Kind(BANDS, "smoke"),
    "ash": Kind(BANDS, "ash"),
    "dust": Kind(BANDS, "dust"),
    "cloud": Kind(("C02", "C06"), None),
    "fire": Kind(FIRE_BANDS, None),
}
"""Retrievals from the result of a simulation."""


def retrieve_kind(
    dataset: xr.Dataset,
    kind: str,
    *,
    bands: Sequence[str] | None = None,
    retrieve_ssa: bool = False,
    effective_radius: bool = False,
    aod_limit: float = AOD_LIMIT,
    where: Where | WhereOfFires | None = None,
    **how: Any,
) -> xr.Dataset:
    """Retrieve one of `KINDS` from the result of a simulation.

    Parameters
    ----------
    dataset, **how
        As of `retrieve_image`, or of fire as of `retrieve_fires`.
    kind
        One of `KINDS`.
    bands
        Bands to be used; None for those of the kind.
    retrieve_ssa
        Whether a plume's single-scattering albedo is unknown too, by one shift of its logit in all
        bands.
    effective_radius
        Whether the effective radius of its particles is. Of cloud it always is.
    aod_limit
        Optical depths of a plume from here on are out of reach. [-]
    where
        As of `retrieve_image` or `retrieve_fires`; None for where there is a plume, or cloud, or
        where a fire is detected. Cloud is looked for where the scenario has cloud water, whatever
        is said: elsewhere there is no place for it.

    Returns
    -------
    xarray.Dataset
        As of `retrieve_image`, or of fire as of `retrieve_fires`.

    Raises
    ------
    InputError
        Where the Dataset lacks a variable or a band.
    ValueError
        Where the kind is none of `KINDS`, has not what is to be retrieved of it, or is nowhere to
        be looked for by this `where`; and as of `retrieve_image` or `retrieve_fires`.
    """
    vector = vector_of(kind, retrieve_ssa, effective_radius, aod_limit)
    bands = KINDS[kind].bands if bands is None else tuple(bands)
    species = KINDS[kind].species
    about: dict[str, Any] = {
        "title": f"{kind.capitalize()} retrieved from synthetic imagery",
        "kind": kind,
        "retrieved": " ".join(vector.names),
    }
    if kind == "fire":
        how = how if where is None else how | {"where": where}
        return retrieve_fires(dataset, bands=bands, attributes=about, **how)
    if species is not None:
        about["aod_limit"] = aod_limit
        assumed = assumed_of_plume(species, bands, effective_radius=effective_radius)
        how.setdefault("assumed", assumed)
    else:
        check_where("cloud" if where is None else where, ("cloud", "all"))
        where = "cloud"
    how["where"] = "plume" if where is None else where
    return retrieve_image(dataset, vector, bands=bands, species=species, attributes=about, **how)


def vector_of(
    kind: str,
    retrieve_ssa: bool = False,
    effective_radius: bool = False,
    aod_limit: float = AOD_LIMIT,
) -> StateVector:
    """State vector of one of `KINDS`; parameters are those of `retrieve_kind`.

    Raises
    ------
    ValueError
        Where the kind is none of `KINDS`, or where cloud is to have a single-scattering albedo that
        is retrieved, or a fire particles.
    """
    if kind not in KINDS:
        raise ValueError(f"cannot retrieve {kind!r}; choose from {', '.join(KINDS)}.")
    species = KINDS[kind].species
    if species is not None:
        return plume(
            species, ssa=retrieve_ssa, effective_radius=effective_radius, aod_limit=aod_limit
        )
    if kind == "fire":
        if retrieve_ssa or effective_radius:
            raise ValueError("a fire has no particles whose size or absorption could be retrieved.")
        return fire()
    if retrieve_ssa:
        raise ValueError("the single-scattering albedo of cloud is that of water.")
    return liquid_cloud()


def retrieve_smoke(dataset: xr.Dataset, **how: Any) -> xr.Dataset:
    """Retrieve smoke: optical depth, and if wished how much it absorbs (`retrieve_kind`)."""
    return retrieve_kind(dataset, "smoke", **how)
