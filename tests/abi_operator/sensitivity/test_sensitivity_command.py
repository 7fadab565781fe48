"""Sensitivities of a scene: the command, and the function behind it."""

import numpy as np
import pytest
import xarray as xr
from conventions import complaints
from PIL import Image
from typer.testing import CliRunner

from abi_operator import cli
from abi_operator.files import InputError
from abi_operator.sensitivity import Sampling, declared, sensitivity_study
from abi_operator.sensitivity.nir_study import brf_by_band
from abi_operator.sensitivity.scene_study import (
    DEFAULT_FIRE,
    _under_a_moving_sun,
    chosen_pixels,
    states_of,
)
from abi_operator.sensitivity.sensitivity_report import ranking, report_lines


@pytest.fixture
def invoke(monkeypatch):
    """A function that runs the command line as if no other package added to it."""
    monkeypatch.setattr(cli, "entry_points", lambda **_: ())
    return lambda *words: CliRunner().invoke(cli.make_app(), [str(word) for word in words])


def test_it_writes_maps_a_ranking_and_a_picture(invoke, result_file, image, tmp_path):
    out = tmp_path / "out"
    words = ["--of", "C03", "--to", "aod_550,ssa, albedo", "--samples", 20]
    words += ["--sigma", "ssa=0.005", "--correlation", "aod_550,ssa=0.5", "--sampled-pixels", 8]
    outcome = invoke("sensitivity", result_file, *words, "--out", out)
    assert outcome.exit_code == 0, outcome.output
    names = ["sensitivity.csv", "sensitivity.nc", "sensitivity.png"]
    assert sorted(path.name for path in out.iterdir()) == names
    inside = image["ash_brightness"].values > 0
    assert complaints(out / "sensitivity.nc") == []
    with xr.open_dataset(out / "sensitivity.nc") as maps:
        for name in ("value", "jacobian", "sample_count"):
            assert maps[name].attrs["grid_mapping"] == "crs"
        said = {"species": "ash", "where": "plume", "satellite": "GOES-16", "gases": "none"}
        said |= {"num_streams": 2, "samples": 20, "seed": 0}
        assert said.items() <= maps.attrs.items() and "fire" not in maps.attrs
        value = maps["value"].sel(of="C03").values
        np.testing.assert_allclose(value[inside], brf_by_band(image)["C03"][inside], rtol=1e-12)
        assert np.isnan(value[~inside]).all()
        assert maps["step"].values.tolist() == [0.1, 0.005, 0.01]
        np.testing.assert_allclose(maps["covariance"].sel({"to": "ssa", "with": "aod_550"}), 2.5e-4)
        parts = maps["variance_part"].sum("to", skipna=False)
        np.testing.assert_allclose(parts, maps["variance"], rtol=1e-10)
        assert np.isfinite(maps["sampled_variance"].sel(of="C03").values).sum() == 8
        rising = maps["jacobian"].sel(of="C03", to=["ssa", "albedo"]).values[:, inside]
        assert (rising > 0).all()
        shares = maps["variance_part"].sel(of="C03").mean(("y", "x"))
        first = str(shares["to"].values[int(np.argmax(np.abs(shares.values)))])
    table = (out / "sensitivity.csv").read_text().splitlines()
    assert table[0].startswith("of,to,units,step") and table[1].startswith(f"C03,{first},1,")
    assert "variance by draws" in outcome.output and "2nd order" in outcome.output
    with Image.open(out / "sensitivity.png") as picture:
        assert picture.width > 3 * 384


@pytest.mark.slow
def test_fires_are_put_into_a_scene_without_temperatures(invoke, result_file, tmp_path):
    words = ["--of", "fire_contrast", "--to", "fire_fraction,albedo", "--no-second-order"]
    words += ["--fire", "0.01,900", "--samples", 0, "--out", tmp_path / "out"]
    outcome = invoke("sensitivity", result_file, *words)
    assert outcome.exit_code == 0, outcome.output
    assert complaints(tmp_path / "out" / "sensitivity.nc") == []
    with xr.open_dataset(tmp_path / "out" / "sensitivity.nc") as maps:
        some = maps.sel(of="fire_contrast")
        inside = np.isfinite(some["value"].values)
        assert (some["value"].values[inside] > 0).all()
        assert maps.attrs["fire"] == "0.01 of each pixel at 900 K" and "samples" not in maps.attrs
        elasticity = some["elasticity"].sel(to="fire_fraction").values[inside]
        np.testing.assert_allclose(elasticity, 1, atol=1e-2)
        assert (some["jacobian"].sel(to="albedo").values[inside] < 0).all()


def test_all_pixels_and_no_check(image):
    how = {"where": "all", "second_order": False, "sampling": Sampling(0)}
    study = sensitivity_study(image, ["C03"], ["ssa"], **how)
    outside = ~(image["ash_brightness"].values > 0)
    assert (study["jacobian"].values[0, 0, outside] == 0).all()
    assert "sampled_variance" not in study and np.isnan(study["second_derivative"]).all()


def test_an_elasticity_is_the_same_whatever_else_is_looked_at(image):
    """On a ground, and of ash, that differ by band."""
    how = {"second_order": False, "sampling": Sampling(0)}
    alone, both = (
        sensitivity_study(image, of, ["ssa", "albedo"], **how)["elasticity"].sel(of="C03").values
        for of in (["C03"], ["C03", "green"])
    )
    good = np.isfinite(alone)
    assert good.any() and (good == np.isfinite(both)).all()
    np.testing.assert_allclose(both[good], alone[good], rtol=1e-9)


def test_a_scenes_own_fires_burn_in_what_is_looked_at(image):
    """Or those whose contrast is asked for; lava shines without one."""
    chosen, zeros = chosen_pixels(image, None, "all"), 0 * image["latitude"]
    fires = image.assign(fire_fraction=zeros + 0.01, fire_temperature=zeros + 900.0)
    own, asked = (states_of(fires, chosen, of, DEFAULT_FIRE) for of in (["C06"], ["fire_contrast"]))
    for states, share, kelvin in ((own, 0.01, 900.0), (asked, 0.04, 800.0)):
        np.testing.assert_allclose(states.fire.fraction, share)
        np.testing.assert_allclose(states.fire.temperature, kelvin)
        assert states.atmosphere.temperature is not None and states.surface_temperature is not None
    assert states_of(image, chosen, ["C06"], DEFAULT_FIRE).fire is None
    warm, lava = (
        states_of(image.assign(surface_temperature=zeros + x), chosen, ["C06"], DEFAULT_FIRE).fire
        for x in (300.0, 1200.0)
    )
    assert warm is None and (lava.fraction == 0).all()


def test_the_suns_path_goes_with_a_sun_that_is_moved(image):
    states = states_of(image, chosen_pixels(image, None, "all"), ("C03",), DEFAULT_FIRE)
    flat, moving = image.assign_attrs(sun_path="flat"), declared("solar_zenith")
    assert image.attrs["sun_path"] == "spherical" and not states.geometry.spherical
    assert _under_a_moving_sun(image, states, [moving]).geometry.spherical
    assert not _under_a_moving_sun(flat, states, [moving]).geometry.spherical
    others = [declared(name, "ash") for name in ("ssa", "view_zenith")]
    assert not _under_a_moving_sun(image, states, others).geometry.spherical


def test_changes_that_are_ranked_are_of_the_same_pixels():
    """Of a straight line, half of whose pixels may not go down by the step."""
    slope, dims = np.arange(1.0, 5.0).reshape(2, 2), ("of", "to", "y", "x")
    down = np.where(slope < 3, -0.1 * slope, np.nan)
    fields = {"jacobian": slope, "elasticity": slope, "change_up": 0.1 * slope, "change_down": down}
    fields |= {"second_derivative": np.full((2, 2), np.nan), "variance_part": slope**2}
    maps = {name: (dims, values[None, None]) for name, values in fields.items()}
    maps |= {name: (("of", "y", "x"), slope[None] ** 2) for name in ("value", "variance")}
    labels = {"of": ["C03"], "to": ["ssa"], "to_units": ("to", ["1"]), "step": ("to", [0.1])}
    study = xr.Dataset(maps, labels)
    (row,) = ranking(study)
    assert row.up == -row.down == pytest.approx(row.jacobian * row.step)
    assert row.pixels == 2 and np.isnan(row.second) and row.share == 1
    assert "(changes of 2 pixels)" in report_lines(study)[2]


@pytest.mark.parametrize(
    "words, sentence",
    [
        (("--of", "C05", "--to", "ssa"), "no band C05"),
        (("--of", "C03", "--to", "vapour"), "no atmosphere.gases.vapour"),
        (("--of", "C03", "--to", "ssa", "--species", "smoke"), "no plume of smoke"),
        (("--of", "C03", "--to", "ssa", "--sigma", "ssa"), "--sigma takes NAME=VALUE"),
        (("--of", "C03", "--to", "ssa", "--sigma", "albedo=1"), "sigma of albedo is given"),
        (("--of", "C03", "--to", "ssa,ssa"), "each input is given once; got ssa"),
        (("--of", "C03,C03", "--to", "ssa"), "each output is given once; got C03"),
        (("--of", "C03", "--to", "ssa", *2 * ("--sigma", "ssa=1")), "--sigma takes each name"),
        (
            ("--of", "C03", "--to", "ssa,albedo", *2 * ("--correlation", "ssa,albedo=0.1")),
            "--correlation takes each name or pair once",
        ),
        (("--of", "C03", "--to", "ssa", "--samples", "1"), "2 samples or more, or 0 for no check"),
        (("--of", "fire_contrast", "--to", "ssa", "--fire", "hot"), "--fire takes a share"),
        (("--of", "C03", "--to", "ssa", "--where", "sea"), "'plume' or 'all'; got 'sea'"),
    ],
)
def test_what_is_wrong_is_one_sentence(invoke, result_file, tmp_path, words, sentence):
    outcome = invoke("sensitivity", result_file, *words, "--out", tmp_path / "no")
    assert outcome.exit_code == 2 and sentence in outcome.stderr, outcome.output
    assert not (tmp_path / "no").exists()


def test_one_time_is_looked_at(image):
    with pytest.raises(InputError, match="one time at a time"):
        sensitivity_study(image.expand_dims("time"), ["C03"], ["ssa"])
