"""Sensitivities of a scene: the command, and the function behind it."""

import numpy as np
import pytest
import xarray as xr
from conventions import complaints
from PIL import Image
from typer.testing import CliRunner

from abi_operator import cli
from abi_operator.files import InputError
from abi_operator.sensitivity import Sampling, sensitivity_study
from abi_operator.sensitivity.nir_study import brf_by_band


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
    with xr.open_dataset(out / "sensitivity.nc") as maps:
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
        elasticity = some["elasticity"].sel(to="fire_fraction").values[inside]
        np.testing.assert_allclose(elasticity, 1, atol=1e-2)
        assert (some["jacobian"].sel(to="albedo").values[inside] < 0).all()


def test_all_pixels_and_no_check(image):
    how = {"where": "all", "second_order": False, "sampling": Sampling(0)}
    study = sensitivity_study(image, ["C03"], ["ssa"], **how)
    outside = ~(image["ash_brightness"].values > 0)
    assert (study["jacobian"].values[0, 0, outside] == 0).all()
    assert "sampled_variance" not in study and np.isnan(study["second_derivative"]).all()


@pytest.mark.parametrize(
    "words, sentence",
    [
        (("--of", "C05", "--to", "ssa"), "no band C05"),
        (("--of", "C03", "--to", "vapour"), "no atmosphere.gases.vapour"),
        (("--of", "C03", "--to", "ssa", "--species", "smoke"), "no plume of smoke"),
        (("--of", "C03", "--to", "ssa", "--sigma", "ssa"), "--sigma takes NAME=VALUE"),
        (("--of", "C03", "--to", "ssa", "--sigma", "albedo=1"), "sigma of albedo is given"),
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
