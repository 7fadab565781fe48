"""Numbers with a source of which one digit would move too little, or nothing, in the columns."""

import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.bands import BANDS
from abi_operator.optics.hydrometeor_classes import CLASSES, RIMED_GEOMETRIC
from abi_operator.satellites import (
    SATELLITES,
    centroid_um,
    planck_coefficients,
    solar_irradiance,
)
from abi_operator.surface import ocean

# Effective reflectance of foam every 0.1 um from 0.2 um, Koepke (1984) as tabulated in 6SV2.1.
FOAM = (0.22, 0.22, 0.22, 0.22, 0.22, 0.22, 0.215, 0.21, 0.2, 0.19, 0.175, 0.155, 0.13)
FOAM += (0.08, 0.1, 0.105, 0.1, 0.08, 0.045, 0.055, 0.065, 0.06)
# pi / E of 1 AU in the L1b files of GOES-16 (kappa0). [W-1 m2 um]
KAPPA0 = {"C01": 1.55743e-3, "C02": 1.92578e-3, "C03": 3.28251e-3, "C06": 4.08530e-2}
# 2 h c2 [mW m-2 sr-1 cm4] and h c / k [cm K]. (CODATA 2018)
RADIATION_CONSTANTS = 1.191043e-5, 1.438777


@pytest.mark.parametrize("band", [name for name in BANDS if name != "C07"])
def test_foam(band):
    known = np.interp(BANDS[band].wavelength_um, 0.2 + 0.1 * np.arange(len(FOAM)), FOAM)
    given = ocean(jnp.asarray(5.0), band).foam_reflectance
    np.testing.assert_allclose(given, known, atol=5.5e-4, rtol=0)  # the last digit of our table


@pytest.mark.parametrize("name", ["graupel", "hail"])
def test_rimed_lumps(name):
    """An assumption: it is to move on purpose alone."""
    assert CLASSES[name].asymmetry == "rimed" and RIMED_GEOMETRIC == 0.6


@pytest.mark.parametrize("band", KAPPA0)
def test_solar_irradiance(band):
    np.testing.assert_allclose(np.pi / solar_irradiance(band), KAPPA0[band], rtol=4e-6)


@pytest.mark.parametrize("satellite", SATELLITES)
def test_planck_coefficients(satellite):
    """Of C07 fk1 and fk2 are of one wavenumber, the centroid of the response."""
    found = planck_coefficients("C07", satellite)
    first, second = RADIATION_CONSTANTS
    wavenumber = found.fk2 / second
    np.testing.assert_allclose(found.fk1, first * wavenumber**3, rtol=1e-5)
    np.testing.assert_allclose(1e4 / wavenumber, centroid_um("C07", satellite), rtol=2e-3)
    # At a temperature of the Earth the band is a black body of very nearly that temperature.
    effective = found.bc1 + found.bc2 * 290.0
    np.testing.assert_allclose(effective, 290.0, atol=0.4)
    # Widths of a symmetric response in wavenumber and wavelength differ by its square.
    np.testing.assert_allclose(found.factor, 1e-7 * wavenumber**2, rtol=2e-3)
