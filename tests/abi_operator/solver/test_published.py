"""The solver against the tables of van de Hulst and of Garcia and Siewert, and in equilibrium."""

import numpy as np
import pytest
from disort_suite import read_table
from published import MEAN_AZIMUTHS, plane_albedos, radiances

# Six digits are printed by Garcia and Siewert, five decimals by van de Hulst.
SIX_DIGITS, FIVE_DECIMALS = 1e-5, 1e-5
# Half of the last digit; what 32 streams leave besides is given with each table.
HALF = 0.5
# Rounding of one solve whose sums are all of the size of the answer.
ROUNDING = 1e-13


def last_digit(value):
    """Worth of the sixth digit."""
    return SIX_DIGITS * 10.0 ** np.floor(np.log10(value))


@pytest.mark.parametrize(
    ("num_streams", "left"), [(32, 5.2e-6), pytest.param(64, 1e-6, marks=pytest.mark.slow)]
)
def test_garcia_and_siewert(num_streams, left):
    """Haze L at two azimuths and the azimuthal mean of Mie spheres: six digits.

    `left` is what the streams leave, relative, at 32 the larger part for Haze L in the zenith.
    """
    found = iter(radiances(num_streams)["garcia_siewert"])
    for row in read_table("garcia_siewert.csv"):
        mean = row["azimuth_deg"] == "mean"
        value = np.mean([next(found) for _ in range(len(MEAN_AZIMUTHS) if mean else 1)])
        expected = float(row["radiance"])
        tolerance = HALF * last_digit(expected) + left * expected
        assert abs(value - expected) <= tolerance, (row, value)
    assert next(found, None) is None


def test_van_de_hulst_reflection():
    """Henyey-Greenstein slab, five decimals; 32 streams leave 2e-6 at most."""
    found = iter(radiances(32)["van_de_hulst"])
    for row in (r for r in read_table("van_de_hulst.csv") if r["mu"] != "flux"):
        value, expected = next(found), float(row["reflection"])
        assert abs(value - expected) <= HALF * FIVE_DECIMALS + 2e-6, (row, value)


@pytest.mark.parametrize(
    ("num_streams", "left"), [(16, 5e-6), pytest.param(32, 1e-7, marks=pytest.mark.slow)]
)
def test_van_de_hulst_plane_albedo(num_streams, left):
    """Isotropic and Henyey-Greenstein slabs, five decimals and what the streams leave."""
    found = iter(plane_albedos(num_streams)["van_de_hulst"])
    for row in (r for r in read_table("van_de_hulst.csv") if r["mu"] == "flux"):
        value, expected = next(found), float(row["reflection"])
        assert abs(value - expected) <= HALF * FIVE_DECIMALS + left, (row, value)


def test_isothermal_black_body():
    """In a box of one temperature any column sends out B: whatever scatters, whatever the ground.

    60 columns of 1 to 6 layers, omega 0 to 1, tau 0 to 100, ground black to white.
    """
    np.testing.assert_allclose(radiances(16)["isothermal"], 1.7, rtol=ROUNDING)
