"""The test with the near infrared on a small scene: what is exact in it is exact."""

import numpy as np
import pytest

from abi_operator.files import InputError
from abi_operator.products import GREEN_RECIPES
from abi_operator.sensitivity import nir_study
from abi_operator.sensitivity.green_change import TABLE
from abi_operator.sensitivity.nir_study import brf_by_band
from abi_operator.sensitivity.ssa_root import FALLS_SHORT, MEAN_TOLERANCE


@pytest.fixture(scope="module", params=[False, True], ids=["scene", "pixels"])
def study(request, image):
    return nir_study(image, pixel_by_pixel=request.param)


def test_the_mean_of_what_is_counted_changes_as_asked(study, image):
    counted = study["counted"].values > 0
    cloud = image["liquid_optical_depth"].sel(band="C03").values
    expected = (image["ash_brightness"].values >= 0.2) & (cloud < 0.01)
    assert (counted == expected).all() and 10 < counted.sum() < counted.size / 3
    if study.attrs["single_scattering_albedo"] == "one for the scene":
        mean = study["near_infrared"].values[counted].mean()
        for change in study["change"].values:
            changed = study["near_infrared_changed"].sel(change=change).values[counted].mean()
            assert abs(changed / ((1 + change) * mean) - 1) <= MEAN_TOLERANCE


def test_green_changes_by_its_weight_of_the_near_infrared(study):
    for recipe, weights in GREEN_RECIPES.items():
        some = study.sel(recipe=recipe)
        of_green = some["green_changed"] - some["green"]
        of_near = some["near_infrared_changed"] - some["near_infrared"]
        np.testing.assert_allclose(of_green, weights.near_infrared * of_near, atol=1e-12)
    assert GREEN_RECIPES["grasso2013"].near_infrared == 0.065
    # Eqs. (2) and (3): what changed stands below the line.
    relative = (study["green_changed"] - study["green"]) / study["green_changed"]
    found = study["green_change"]
    np.testing.assert_array_equal(found, relative.transpose(*found.dims))


def test_nothing_changes_outside_the_plume(study, image):
    outside = ~(image["ash_brightness"].values > 0)
    stored = brf_by_band(image)["C03"]
    assert outside.sum() > 100
    for name in ("near_infrared_changed", "near_infrared_first_order"):
        for field in study[name].values:
            np.testing.assert_array_equal(field[outside], stored[outside])
    for name in ("green_change", "green_change_first_order", "green_change_of_base"):
        assert (study[name].values[..., outside] == 0).all()
    assert np.isnan(study["ssa_changed"].values[:, outside]).all()


def test_the_plume_as_it_is_is_what_is_stored(study, image):
    """Nothing was left out of the simulation, so that it is the same number but for rounding."""
    np.testing.assert_allclose(study["near_infrared"], brf_by_band(image)["C03"], rtol=1e-12)


def test_reflectance_rises_ever_more_steeply(study):
    """So that what the slope says is below what comes, up and down."""
    inside = np.isfinite(study["ssa"].values)
    exact, first = study["near_infrared_changed"].values, study["near_infrared_first_order"].values
    assert (exact[:, inside] > first[:, inside]).all()
    up, down = exact[:, inside]
    assert (up > study["near_infrared"].values[inside]).all()
    assert (down < study["near_infrared"].values[inside]).all()


def test_pixels_that_fall_short_are_on_the_map(study):
    short = study["ssa_code"].values == FALLS_SHORT
    pixels = study.attrs["single_scattering_albedo"] == "of each pixel"
    assert short[0].any() == pixels
    assert (study["ssa_changed"].values[0][short[0]] == 1).all()


def test_a_table_is_looked_up_where_green_was_simulated(study, image):
    assert study["recipe"].values.tolist() == [*GREEN_RECIPES, TABLE]
    without = image.sel(band=["C01", "C02", "C03", "C06"])
    if study.attrs["single_scattering_albedo"] == "one for the scene":
        others = nir_study(without)
        assert others["recipe"].values.tolist() == list(GREEN_RECIPES)
        np.testing.assert_array_equal(
            others["green_change"], study["green_change"].sel(recipe=list(GREEN_RECIPES))
        )
    # The mean of a table's cells is near what it is made of, in clear and cloudy pixels alike.
    found = study["green"].sel(recipe=TABLE).values
    assert np.abs(found - brf_by_band(image)["green"]).mean() < 0.005


def test_what_a_result_lacks_is_told(image):
    with pytest.raises(InputError, match="no plume of smoke .plumes: ash."):
        nir_study(image, species="smoke")
    with pytest.raises(InputError, match="no band C02"):
        nir_study(image.sel(band=["C01", "C03"]))
    with pytest.raises(InputError, match="no pressure"):
        nir_study(image.drop_vars("pressure"))
    with pytest.raises(InputError, match="more than 0 and less than 1; got 1.5"):
        nir_study(image, change=1.5)
    with pytest.raises(InputError, match="no pixel is counted"):
        nir_study(image.assign(ash_brightness=0.1 * image["ash_brightness"]))
    with pytest.raises(InputError, match="one time at a time"):
        nir_study(image.expand_dims("time"))
