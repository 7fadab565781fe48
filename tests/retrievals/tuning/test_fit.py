"""A plume's numbers come back from its own image, and another world is told."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

from abi_operator.instrument import Imager, observe_mean, radiance_from_reflectance_factor
from retrievals.observation import add_noise
from retrievals.tuning import Errors, report_lines, tuned
from retrievals.tuning.fit import _normal, image_of
from retrievals.tuning.plume_pixels import plume_pixels
from retrievals.tuning.study import NOISE_ALONE, _problem

NUMBERS = ("strength", "ssa", "height")
TRUTH = (1.3, -0.4, 3000.0)


def of_plume(image, problem, x):
    """Reflectance factors of the scene with another plume (band, y, x)."""
    values, _ = image_of(problem, x)
    return image["reflectance_factor"].copy(data=problem.pixels.on_map(values))


@pytest.fixture(scope="module")
def problem(image, numbers, observe_as):
    """Fit of the scene to its own image."""
    everywhere = np.ones((3, 8), bool)
    seen = observe_as(image["reflectance_factor"])
    pixels = plume_pixels(image, seen, everywhere, everywhere, ("C01", "C02", "C03"))
    return _problem(image, numbers, pixels, NOISE_ALONE)


@pytest.fixture(scope="module")
def true_image(image, numbers, problem):
    """Reflectance factors of another plume in the same scene (band, y, x)."""
    return of_plume(image, problem, np.asarray(numbers.x(*TRUTH)))


@pytest.fixture(scope="module")
def found(image, true_image, problem, observe_as):
    """Fit to the other plume's image with noise, of a scene as it would be simulated."""
    own = of_plume(image, problem, problem.x_prior)
    return tuned(image.assign(reflectance_factor=own), observe_as(true_image, seed=3), NUMBERS)


def test_sums_are_those_of_the_whole_image(problem):
    """Normal equations, added up by blocks, are the derivative of half the cost."""
    sigma = problem.error_of(problem.pixels.measured)
    z = np.array([0.3, -0.2, 0.4])
    here = _normal(problem, sigma, z)
    for i in range(3):
        step = 1e-4 * np.eye(3)[i]
        up, down = (_normal(problem, sigma, z + sign * step).square.sum() for sign in (1, -1))
        np.testing.assert_allclose(here.slope.sum(0)[i], (up - down) / 4e-4, rtol=1e-5)


def test_numbers_come_back_without_noise(image, true_image, observe_as):
    exact = tuned(image, observe_as(true_image), NUMBERS)
    pull = (exact["value"] - np.array(TRUTH)) / exact["sigma"]
    # The prior, at the scene's own plume, pulls by little.
    assert np.abs(pull).max() < 0.05 and exact.attrs["converged"] == 1
    assert "closer than noise allows" in exact.attrs["misfit"]


def test_numbers_come_back_within_their_errors(found):
    pull = (found["value"] - np.array(TRUTH)) / found["sigma"]
    assert np.abs(pull).max() < 3
    assert found.attrs["misfit_found"] == 0 and found.attrs["not_told"] == "none"
    # Height is told by the air above the plume, most of it in the shortest wave.
    by_band = found["band_sigma"].sel(element="height").values
    assert (np.diff(by_band) > 0).all()
    assert (found["rmse"].sel(region="plume").diff("stage") < 0).all()
    own = found["ssa"].sel(band="C02").item()
    assert 0 < own < 1 and found["ssa_sigma"].min() > 0


def test_the_report_says_what_was_found(found):
    text = "\n".join(report_lines(found))
    assert "no misfit found" in text and "correlations of the errors" in text
    assert "single-scattering albedo: C01" in text


def test_another_ground_is_told(image, true_image, observe_as):
    """As the ground of land, brighter by a tenth, would be."""
    wrong = image.assign(surface_albedo=1.1 * image["surface_albedo"])
    found = tuned(wrong, observe_as(true_image, seed=3), NUMBERS)
    assert found.attrs["misfit_found"] == 1 and "MISFIT" in report_lines(found)[-1]
    assert any("errors would be" in line for line in report_lines(found))


def test_an_unknown_gain_is_found(image, true_image, observe_as):
    """A band that is 3 % too bright is no misfit where the calibration may be wrong by that."""
    gains = xr.DataArray([1.03, 1.0, 0.98], dims="band")
    seen = observe_as(add_noise(true_image * gains, 5))
    found = tuned(image, seen, NUMBERS, errors=Errors(calibration=True))
    truth = np.array([*TRUTH, *gains.values])
    assert np.abs((found["value"] - truth) / found["sigma"]).max() < 3
    assert found.attrs["misfit_found"] == 0
    assert list(found["element"].values[3:]) == ["gain_C01", "gain_C02", "gain_C03"]
    # The table is of what the residuals are of: a bias that the gains explain is none.
    one = found.sel(stage="tuned", region="plume")
    assert (np.abs(one["bias"]) < 2e-3 * one["observed_mean"]).all()
    assert "with the fitted gains" in found["simulated"].attrs["long_name"]


def test_counts_are_no_misfit(image, numbers, observe_as):
    """Rounding adds about an eighth to the variance of a dark scene, and is in the errors."""
    bands = ("C01", "C03")
    counting = Imager(quantised=True)
    truth = np.broadcast_to(0.05 + 0.001 * np.arange(8), (50, 3, 2, 8))
    reports = [
        observe_mean(
            radiance_from_reflectance_factor(jnp.asarray(truth[:, :, i]), band),
            band,
            counting,
            key=jax.random.key(i),
        ).reflectance_factor
        for i, band in enumerate(bands)
    ]
    seen = np.stack(reports, axis=-1).reshape(-1, 2)
    observed = observe_as(image["reflectance_factor"])
    everywhere = np.ones((3, 8), bool)
    for counts, expected in ((np.array([1, 0, 1], np.int8), 1.0), (None, 1.13)):
        one = observed if counts is None else observed.assign(quantised=("band", counts))
        pixels = plume_pixels(image, one, everywhere, everywhere, bands)
        error = _problem(image, numbers, pixels, NOISE_ALONE).error_of
        predicted = np.moveaxis(truth, 2, -1).reshape(-1, 2)
        chi_square = np.mean(((seen - predicted) / error(predicted)) ** 2)
        assert abs(chi_square - expected) < 3 * np.sqrt(2 / seen.size) * expected


def test_where_a_fire_shines_no_plume_is_scored(image, true_image, observe_as, monkeypatch):
    """Of what was observed there a fit has predicted no fire; bands without it count as ever."""
    monkeypatch.setattr("retrievals.tuning.plume_pixels.FIRE_BANDS", ("C03",))
    burns = ((image["x"] == 2) & (image["y"] == 1)).transpose("y", "x")
    lit = true_image + xr.where((true_image["band"] == "C03") & burns, 0.6, 0.0)
    scene = image.assign(
        reflectance_factor=lit, fire_fraction=0.02 * burns, fire_temperature=900.0 + 0 * burns
    )
    found = tuned(scene, observe_as(lit), NUMBERS)
    tuned_to = found.sel(stage="tuned", region="plume")
    assert tuned_to["count"].values.tolist() == [24, 24, 23]
    assert np.abs(found["difference"].sel(stage="tuned")).max() < 1e-3
    lost = np.isnan(found["simulated"].sel(stage="tuned", band="C03"))
    np.testing.assert_array_equal(lost, burns)


def test_an_error_that_is_no_number_where_nothing_counts_is_none_of_the_others(problem):
    """As of a pixel that cannot be predicted, in which nothing was observed."""
    measured = problem.pixels.measured.copy()
    measured[2] = np.nan
    holed = problem._replace(pixels=replace(problem.pixels, measured=measured))
    sigma = problem.error_of(problem.pixels.measured)
    expected = _normal(holed, sigma, np.zeros(3))
    sigma[2] = np.nan
    found = _normal(holed, sigma, np.zeros(3))
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    assert (found.residual[2] == 0).all()
