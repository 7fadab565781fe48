"""Optics of aerosols of spheres, as a function of their effective radius."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..bands import AnyName, OneOf, one_of
from .mie_table import mie_table, stacked
from .pointwise import where_occupied
from .radius_cubics import locate, read


class MieOptics(NamedTuple):
    """Optics of one species in one band.

    Parameters
    ----------
    relative_extinction
        Extinction relative to that at 550 nm. [-]
    coalbedo
        1 minus the single-scattering albedo. [-]
    asymmetry
        Mean cosine of the scattering angle. [-]
    """

    relative_extinction: Float[Array, "*n"]
    coalbedo: Float[Array, "*n"]
    asymmetry: Float[Array, "*n"]


def mie_optics(
    species: str,
    effective_radius_um: Float[Array, "*n"],
    band: AnyName,
    there: Bool[Array, "*n"] | None = None,
) -> MieOptics:
    r"""Optics of lognormal distributions of spheres, from the table of their species.

    Extinction is per volume of particles, :math:`\int Q\, \pi r^2\, n(r)\, dr / \int r^3\, n\, dr`,
    over the same at 550 nm, so that the optical depth at 550 nm stays what a plume says it is when
    the radius varies; of ``"droplets"``, gamma distributions of water, it is the efficiency itself.
    Between the radii of the table the logarithms of extinction and co-albedo and the asymmetry
    factor are cubics in the logarithm of radius (`radius_cubics`). Over the first and the last
    interval the slope fades to zero, and beyond all is constant: the table is meant for what lies
    between, for smoke fine modes of 0.043-0.56 um (its coarse mode stays as it is, in fixed
    proportion by volume) and for ash 0.28-17.9 um; for any species, from the second to the last but
    one radius of its `mie_table`.

    Parameters
    ----------
    species
        Name of the species, of those in `mie_species`.
    effective_radius_um
        Effective radius. [um]
    band
        Name of the band.
    there
        Where there are any, of layers in the first axis; None for everywhere
        (`pointwise.where_occupied`).

    References
    ----------
    .. [1] G. Mie, "Beitraege zur Optik trueber Medien, speziell kolloidaler Metalloesungen", Ann.
       Phys., 330, 377-445, 1908, doi:10.1002/andp.19083300302
    """
    return MieOptics(*_interpolated(there, (effective_radius_um,), species, one_of(band)))


@where_occupied
def _interpolated(radius_um: Array, species: str, band: OneOf) -> tuple[Array, Array, Array]:
    row, weights = locate(radius_um, mie_table(species).effective_radius_um)
    table, first = stacked(species, band, lambda x: x.efficiencies)
    values = read(jnp.asarray(table, weights.dtype), row + first, weights)
    return jnp.exp(values[..., 0]), jnp.exp(values[..., 1]), values[..., 2]
