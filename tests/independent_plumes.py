"""Aerosol plumes in NumPy: published tables typed again, and Mie theory for plumes of spheres.

Smoke is the biomass-burning model of 6SV2.1 (Vermote et al. 1997), ash that of spheres after Prata
and Grant (2001). Sizes and refractive indices of the species of a Mie table are typed from their
sources; the spheres that stand for a size distribution are those of the table, since narrow
resonances make any other choice differ by up to 1e-4 of the co-albedo.
"""

import functools

import numpy as np
from independent_mie import lognormal, phase_functions, sphere_efficiencies

from abi_operator.bands import BANDS

# Extinction over that at 0.555 um, single-scattering albedo, asymmetry factor. [-]
PUBLISHED = {
    "smoke": {
        "C01": (1.3573, 0.9391, 0.6585),
        "C02": (0.7477, 0.9234, 0.5831),
        "C03": (0.3827, 0.8961, 0.4994),
        "C04": (0.1460, 0.8397, 0.4731),
        "C05": (0.1121, 0.8248, 0.5074),
        "C06": (0.0782, 0.8220, 0.6180),
        "C07": (0.0567, 0.8539, 0.6980),
    },
    "ash": {
        "C01": (0.9873, 0.9062, 0.7883),
        "C02": (1.0122, 0.9264, 0.7659),
        "C03": (1.0471, 0.9424, 0.7405),
        "C04": (1.1246, 0.9622, 0.7048),
        "C05": (1.1572, 0.9675, 0.6954),
        "C06": (1.2208, 0.9766, 0.6828),
        "C07": (1.2058, 0.9860, 0.6764),
    },
}

SPHERES_UM = np.geomspace(0.002, 600.0, 20000)
# Standard deviation of ln r, and the coarse mode of smoke: its own, its effective radius and its
# volume over the fine mode's (Dubovik et al. 2002, at an optical depth of 0.74 at 0.44 um).
WIDTH = {"smoke": 0.4, "ash": np.log(2.0), "dust": np.log(2.0)}
COARSE = {"smoke": (0.79, (3.27 + 0.58 * 0.74) * np.exp(-(0.79**2) / 2), 0.05 / 0.12)}
# n and k of n - ik: Dubovik et al. (2002); Deguine et al. (2020); and the composite of ECMWF's
# ecaeropt, of which this is wavelength [um], n, k: n is linear in it, k log-log.
ASH_INDEX = {
    "C01": (1.5690, 0.000542),
    "green": (1.5690, 0.000594),
    "C02": (1.5690, 0.000619),
    "C03": (1.5680, 0.001049),
    "C04": (1.5646, 0.001709),
    "C05": (1.5625, 0.001848),
    "C06": (1.5568, 0.002220),
    "C07": (1.5382, 0.003713),
}
COMPOSITE = (
    (0.40, 0.60, 1.00, 1.26, 1.58, 1.88, 2.25, 3.50, 4.00),
    (1.525, 1.520, 1.510, 1.490, 1.490, 1.480, 1.470, 1.429, 1.417),
    (5.0e-3, 2.2e-3, 6.0e-4, 5.4e-4, 5.3e-4, 5.2e-4, 5.2e-4, 3.0e-3, 4.0e-3),
)


def at_550(species):
    """Extinction of a published species at 0.550 um over that at 0.555 um. [-]

    A straight line in logarithms, from C01 through 0.555 um.
    """
    slope = np.log(PUBLISHED[species]["C01"][0]) / np.log(BANDS["C01"].wavelength_um / 0.555)
    return (0.550 / 0.555) ** slope


def share_of_layers(height, base, top):
    """Share of a plume that lies in each layer between levels above the ground. [m]"""
    inside = np.minimum(height[:-1], top) - np.maximum(height[1:], base)
    return np.clip(inside, 0, None) / (top - base)


def published(species, band):
    """Extinction over that at 0.550 um, single-scattering albedo, asymmetry factor. [-]"""
    extinction, ssa, asymmetry = PUBLISHED[species][band]
    return extinction / at_550(species), ssa, asymmetry


def index(species, band):
    """Refractive index n - ik of spheres of a species."""
    if species == "smoke":
        return 1.47 - 0.0093j
    if species == "ash":
        n, k = ASH_INDEX[band]
        return n - 1j * k
    at, (wavelength, n, k) = BANDS[band].wavelength_um, COMPOSITE
    log_k = np.interp(np.log(at), np.log(wavelength), np.log(k))
    return np.interp(at, wavelength, n) - 1j * np.exp(log_k)


def cross_sections(species, effective_radius_um):
    """Geometric cross section of each of `SPHERES_UM` per volume of the (first) mode, times 4/3."""
    volume = lognormal(SPHERES_UM, effective_radius_um, WIDTH[species])
    if species in COARSE:
        width, radius, ratio = COARSE[species]
        volume = volume + ratio * lognormal(SPHERES_UM, radius, width)
    return volume / SPHERES_UM


@functools.cache
def _efficiencies(species, band, wavelength_um, largest_radius_um):
    """Of `SPHERES_UM` up to a radius, by Mie theory."""
    spheres = SPHERES_UM[largest_radius_um >= SPHERES_UM]
    return sphere_efficiencies(index(species, band), spheres, wavelength_um)


def spheres(species, effective_radius_um, band, largest_radius_um):
    """Extinction over that at 0.550 um, and single-scattering albedo, by Mie theory. [-]

    `largest_radius_um` bounds the spheres that count.
    """
    area = cross_sections(species, effective_radius_um)
    area = area[largest_radius_um >= SPHERES_UM]
    wavelength = BANDS[band].wavelength_um
    of_band = _efficiencies(species, band, wavelength, largest_radius_um) @ area
    reference = _efficiencies(species, "green", 0.550, largest_radius_um)[0] @ area
    extinction, scattering, _ = of_band
    return extinction / reference, scattering / extinction


def phase_function(species, effective_radius_um, band, cosine, num_moments):
    """Moments, and phase function at one scattering angle, by Mie theory. [-]

    Every fourth of `SPHERES_UM` up to 40 um: moments are good to 3e-5, and so is P but for ash,
    of which resonances leave 1e-3 uncertain.
    """
    spheres, area = SPHERES_UM[::4], cross_sections(species, effective_radius_um)[::4]
    counted = spheres <= 40.0
    moments, phase = phase_functions(
        index(species, band),
        spheres[counted],
        BANDS[band].wavelength_um,
        area[None, counted],
        np.array([cosine]),
        num_moments,
    )
    return moments[0], float(phase[0, 0])
