"""Scattering and absorption by one aerosol plume, and by the aerosol beside plumes."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._numerics import safe_divide
from ..atmosphere import Atmosphere, BackgroundAerosol, MiePlume, Plume
from ..bands import AnyBand, entry, first_missing
from ..optical_properties import OpticalProperties, Scatterer
from .mie_aerosol import mie_optics
from .mie_phase import MiePhase
from .phase import HenyeyGreenstein


def overlap(
    height: Float[Array, "level *batch"], base: Float[Array, "*batch"], top: Float[Array, "*batch"]
) -> Float[Array, "layer *batch"]:
    r"""Length of each layer that lies between `base` and `top`.

    .. math:: h_k = c(z_k) - c(z_{k+1}), \qquad
       c(z) = \min(\max(z, z_\mathrm{base}), z_\mathrm{top})

    Differences of one clipped height sum to ``top - base`` on any levels that cover the plume; of
    one that reaches above the first level they leave out what is there.
    Where an edge lies on a level its derivative is the one-sided one of a shrinking plume: it goes
    to the layer inside.

    Parameters
    ----------
    height
        Height of the levels, top first. [m]
    base, top
        Edges, base below top, above the same zero as `height`. [m]
    """
    clipped = jnp.where(height >= top, top, jnp.where(height <= base, base, height))
    # An edge that is no number is nowhere, and would leave all of the column to the plume.
    return jnp.where(jnp.isnan(top - base), jnp.nan, -jnp.diff(clipped, axis=0))


def aerosol(atmosphere: Atmosphere, plume: str, band: AnyBand) -> OpticalProperties:
    r"""Optical properties of one plume.

    .. math:: \tau_k = b\, \beta_{550}\, r_\mathrm{band}\, h_k

    with brightness b, extinction coefficient :math:`\beta_{550}`, relative extinction r and the
    length h of the layer inside the plume (`overlap`). Of a `Plume`, relative extinction and
    single-scattering albedo are those specified, and the phase function is that of Henyey and
    Greenstein with the asymmetry factor specified; of a `MiePlume`, all are those of its species
    at its effective radius (`mie_optics`, `MiePhase`).

    Parameters
    ----------
    atmosphere
        One column, of which the height and the plume are read.
    plume
        Name of the plume in `atmosphere`.
    band
        Band, for which the plume must be specified.

    Raises
    ------
    ValueError
        Where the atmosphere has no such plume, the plume no such band or its species no table.
    """
    if plume not in atmosphere.plumes:
        raise ValueError(f"no plume {plume!r}; the atmosphere has {sorted(atmosphere.plumes)}.")
    properties = atmosphere.plumes[plume]
    if isinstance(properties, MiePlume):
        radius = properties.effective_radius_um
        spheres = mie_optics(properties.species, radius, band.name)
        relative, ssa = spheres.relative_extinction, 1 - spheres.coalbedo
        phase = MiePhase(radius[None], properties.species, band.name)
    else:
        relative, ssa, asymmetry = _specified(properties, plume, band)
        phase = HenyeyGreenstein(asymmetry[None])
    coefficient = properties.brightness * properties.extinction_550 * relative
    above_ground = atmosphere.height - atmosphere.height[-1]
    extinction = coefficient * overlap(above_ground, properties.base, properties.top)
    outside = (above_ground[:-1] <= properties.base) | (above_ground[1:] >= properties.top)
    there = jnp.asarray(~outside)  # of edges that are no numbers nobody knows
    scatterer = Scatterer(ssa * extinction, phase, there)
    return OpticalProperties(extinction[None, :], jnp.ones(1, extinction.dtype), (scatterer,))


def background(atmosphere: Atmosphere, band: AnyBand) -> OpticalProperties:
    r"""Optical properties of the aerosol that is everywhere.

    .. math:: \tau_k = r_\mathrm{band}\, \tau_{550}\,
       \frac{e^{-z_{k+1} / H} - e^{-z_k / H}}{1 - e^{-z_0 / H}}

    with the heights z of the levels above the ground, the first one being the top, and the scale
    height H; its phase function is that of Henyey and Greenstein. Levels that are all at one height
    hold none.

    Parameters
    ----------
    atmosphere
        One column, which has a `BackgroundAerosol`.
    band
        Band, for which that must be specified.

    Raises
    ------
    ValueError
        Where the atmosphere has none, or it no such band.
    """
    properties = atmosphere.background
    if properties is None:
        raise ValueError("the atmosphere has no background aerosol.")
    relative, ssa, asymmetry = _specified(properties, "background", band)
    above_ground = atmosphere.height - atmosphere.height[-1]
    beneath = -jnp.expm1(-above_ground / properties.scale_height)
    extinction = relative * properties.aod_550 * safe_divide(-jnp.diff(beneath, axis=0), beneath[0])
    scatterer = Scatterer(ssa * extinction, HenyeyGreenstein(asymmetry[None]))
    return OpticalProperties(extinction[None, :], jnp.ones(1, extinction.dtype), (scatterer,))


def _specified(
    properties: Plume | BackgroundAerosol, plume: str, band: AnyBand
) -> tuple[Array, Array, Array]:
    """Relative extinction, single-scattering albedo and asymmetry factor in a band. [-]"""
    values = []
    for name in ("relative_extinction", "ssa", "asymmetry"):
        by_band = getattr(properties, name)
        if missing := first_missing(band.name, by_band):
            raise ValueError(
                f"{name} of plume {plume!r} is not specified in band {missing!r}, only in "
                f"{sorted(by_band)}."
            )
        values.append(entry(by_band, band.name))
    relative_extinction, ssa, asymmetry = values
    return relative_extinction, ssa, asymmetry
