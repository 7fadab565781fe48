"""The test with the near infrared on a small scene: what is exact in it is exact.

Roots in the plume's single-scattering albedo against bisection, the study, and its command.
"""

import jax
import numpy as np
import pytest
import xarray as xr
from conventions import complaints
from PIL import Image
from typer.testing import CliRunner

from abi_operator import cli
from abi_operator.files import InputError
from abi_operator.products import GREEN_RECIPES
from abi_operator.scene import column_states
from abi_operator.sensitivity import PlumeBand, nir_study, ssa_for_mean, ssa_of_each
from abi_operator.sensitivity.green_change import TABLE
from abi_operator.sensitivity.nir_study import brf_by_band
from abi_operator.sensitivity.ssa_root import FALLS_SHORT, MEAN_TOLERANCE, REACHED
from abi_operator.settings import Settings

HOW = Settings(gases=(), num_streams=2)
# Of roots, beside which a step of Newton's method ends at 1e-10.
AGREE = 1e-8


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


def test_its_maps_are_along_what_they_differ_by(study, image):
    space = ("y", "x")
    for name in ("near_infrared", "ssa", "counted"):
        assert study[name].dims == space
    for name in ("near_infrared_changed", "near_infrared_first_order", "ssa_changed", "ssa_code"):
        assert study[name].dims == ("change", *space)
    assert study["green"].dims == ("recipe", *space)
    for name in ("changed", "first_order", "change", "change_first_order", "change_of_base"):
        assert study[f"green_{name}"].dims == ("recipe", "change", *space)
    outside = ~(image["ash_brightness"].values > 0)
    assert (study["ssa_code"].values[:, outside] == 0).all()


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


@pytest.fixture(scope="module")
def plume(image):
    inside = (image["ash_brightness"] > 0).values
    states = jax.tree.map(lambda x: x[inside.ravel()], column_states(image, ("C03",)))
    return PlumeBand(states, "ash", "C03", HOW)


def bisected(function, target, low, high):
    """Of a rising function, the root of each column, to 1e-9."""
    for _ in range(30):
        middle = (low + high) / 2
        above = function(middle) > target
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return (low + high) / 2


@pytest.mark.parametrize("factor", [1.1, 0.9])
def test_one_shift_changes_the_mean_as_asked(plume, factor):
    ssa = np.asarray(plume.ssa)
    counted = np.arange(ssa.size) % 3 > 0
    root = ssa_for_mean(plume, factor, counted)
    shift = root.ssa - ssa
    np.testing.assert_allclose(shift, shift[0], rtol=1e-12)
    means = np.mean(root.brf[counted]), np.mean(np.asarray(plume.brf(ssa))[counted])
    assert abs(means[0] / (factor * means[1]) - 1) < 1e-9 < MEAN_TOLERANCE
    found = bisected(
        lambda x: np.mean(np.asarray(plume.brf(ssa + x))[counted]), factor * means[1], -0.5, 0.05
    )
    assert abs(found - shift[0]) < AGREE and (root.code == REACHED).all()


@pytest.mark.parametrize("factor", [1.1, 0.9])
def test_every_pixel_changes_as_asked_or_keeps_the_end(plume, factor):
    ssa = np.asarray(plume.ssa)
    end = 1.0 if factor > 1 else 0.0
    base, farthest = np.asarray(plume.brf(ssa)), np.asarray(plume.brf(np.full_like(ssa, end)))
    reachable = (farthest >= factor * base) == (factor > 1)
    root = ssa_of_each(plume, factor)
    assert (root.code == np.where(reachable, REACHED, FALLS_SHORT)).all()
    assert reachable.any() and (factor < 1 or not reachable.all())
    assert (root.ssa[~reachable] == end).all()
    np.testing.assert_allclose(root.brf[reachable], factor * base[reachable], rtol=1e-9)
    found = bisected(lambda x: np.asarray(plume.brf(x)), factor * base, 0 * ssa, 0 * ssa + 1)
    np.testing.assert_allclose(root.ssa[reachable], found[reachable], atol=AGREE)


def test_a_mean_that_falls_short_keeps_the_end(plume):
    root = ssa_for_mean(plume, 3.0, np.ones(plume.ssa.shape, bool))
    assert (root.ssa == 1).all() and (root.code == FALLS_SHORT).all()


def test_the_slope_is_that_of_the_operator(plume):
    ssa, step = np.asarray(plume.ssa), 1e-5
    central = (np.asarray(plume.brf(ssa + step)) - np.asarray(plume.brf(ssa - step))) / (2 * step)
    np.testing.assert_allclose(plume.slope(), central, rtol=1e-7)


def test_what_cannot_be_asked_of_a_plume_is_told(plume):
    with pytest.raises(ValueError, match="no column is counted"):
        ssa_for_mean(plume, 1.1, np.zeros(plume.ssa.shape, bool))
    with pytest.raises(InputError, match="no plume 'smoke'.*there are \\['ash'\\]"):
        PlumeBand(plume.states, "smoke", "C03", HOW)


@pytest.fixture
def invoke(monkeypatch):
    """A function that runs the command line as if no other package added to it."""
    monkeypatch.setattr(cli, "entry_points", lambda **_: ())
    return lambda *words: CliRunner().invoke(cli.make_app(), [str(word) for word in words])


def test_it_writes_maps_a_table_and_a_picture(invoke, result_file, tmp_path):
    outcome = invoke("nir-test", result_file, "--out", tmp_path / "out", "--pixel-by-pixel")
    assert outcome.exit_code == 0, outcome.output
    names = ["nir_test.csv", "nir_test.nc", "nir_test.png"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == names
    with xr.open_dataset(tmp_path / "out" / "nir_test.nc") as maps:
        short = int((maps["ssa_code"].sel(change=0.1) == 1).sum())
        counted = maps["counted"].values > 0
        changes = 100 * maps["green_change"].sel(recipe="grasso2013", change=0.1).values[counted]
        assert "--pixel-by-pixel" in maps.attrs["history"]
        assert {maps[name].attrs["grid_mapping"] for name in ("green", "ssa")} == {"crs"}
    assert complaints(tmp_path / "out" / "nir_test.nc") == []
    assert f"{short} pixels fall short with 1, which they keep" in outcome.output
    assert f"counted: {counted.sum()} without cloud" in outcome.output
    assert (
        f"grasso2013      +10 {changes.mean():+8.3f} {np.median(changes):+8.3f}" in outcome.output
    )
    table = (tmp_path / "out" / "nir_test.csv").read_text().splitlines()
    assert table[1].startswith(f"grasso2013,10,{changes.mean():.6f},")
    with Image.open(tmp_path / "out" / "nir_test.png") as picture:
        sheet = np.asarray(picture)
    # Both maps of the change have their colours: red up, blue down, on one scale.
    assert (sheet[..., 0] > sheet[..., 2] + 100).sum() > 100
    assert (sheet[..., 2] > sheet[..., 0] + 50).sum() > 100


def test_what_is_wrong_is_one_sentence(invoke, result_file, tmp_path):
    for words, sentence in (
        (("--species", "smoke"), "no plume of smoke"),
        (("--time", 3), "has 1 times, counted from 0; got --time 3"),
        (("--change", 2), "less than 1; got 2"),
    ):
        outcome = invoke("nir-test", result_file, "--out", tmp_path / "no", *words)
        assert outcome.exit_code == 2 and sentence in outcome.stderr
        assert not (tmp_path / "no").exists()
