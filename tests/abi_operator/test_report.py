"""Lines that tell of a simulated scene."""

import pytest

from abi_operator.report import account_lines
from abi_operator.scene import COUNTED_OVER

ONE_TIME = {
    "smallest_model_top_pressure": 5000.0,
    "largest_model_top_pressure": 5000.0,
    "air_above_model": "a standard atmosphere",
    "assumed_droplet_number_count": 0,
    "gases": "none",
    "cloud_optics": "mie",
    "water_count": 6,
    "fire_count": 45,
    "burning_columns_count": 30,
    "fires_joined_count": 0,
    "unsimulated_condensate_share": 0.0,
    "negative_snow_mixing_ratio_count": 2,
    "smallest_negative_snow_mixing_ratio": -2e-9,
}


@pytest.mark.parametrize(
    ("several", "words"), [({}, ""), ({COUNTED_OVER: "3 times, of which"}, " (sum over 3 times)")]
)
def test_counts_of_several_times_are_told_to_be_sums(several, words):
    """Fifteen fires that burn at three times are not forty-five at one."""
    lines = list(account_lines(ONE_TIME | several))
    assert f"fires: 45 in 30 columns{words}" in lines
    assert f"water that glints: 6 columns{words}" in lines
    negative = "snow mixing ratio below 0, taken as 0: in 2 cells, down to -2e-09 kg kg-1"
    assert f"{negative}{words}" in lines
