"""All that interacts with light in one column."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._numerics import safe_divide
from ..atmosphere import Atmosphere
from ..bands import AnyBand
from ..machine.occupied import row_by_row
from ..optical_properties import OpticalProperties, Scatterer
from .aerosol import aerosol, background
from .cloud import liquid_cloud
from .gas import ALL_GASES, gas_absorption
from .hydrometeor import hydrometeor
from .rayleigh import rayleigh


class Mixture(NamedTuple):
    """What a solver is given of the layers of a column in one band: `OpticalProperties`, evaluated.

    Parameters
    ----------
    tau, ssa
        Extinction optical depth and single-scattering albedo, by exponential term. [-]
    weight
        Weight of each exponential term. [-]
    moments
        Legendre moments of the phase function. [-]
    phase_function
        At the scattering angle. [-]
    """

    tau: Float[Array, "term layer *batch"]
    ssa: Float[Array, "term layer *batch"]
    weight: Float[Array, " term"]
    moments: Float[Array, "layer moment *batch"]
    phase_function: Float[Array, "layer *batch"]


def column_optics(
    atmosphere: Atmosphere, band: AnyBand, gases: Sequence[str] = ALL_GASES
) -> OpticalProperties:
    """Optical properties of all that a column holds, in one band.

    Scatterers come in the order air, plumes by name, background aerosol, liquid cloud, hydrometeor
    classes by name.

    Parameters
    ----------
    atmosphere
        One column.
    band
        Band, in which every plume must be specified.
    gases
        Which of the atmosphere's gases absorb; see `gas_absorption`.
    """
    return _with_particles(_air_and_aerosol(atmosphere, band, gases), atmosphere, band)


def mixture(
    atmosphere: Atmosphere,
    band: AnyBand,
    gases: Sequence[str],
    num_moments: int,
    cos_scattering: Float[Array, "*batch"],
) -> Mixture:
    """What a solver reads of the same, layer by layer.

    What follows from the droplets and hydrometeors of a layer is found, value or slope, and mixed
    while it lies in the cache, and of those that are nowhere in a layer nothing is: arrays of all
    layers for each number that a class of particles goes through would take longer to write than
    all of its formulas. Where the operator reads columns (`band_columns`).

    Parameters
    ----------
    atmosphere, band, gases
        As in `column_optics`.
    num_moments
        Legendre moments that are wanted.
    cos_scattering
        Cosine of the scattering angle. [-]
    """
    around = _air_and_aerosol(atmosphere, band, gases)

    def of_layers(rows: Any, _: Any) -> Any:
        scatterers, liquid, hydrometeors = rows
        own = tuple(
            Scatterer(x, s.phase, there)
            for (x, there), s in zip(scatterers, around.scatterers, strict=True)
        )
        nothing = jnp.zeros_like(own[0].scattering)[None]
        optics = _with_particles(
            OpticalProperties(nothing, jnp.ones(1, nothing.dtype), own),
            replace(atmosphere, liquid=liquid, hydrometeors=hydrometeors),
            band,
        )
        by_angle = optics.phase_function(cos_scattering)
        return optics.tau[0], optics.scattering, optics.moments(num_moments), by_angle

    # Phase functions of air and aerosol have no layers of their own.
    scatterers = [(s.scattering, s.there) for s in around.scatterers]
    rows = scatterers, atmosphere.liquid, atmosphere.hydrometeors
    cloud, scattering, moments, by_angle = row_by_row(of_layers, rows, ())
    tau = around.tau + cloud
    return Mixture(tau, safe_divide(scattering, tau), around.weight, moments, by_angle)


def _air_and_aerosol(
    atmosphere: Atmosphere, band: AnyBand, gases: Sequence[str]
) -> OpticalProperties:
    """What is told for all layers of a column together."""
    optics = rayleigh(atmosphere, band) + gas_absorption(atmosphere, band, gases)
    for plume in sorted(atmosphere.plumes):
        optics = optics + aerosol(atmosphere, plume, band)
    return optics if atmosphere.background is None else optics + background(atmosphere, band)


def _with_particles(
    optics: OpticalProperties, atmosphere: Atmosphere, band: AnyBand
) -> OpticalProperties:
    """The same and droplets and hydrometeors, of which no layer asks what is in another."""
    optics = optics + liquid_cloud(atmosphere, band)
    for name in sorted(atmosphere.hydrometeors):
        optics = optics + hydrometeor(atmosphere, name, band)
    return optics
