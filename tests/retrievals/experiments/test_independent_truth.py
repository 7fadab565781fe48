"""A truth that the inversion does not share."""

import numpy as np
import pytest

from retrievals.experiments import independent_truth
from retrievals.experiments.independent_truth import _drawn, _uneven


@pytest.mark.slow
def test_a_covariance_of_the_forward_model_widens_the_error_bars():
    table = independent_truth(size=6, seed=1, kinds=["smoke"], true_streams=4, num_streams=2)
    assert (table["num_pixels"] >= 35).all()
    before, after = (table["coverage_68"].sel(S_obs=name) for name in table["S_obs"].values)
    assert (before < 0.6).all() and (after > before + 0.2).all()
    sigma = table["sigma"]
    assert (sigma.isel(S_obs=1) > sigma.isel(S_obs=0)).mean() > 0.9
    assert ((table["forward_error"] > 0.005) & (table["forward_error"] < 0.3)).all()


def test_the_cells_of_a_pixel_have_its_mean():
    cells, believed, aod, ssa = _drawn(np.random.default_rng(0), "ash", 4)
    factors = _uneven(np.random.default_rng(0), 50, 0.3)
    np.testing.assert_allclose(factors.mean(axis=1), 1, rtol=1e-12)
    assert 0.2 < factors.std() < 0.4
    plume = cells.atmosphere.plumes["ash"]
    np.testing.assert_allclose(plume.aod_550.reshape(4, 5).mean(axis=1), aod, rtol=1e-12)
    for band, albedo in cells.albedo.items():
        np.testing.assert_allclose(
            albedo.reshape(4, 5).mean(axis=1), believed.albedo[band], rtol=1e-12
        )
    np.testing.assert_allclose(plume.base[::5] - believed.atmosphere.plumes["ash"].base, 500)
    assert ssa.shape == (4, 3) and ((ssa > 0.9) & (ssa < 1)).all()


@pytest.mark.slow
def test_error_bars_hold_the_truth_once_the_forward_model_has_one():
    """At the size of the command, and another seed than its own."""
    table = independent_truth(seed=5)
    depth = table.sel(quantity=["smoke aod_550", "ash aod_550"])["coverage_68"]
    assert (depth.isel(S_obs=0) < 0.5).all()
    assert (depth.isel(S_obs=1) >= 0.6).all()
