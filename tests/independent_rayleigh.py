"""Air as Bodhaine et al. (1999) have it, in NumPy: the independent path's Rayleigh scattering.

Band depths are numbers of the model (means of the full form over a spectral response), typed here
again; `full_form` is the formula itself, at one wavelength.
"""

import numpy as np

STANDARD_PRESSURE = 101325.0

# Depth down to 1013.25 hPa, averaged over the response of GOES-16, and coefficient of P_2. [-]
STANDARD_DEPTH = {
    "C01": (0.18411, 0.47867),
    "C02": (0.053806, 0.47930),
    "C03": (0.01555, 0.47960),
    "C04": (0.0024113, 0.47980),
    "C05": (0.0012774, 0.47983),
    "C06": (0.00033791, 0.47987),
    "C07": (3.7341e-5, 0.47990),
}


def layers(pressure, band):
    """Scattering depth of the layers between levels of a pressure [Pa], top first. [-]

    Air above the first level is in the uppermost layer.
    """
    return STANDARD_DEPTH[band][0] * np.diff(pressure[1:], prepend=0.0) / STANDARD_PRESSURE


def phase(band, num_moments):
    """Legendre moments 1, 0, beta2 / 5, 0, ... [-]"""
    moments = np.zeros(num_moments)
    moments[[0, 2]] = 1.0, STANDARD_DEPTH[band][1] / 5
    return moments
