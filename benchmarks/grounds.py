"""Albedos of standard grounds in the bands of natural colour, each with its source.

Means between the half-power points of GOES-16's C01, C02 and C03; green at 0.555 um alone.
"""

import numpy as np

from abi_operator.optics.ice_tables import ICE_INDEX

COLORS = ("C01", "green", "C02", "C03")

# Canopies and soil: white-sky albedo by PROSAIL (S. Jacquemoud et al., "PROSPECT + SAIL models: a
# review of use for vegetation characterization", Remote Sens. Environ., 113, S56-S66, 2009,
# doi:10.1016/j.rse.2008.01.026; package `prosail` 2.0.5): run_prosail(1.5, 40, 8, 0, 0.01, 0.009,
# LAI, -0.35, 0.01, 30, 0, 0, typelidf=1, lidfb=-0.15, rsoil=1, psoil=1, factor="BHR"), the withered
# one with 1.8, 10, 4, 0.5, 0.005, 0.009 and LAI 1; its dry soil as it is. Vegetation, sand, lake
# and sea: the spectra that 6S calls by these names (E. F. Vermote et al., "Second Simulation of the
# Satellite Signal in the Solar Spectrum, 6S: an overview", IEEE Trans. Geosci. Remote Sens., 35,
# 675-686, 1997, doi:10.1109/36.581987). [-]
_LISTED = {
    "dense canopy": (0.016, 0.067, 0.024, 0.533),
    "canopy": (0.020, 0.073, 0.030, 0.507),
    "sparse canopy": (0.094, 0.149, 0.132, 0.449),
    "withered canopy": (0.058, 0.150, 0.126, 0.452),
    "vegetation of 6S": (0.094, 0.127, 0.094, 0.530),
    "dry soil": (0.225, 0.261, 0.304, 0.413),
    "dry sand": (0.099, 0.126, 0.169, 0.291),
    "lake": (0.072, 0.082, 0.071, 0.020),
    "clear sea": (0.041, 0.055, 0.044, 0.000),
}


def snow_albedo(band, grain_radius_um, asymmetry=0.89):
    r"""White-sky albedo of deep snow, spheres of ice whose absorption is weak. [-]

    .. math:: a = \exp\left(-4 \sqrt{\frac{1 - \omega}{3 (1 - g)}}\right), \qquad
       1 - \omega = \frac{4 k x}{3 n} \left[n^3 - (n^2 - 1)^{3/2}\right]

    References
    ----------
    .. [1] A. A. Kokhanovsky and E. P. Zege, "Scattering optics of snow", Appl. Opt., 43, 1589-1602,
       2004, doi:10.1364/AO.43.001589 (albedo)
    .. [2] C. F. Bohren and D. R. Huffman, "Absorption and Scattering of Light by Small Particles",
       Wiley, 1983, eq. 7.2 (absorption)
    .. [3] W. J. Wiscombe and S. G. Warren, "A model for the spectral albedo of snow. I: Pure snow",
       J. Atmos. Sci., 37, 2712-2733, 1980, doi:10.1175/1520-0469(1980)037<2712:AMFTSA>2.0.CO;2
       (asymmetry factor of large spheres)
    """
    wavelength = {"C01": 0.4711, "green": 0.555, "C02": 0.6396, "C03": 0.8644}[band]
    n, k = ICE_INDEX[band].real, -ICE_INDEX[band].imag
    size = 2 * np.pi * grain_radius_um / wavelength
    coalbedo = 4 / 3 * k * size * (n**3 - (n**2 - 1) ** 1.5) / n
    return float(np.exp(-4 * np.sqrt(coalbedo / (3 * (1 - asymmetry)))))


GROUNDS = {name: dict(zip(COLORS, row, strict=True)) for name, row in _LISTED.items()} | {
    f"snow, grains of {radius} um": {band: snow_albedo(band, radius) for band in COLORS}
    for radius in (100, 500)
}

# What a fire may burn in: albedo in C06, by the same PROSAIL columns over 2.220-2.266 um, and the
# surface type whose emissivity near 3.9 um `abi_operator.surface` lists.
FIRE_GROUNDS = {
    "forest": (0.133, "mixed forest"),
    "withered grass": (0.238, "grassland"),
    "bare soil": (0.490, "bare"),
}
