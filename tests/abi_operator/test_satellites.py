"""The calibration of each satellite against the figures that it implies."""

import math

import pytest

from abi_operator.bands import BANDS
from abi_operator.satellites import (
    SATELLITES,
    centroid_um,
    check_satellite,
    gas_fit_covers,
    packing,
    planck_coefficients,
    solar_irradiance,
)

REFLECTIVE = ("C01", "C02", "C03", "C04", "C05", "C06")
# Mean of Kurucz's spectrum over GOES-16's response (NOAA CWG, 2016). [W m-2 um-1]
KURUCZ = dict(zip(REFLECTIVE, (2041.96, 1625.40, 954.92, 361.06, 242.32, 76.94), strict=True))
# kappa0 at 1 AU as in GOES-16's L1b files, pi / E0. [m2 um W-1]
KAPPA0 = dict(
    zip(
        REFLECTIVE,
        (1.55743e-3, 1.92578e-3, 3.28251e-3, 8.70484e-3, 1.295286e-2, 4.085301e-2),
        strict=True,
    )
)
PRINTED = 3e-6  # kappa0 is given with six or seven digits


@pytest.mark.parametrize("band", REFLECTIVE)
def test_solar_irradiance_of_goes_16_is_that_of_its_files(band):
    assert math.pi / solar_irradiance(band) == pytest.approx(KAPPA0[band], rel=PRINTED)


@pytest.mark.parametrize("satellite", SATELLITES)
@pytest.mark.parametrize("band", BANDS)
def test_all_satellites_see_nearly_the_same_sun(satellite, band):
    reference = KURUCZ.get(band, solar_irradiance(band))
    # C07 moves by 14 nm, where the spectrum falls as the fourth power; C01 of the files is low.
    assert solar_irradiance(band, satellite) == pytest.approx(reference, rel=0.015)


@pytest.mark.parametrize("band", BANDS)
def test_centroids_are_near_those_of_the_band_table(band):
    far = {"C04": 0.0061, "C07": 0.0141}.get(band, 0.0015)
    assert centroid_um(band) == BANDS[band].wavelength_um
    for satellite in SATELLITES:
        assert abs(centroid_um(band, satellite) - BANDS[band].wavelength_um) < far


def test_ceilings_are_reflectance_factors_of_one_and_a_fifth():
    for band in REFLECTIVE:
        factor = math.pi * packing(band).ceiling / solar_irradiance(band)
        assert 1.21 < factor < 1.26, band
    assert packing("C06").ceiling == pytest.approx(29.79, abs=0.005)
    assert packing("C07").ceiling == pytest.approx(25.59, abs=0.005)


def test_planck_coefficients_go_with_their_wavenumber():
    light, planck, boltzmann = 299792458.0, 6.62607015e-34, 1.380649e-23
    for satellite in SATELLITES:
        for band in ("C05", "C06", "C07"):
            fk1, fk2, *_ = planck_coefficients(band, satellite)
            wavenumber = fk2 * boltzmann / (planck * light)  # [m-1]
            assert fk1 == pytest.approx(2e5 * planck * light**2 * wavenumber**3, rel=1e-5)
            # The centroid of the response in wavenumber lies within its width of that in length.
            assert 1e6 / wavenumber == pytest.approx(centroid_um(band, satellite), rel=2e-3)


def test_gas_fit_misses_one_band_of_one_satellite():
    missed = [(s, b) for s in SATELLITES for b in BANDS if not gas_fit_covers(s, b)]
    assert missed == [("GOES-19", "C04")]


def test_unknown_names_are_refused():
    assert check_satellite("GOES-18") == "GOES-18"
    with pytest.raises(ValueError, match="satellite 'GOES-15' is not known; choose from.*GOES-16"):
        check_satellite("GOES-15")
    with pytest.raises(ValueError, match="'GOES-20' is not known"):
        solar_irradiance("C01", "GOES-20")
    with pytest.raises(ValueError, match="'C13'"):
        centroid_um("C13")
    with pytest.raises(ValueError, match="'C99'"):
        gas_fit_covers("GOES-16", "C99")
    with pytest.raises(ValueError, match="no band 'green'"):
        packing("green")
    with pytest.raises(ValueError, match="emission in band 'C03' is negligible; .*'C05', 'C06'"):
        planck_coefficients("C03")
