"""Depth of air in each band, from the response of the imager and a stated spectrum of the sun."""

import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.bands import BANDS
from abi_operator.optics.rayleigh import STANDARD_DEPTH, bodhaine1999

# First and last wavelength [um] and mean of the response [-] in equal cells between them: GOES-16
# (NOAA GOES-R Calibration Working Group, ABI spectral response functions, PFM, 2016).
# fmt: off
RESPONSE = {
    "C01": (0.44210, 0.50018, (0.061, 0.547, 0.832, 0.940, 0.988, 0.948, 0.968, 0.514, 0.023)),
    "C02": (0.57294, 0.69983, (
        0.003, 0.038, 0.209, 0.581, 0.840, 0.875, 0.901, 0.931, 0.954,
        0.968, 0.981, 0.969, 0.985, 0.996, 0.914, 0.482, 0.081, 0.004,
    )),
    "C03": (0.82774, 0.90253, (
        0.004, 0.079, 0.466, 0.928, 0.961, 0.933, 0.835, 0.377, 0.055, 0.004,
    )),
    "C04": (1.35833, 1.38734, (0.004, 0.056, 0.519, 0.925, 0.991, 0.954, 0.693, 0.097, 0.004)),
    "C05": (1.55885, 1.65947, (
        0.003, 0.050, 0.268, 0.650, 0.983, 0.983, 0.947, 0.666, 0.325, 0.058, 0.003,
    )),
    "C06": (2.19443, 2.28937, (
        0.003, 0.023, 0.239, 0.851, 0.967, 0.997, 0.975, 0.897, 0.361, 0.032, 0.003,
    )),
    "C07": (3.69468, 4.07680, (
        0.004, 0.021, 0.144, 0.563, 0.922, 0.961, 0.932, 0.784, 0.727, 0.408, 0.065, 0.007,
    )),
}
# fmt: on
SUN = 5778.0  # of which a black body stands for the sun [K]
STATED = 5e-3  # 0.3 % is measured at most, of which the sun's lines have a share in C01 and C02
CENTROID = 2e-4  # of the cells, in micrometres


def cells(band):
    """Wavelengths in the middle of the cells [um] and response. [-]"""
    first, last, response = RESPONSE[band]
    edges = np.linspace(first, last, len(response) + 1)
    return (edges[1:] + edges[:-1]) / 2, np.array(response)


@pytest.mark.parametrize("band", RESPONSE)
def test_depth_of_air_follows_from_response_and_sun(band):
    wavelength, response = cells(band)
    light = response * wavelength**-5 / np.expm1(14387.77 / (wavelength * SUN))
    expected = light @ np.asarray(bodhaine1999(jnp.asarray(wavelength))) / light.sum()
    print(f"{band}: {STANDARD_DEPTH[band] / expected - 1:+.1e}")
    np.testing.assert_allclose(STANDARD_DEPTH[band], expected, rtol=STATED)


@pytest.mark.parametrize("band", RESPONSE)
def test_wavelength_of_a_band_is_the_centroid_of_its_response(band):
    wavelength, response = cells(band)
    centroid = wavelength @ response / response.sum()
    width = wavelength[1] - wavelength[0]
    np.testing.assert_allclose(
        BANDS[band].wavelength_um, centroid, rtol=0, atol=max(CENTROID, 0.02 * width)
    )
