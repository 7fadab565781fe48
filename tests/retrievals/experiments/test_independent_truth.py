"""A truth that the inversion does not share."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from retrievals.experiments import draw_independent_truth, independent_truth
from retrievals.experiments.independent_case import STRIPS, uneven
from retrievals.experiments.independent_clouds import independent_cloud
from retrievals.experiments.independent_fires import independent_fire
from retrievals.experiments.independent_plumes import RADII_UM, independent_plume
from retrievals.experiments.independent_truth import share_within


@pytest.mark.slow
def test_a_covariance_of_the_forward_model_widens_the_error_bars():
    table = independent_truth(size=6, seed=1, kinds=["smoke"], true_streams=4, num_streams=2)
    assert (table["num_pixels"] >= 35).all()
    before, after, _ = (table["coverage_68"].sel(S_obs=name) for name in table["S_obs"].values)
    assert (before < 0.6).all() and (after > before + 0.2).all()
    sigma = table["sigma"]
    assert (sigma.isel(S_obs=1) > sigma.isel(S_obs=0)).mean() > 0.9
    assert ((table["forward_error"] > 0.005) & (table["forward_error"] < 0.3)).all()


def test_what_did_not_converge_is_drawn_neither_inside_nor_outside():
    """As in the table's coverage: three of the four that did are within 1 and all within 3."""
    ratio = np.array([0.5, np.nan, 0.9, 2.0, np.nan, 0.1])
    np.testing.assert_array_equal(share_within(ratio, np.array([1.0, 3.0])), [0.75, 1.0])
    assert np.isnan(share_within(np.full(3, np.nan), np.ones(2))).all()
    dims = ("quantity", "S_obs")
    table = xr.Dataset(
        {
            "truth": (("quantity", "pixel"), np.zeros((1, 6))),
            "retrieved": ((*dims, "pixel"), ratio[None, None]),
            "sigma": ((*dims, "pixel"), np.ones((1, 1, 6))),
            "bias": (dims, [[0.0]]),
        },
        {"quantity": ["smoke"], "S_obs": ["noise"]},
    )
    figure = Figure()
    draw_independent_truth(table, figure)
    shares = figure.axes[-1].lines[-1].get_ydata()
    assert set(np.unique(shares)) <= {0.0, 0.25, 0.5, 0.75, 1.0} and shares[-1] == 1.0


def test_factors_of_strips_have_a_mean_of_one():
    factors = uneven(np.random.default_rng(0), 50, 0.3)
    np.testing.assert_allclose(factors.mean(axis=1), 1, rtol=1e-12)
    assert 0.2 < factors.std() < 0.4


@pytest.mark.parametrize("species", sorted(RADII_UM))
def test_the_strips_of_a_plume_have_its_mean(species):
    case = independent_plume(species)
    drawn = case.draw(np.random.default_rng(0), 4)
    plume = drawn.cells.atmosphere.plumes[species]
    aod, ssa = drawn.truth
    np.testing.assert_allclose(plume.aod_550.reshape(4, STRIPS).mean(axis=1), aod, rtol=1e-12)
    for band, albedo in drawn.cells.albedo.items():
        np.testing.assert_allclose(
            albedo.reshape(4, STRIPS).mean(axis=1), drawn.believed.albedo[band], rtol=1e-12
        )
    believed = drawn.believed.atmosphere.plumes[species]
    np.testing.assert_allclose(plume.base[::STRIPS] - believed.base, 500)
    assert ((ssa > 0.85) & (ssa < 1)).all()


def test_the_strips_of_a_cloud_have_its_thickness_and_droplets():
    """As the state vector reads them; and its droplets grow upwards."""
    case = independent_cloud()
    drawn = case.draw(np.random.default_rng(0), 4)
    liquid = drawn.cells.atmosphere.liquid
    thickness, radius = (quantity.get(liquid) for quantity in case.vector.quantities)
    np.testing.assert_allclose(thickness.reshape(4, STRIPS).mean(axis=1), drawn.truth[0], rtol=1e-9)
    np.testing.assert_allclose(radius[::STRIPS], drawn.truth[1], rtol=1e-9)
    np.testing.assert_allclose(radius[1::STRIPS], drawn.truth[1], rtol=1e-9)
    ratio = np.asarray(liquid.mass_path / np.where(liquid.mass_path > 0, liquid.number_path, 1))
    top, below = (ratio[:, layer] for layer in np.flatnonzero(ratio[0]))
    np.testing.assert_allclose(top / below, 8, rtol=1e-9)
    values = case.vector.values(drawn.x)
    np.testing.assert_allclose(values["cloud_optical_thickness"], drawn.truth[0], rtol=1e-9)


def test_the_strips_of_a_fire_emit_what_it_does():
    case = independent_fire()
    drawn = case.draw(np.random.default_rng(0), 4)
    fire, (kelvin, share) = drawn.cells.fire, drawn.truth
    np.testing.assert_allclose(fire.fraction.reshape(4, STRIPS).mean(axis=1), share, rtol=1e-12)
    power = np.asarray(fire.fraction * fire.temperature**4).reshape(4, STRIPS).mean(axis=1)
    np.testing.assert_allclose(power, share * kelvin**4, rtol=1e-12)
    ground = np.asarray(drawn.cells.surface_temperature).reshape(4, STRIPS)
    believed = drawn.believed.surface_temperature
    np.testing.assert_allclose(ground.mean(axis=1), believed, rtol=1e-12)
    more = drawn.cells.atmosphere.gases.vapour[0] / drawn.believed.atmosphere.gases.vapour[0]
    np.testing.assert_allclose(more, 1.2, rtol=1e-12)


@pytest.mark.slow
def test_error_bars_hold_the_truth_once_the_forward_model_has_one():
    """Of plumes, at the size of the command, and another seed than its own."""
    table = independent_truth(seed=5, kinds=["smoke", "ash"])
    depth = table.sel(quantity=["smoke aod_550", "ash aod_550"])["coverage_68"]
    assert (depth.isel(S_obs=0) < 0.5).all()
    assert (depth.isel(S_obs=1) >= 0.6).all()


@pytest.mark.slow
def test_so_do_those_of_cloud_and_fires_once_its_mean_is_known():
    """0.6, less a standard error: clouds look like their tops, so that their radii are biased."""
    table = independent_truth(seed=5, kinds=["cloud", "fire"], true_streams=12)
    coverage = table["coverage_68"]
    assert (coverage.isel(S_obs=2) >= 0.55).all() and (coverage.isel(S_obs=0) < 0.5).all()
    bias = abs(table["bias"].sel(quantity="cloud effective radius [um]"))
    assert bias.isel(S_obs=2) < 0.3 * bias.isel(S_obs=0)
