"""Smoke over stratus, and over land."""

import jax.numpy as jnp
import numpy as np
import pytest

from retrievals.declarations import mean_droplet_radius_um, optical_thickness
from retrievals.experiments import over_stratus
from retrievals.experiments.over_stratus import _state


def test_the_stratus_has_the_thickness_that_was_asked_for():
    cloud = _state(np.full((3, 3), 0.03), np.array([2.0, 10.0, 30.0])).atmosphere.liquid
    np.testing.assert_allclose(optical_thickness(cloud), [2, 10, 30], rtol=1e-9)
    np.testing.assert_allclose(mean_droplet_radius_um(cloud), 10, rtol=1e-9)
    height = _state(np.full((1, 3), 0.03), jnp.ones(1)).atmosphere.height[0]
    assert 400 < height[-2] < height[-3] < 1500  # below the smoke, in one layer


@pytest.mark.slow
def test_smoke_over_stratus_is_worse_known_than_over_land():
    table = over_stratus(size=12, seed=3, num_streams=4)
    assert (table["num_pixels"] >= 140).all()
    right = table.sel(known="as it is")
    # 4 binomial standard deviations of 144 pixels, and what is not linear.
    assert (np.abs(right["coverage_68"] - 0.683) < 0.16).all()
    assert right["rmse"].sel(below="stratus") > 2 * right["rmse"].sel(below="land")
    freedom = right["degrees_of_freedom"]
    assert freedom.sel(below="stratus") < freedom.sel(below="land") < 2
    assert (table["rmse"].sel(known="10 % errors") > 2 * right["rmse"]).all()
