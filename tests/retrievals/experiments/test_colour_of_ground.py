"""Ash of the colour of the ground."""

import numpy as np
import pytest

from retrievals.experiments import ash_colour


@pytest.mark.slow
def test_ash_over_its_own_colour_tells_nothing():
    table = ash_colour(size=5, seed=1, num_streams=4)
    assert (table["num_pixels"] >= 38).all()
    contrast, nearest = table["contrast"].values, 2
    assert table["multiple"].values[nearest] == 1
    # Between the albedos of the grid contrast is all but straight.
    assert (np.abs(contrast[nearest]) < 1e-3).all()
    assert (contrast[0] > 0.01).all() and (contrast[-1] < -0.005).all()
    assert (np.diff(contrast, axis=0) < 0).all()
    freedom = table["freedom_aod"]
    for ssa in table["ssa"].values:
        assert freedom.sel(ssa=ssa).values.argmin() in (nearest, nearest + 1)
    assert (freedom[0] > freedom[nearest] + 0.1).all()
    assert (table["mean_sigma"][nearest] > 3 * table["mean_sigma"][0]).all()
    assert (table["mean_sigma"].sel(ssa="known") < table["mean_sigma"].sel(ssa="retrieved")).all()
