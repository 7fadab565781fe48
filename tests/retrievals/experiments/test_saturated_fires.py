"""Fires that saturate C07."""

import numpy as np
import pytest

from retrievals.experiments import saturated_fires


@pytest.fixture(scope="module")
def table():
    return saturated_fires(size=16, seed=2, num_streams=2)


def test_all_fires_saturate_c07_and_nothing_else_does(table):
    np.testing.assert_array_equal(table["saturated"], table["burns"])
    assert table["burns"].sum() == round(0.08 * 256) == table["num_true"].isel(known_albedo=0).sum()
    assert (table["num_pixels"] == 128).all()


def test_fires_are_told_the_better_the_better_the_ground_is_known(table):
    area = table["roc_area"]
    assert (area.sel(known_albedo="as it is") > 0.99).all()
    assert (area.sel(known_albedo="its mean") < area.sel(known_albedo="as it is")).all()
    wrong = area.sel(known_albedo=["10 % errors", "its mean"])
    assert (wrong.sel(ground="bright") < wrong.sel(ground="dark")).all()


def test_the_excess_over_a_known_ground_is_noise_where_nothing_burns(table):
    excess = table["excess"].sel(known_albedo="as it is").values[~table["burns"].values]
    # 4 standard errors of the mean and of the deviation of 236 normal numbers.
    assert abs(excess.mean()) < 4 / np.sqrt(236) and abs(excess.std() - 1) < 4 / np.sqrt(2 * 236)
