"""Layers of specified columns for CDISORT, built without the package's optics, and its answer."""

from collections.abc import Callable
from typing import NamedTuple

import independent_droplets as droplets
import independent_gases as gases
import independent_ice as ice
import independent_mie_tables as mie_tables
import independent_plumes as plumes
import independent_rayleigh as rayleigh
import independent_single_scattering as single
import numpy as np
from cdisort import cdisort_brf
from independent_emission import cdisort_radiance

from abi_operator.optics.mie_table import mie_table

# Radius of the largest sphere that counts. [um]
LARGEST_UM = {"smoke": 100.0, "ash": 40.0, "dust": 40.0}
NUM_MOMENTS = 400  # that a phase function by its series has


class Part(NamedTuple):
    """One kind of scatterer in a column.

    Parameters
    ----------
    extinction, scattering
        Depth of each layer. [-]
    moments
        Legendre moments, without 2l + 1. [-]
    phase
        Phase function of a cosine, mean 1 over the sphere; None where `moments` sum to it. [-]
    """

    extinction: np.ndarray
    scattering: np.ndarray
    moments: np.ndarray
    phase: Callable[[float], float] | None = None


def henyey_greenstein(asymmetry):
    """Legendre moments of the phase function of Henyey and Greenstein. [-]"""
    return asymmetry ** np.arange(NUM_MOMENTS)


def lobes(weights_and_asymmetries):
    """Moments and phase function of lobes of Henyey and Greenstein. [-]"""

    def phase(cosine):
        return sum(
            w * (1 - g**2) / (1 + g**2 - 2 * g * cosine) ** 1.5 for w, g in weights_and_asymmetries
        )

    return sum(w * henyey_greenstein(g) for w, g in weights_and_asymmetries), phase


def plume_layers(made, depth, brightness, base, top):
    """Depth of a plume at 550 nm in each layer. [-]"""
    return depth * brightness * plumes.share_of_layers(made["height"], base, top)


def parts(made, band, *, mie_phase=mie_tables.phase, liquid_optics="mie"):
    """What scatters in a column in a band.

    `mie_phase` gives moments and phase function of a plume of spheres, from species, number of
    the radius in its table and band.
    """
    air = rayleigh.layers(made["pressure"], band)
    found = [Part(air, air, rayleigh.phase(band, NUM_MOMENTS))]
    for name, extent in made["plumes"].items():
        relative, ssa, asymmetry = plumes.published(name, band)
        extinction = relative * plume_layers(made, *extent)
        found.append(Part(extinction, ssa * extinction, henyey_greenstein(asymmetry)))
    for species, (*extent, node) in made["spheres"].items():
        if extent[0] == 0:
            continue
        radius = mie_table(species).effective_radius_um[node]
        relative, ssa = plumes.spheres(species, radius, band, LARGEST_UM[species])
        extinction = relative * plume_layers(made, *extent)
        found.append(Part(extinction, ssa * extinction, *mie_phase(species, node, band)))
    ways = {"mitchell": droplets.mitchell, "mie": droplets.mie}
    for of_layer, numbers in ((ways[liquid_optics], made["liquid"]), (ice.crystals, made["ice"])):
        for layer in np.flatnonzero(numbers[0]):
            only = np.eye(air.size)[layer]
            extinction, scattering, *phase = of_layer(*numbers[:, layer], band)
            if of_layer is ice.crystals:
                phase = lobes(*phase)
            elif len(phase) == 1:
                phase = (henyey_greenstein(*phase),)
            found.append(Part(only * extinction, only * scattering, *phase))
    return found


class Layers(NamedTuple):
    """Layers of a column in a band, for CDISORT.

    Parameters
    ----------
    weight
        Of each exponential term of the gases. [-]
    tau, ssa
        Of each term and layer. [-]
    moments
        Of each layer, without 2l + 1. [-]
    phase
        Phase function of each layer in the direction of the view; None where `moments` sum to it.
    """

    weight: np.ndarray
    tau: np.ndarray
    ssa: np.ndarray
    moments: np.ndarray
    phase: np.ndarray | None = None


def layers(made, band, **options):
    """Layers of a column, mixed from its `parts` and its gases."""
    weight, absorption = gases.terms(made, band)
    found = parts(made, band, **options)
    scattering = sum(part.scattering for part in found)
    moments = sum(part.scattering[:, None] * part.moments for part in found) / scattering[:, None]
    tau = sum(part.extinction for part in found) + absorption
    phase = None
    if any(part.phase is not None for part in found):
        cosine = single.cos_scattering(*directions(made))
        values = [part.phase(cosine) if part.phase else series(part, cosine) for part in found]
        phase = sum(p.scattering * v for p, v in zip(found, values, strict=True)) / scattering
    return Layers(weight, tau, scattering / tau, moments, phase)


def series(part, cosine):
    """Sum of the series of a phase function. [-]"""
    degrees = 2 * np.arange(part.moments.size) + 1
    return np.polynomial.legendre.legval(cosine, degrees * part.moments)


def cdisort_sum(made, band, layers, num_streams, light=None):
    """BRF of a column by CDISORT; with `light`, radiance with emission. [-], [W m-2 sr-1 um-1]

    The sum over the terms of the gases. Where the phase function of the layers is not that of
    their moments, CDISORT's own correction for exact single scattering is replaced.

    Parameters
    ----------
    made, band
        The column, for its ground and directions.
    layers
        What `layers` gives.
    num_streams
        Streams.
    light
        Planck function at the levels and of the ground, and sunlight; see `cdisort_radiance`.
    """
    mu0, mu, azimuth = angles = directions(made)
    corrected = layers.phase is None
    total = 0.0
    for weight, tau, ssa in zip(layers.weight, layers.tau, layers.ssa, strict=True):
        column = tau, ssa, layers.moments, made["albedo"][band], *angles
        if light is None:
            value, brf_unit = cdisort_brf(*column, num_streams, corrected), 1.0
        else:
            planck, ground, sunlight = light
            value = cdisort_radiance(column, band, planck, ground, num_streams, sunlight, corrected)
            brf_unit = sunlight * mu0 / np.pi
        if not corrected:
            more = single.correction(
                tau, ssa, layers.moments, layers.phase, mu0, mu, azimuth, num_streams
            )
            value += brf_unit * more
        total += weight * value
    return total


def directions(made):
    """Cosines of the sun's and the view's zenith angle, and relative azimuth. [-], [-], [rad]"""
    return (
        np.cos(made["solar_zenith"]),
        np.cos(made["view_zenith"]),
        made["relative_azimuth"],
    )
