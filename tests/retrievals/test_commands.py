"""The commands, as the command line calls them."""

import numpy as np
import pytest
import typer
import xarray as xr
from readme import run_block
from typer.testing import CliRunner

from abi_operator.files import InputError, ResultWriter
from retrievals import ResultCode, commands
from retrievals.commands import finish_demo, retrieve, score


@pytest.fixture
def folder(tmp_path, simulated):
    """A folder with the result of the scene."""
    times = np.array(["2007-10-23T18:00"], "datetime64[ns]")
    attributes = {"num_streams": simulated.attrs["num_streams"]}
    with ResultWriter(
        tmp_path / "result.nc", times=times, shape=(3, 4), attributes=attributes
    ) as writer:
        writer.write(0, slice(0, 3), simulated)
    return tmp_path


@pytest.fixture
def run():
    app = typer.Typer()
    app.command("retrieve")(retrieve)
    app.command("score")(score)
    return lambda *arguments: CliRunner().invoke(app, [str(a) for a in arguments])


def test_retrieve_and_score(folder, run):
    out = folder / "new" / "smoke.nc"
    answer = run("retrieve", "smoke", folder / "result.nc", "--out", out)
    assert answer.exit_code == 0, answer.output
    with xr.open_dataset(out) as written:
        assert written["result_code"].dtype == np.int8
        assert written["aod_550"].dims == ("time", "y", "x")
        assert written.attrs["Conventions"] == "CF-1.11"
        latest, earlier = written.attrs["history"].split("\n")
        assert f": abi-operator retrieve smoke {folder / 'result.nc'} --out {out}" in latest
        assert "written by abi_operator" in earlier
    csv = folder / "scores.csv"
    answer = run("score", folder / "result.nc", out, "--csv", csv)
    assert answer.exit_code == 0, answer.output
    heads = "N bias rmse max r slope inside EE 68 % 95 % chi2".split()
    assert answer.output.split("\n")[0].split() == heads
    assert "success: " in answer.output
    assert csv.read_text().startswith("group,num_pairs,bias,rmse,max_error,")
    answer = run("score", folder / "result.nc", out, "--plot", folder / "drawn")
    assert answer.exit_code == 0, answer.output
    assert (folder / "drawn" / "aod_550_scatter.png").is_file()
    image = folder / "image.nc"
    with xr.open_dataset(folder / "result.nc", decode_times=False) as result:
        result.drop_vars(["pressure", "smoke_ssa", "smoke_aod_550"]).to_netcdf(image)
    answer = run("score", image, out)
    assert answer.exit_code == 2 and "has no smoke_aod_550; give the one that" in answer.stderr
    answer = run("retrieve", "smoke", image, "--out", folder / "x.nc")
    assert answer.exit_code == 2 and "has no pressure, smoke_ssa; simulate a " in answer.stderr
    assert "and without --variables" in answer.stderr


@pytest.mark.slow
def test_a_prior_from_a_file_and_diagnostics(folder, run):
    prior = folder / "prior.toml"
    prior.write_text("[aod_550]\nmean = 0.5\nsigma = 0.4\n")
    out = folder / "smoke.nc"
    how = ("--noise", "--prior", prior, "--diagnostics")
    answer = run("retrieve", "smoke", folder / "result.nc", "--out", out, *how)
    assert answer.exit_code == 0, answer.output
    with xr.open_dataset(out) as written:
        done = written.isel(time=0).stack(pixel=("y", "x"))
        assert (done["result_code"] == ResultCode.SUCCESS).sum() >= 10
        assert done["averaging_kernel"].dims == ("element", "element_2", "pixel")
        assert done["gain"].dims == ("element", "band", "pixel")
        kernel = done["averaging_kernel"].values[0, 0]
        # One is of the last step's Jacobian, the other of the solution's.
        np.testing.assert_allclose(kernel, done["degrees_of_freedom"], rtol=1e-2)
        parts = np.hypot(done["aod_550_noise_error"], done["aod_550_smoothing_error"])
        np.testing.assert_allclose(parts, done["aod_550_sigma"], rtol=1e-2)
        assert (done["aod_550_error_due_to_albedo_C02"] > 0).all()
        assert (done["cost"] > 0).all() and (done["prior_cost"] > 0).all()
        assert written.attrs["prior"] == "normal distribution: aod_550 0.5 +/- 0.4"


@pytest.mark.slow
def test_an_image_is_retrieved_as_a_whole(folder, run):
    result, out = folder / "result.nc", folder / "smooth.nc"
    answer = run("retrieve", "smoke", result, "--out", out, "--noise", "--smooth", "1.5")
    assert answer.exit_code == 0, answer.output
    with xr.open_dataset(out) as written:
        assert written.attrs["smooth_length_in_pixels"] == 1.5
        assert written.attrs["prior"] == "normal distribution: aod_550 0.4, x +/- 1.5"
        assert np.isfinite(written["aod_550_sigma"]).all()
        assert (written["num_steps"] > 0).all()
    for options in (("--smooth", "0"), ("--smooth", "2", "--diagnostics")):
        answer = run("retrieve", "smoke", result, "--out", out, *options)
        assert answer.exit_code == 2 and "--smooth" in answer.stderr
    answer = run("retrieve", "fire", result, "--out", out, "--smooth", "2")
    assert answer.exit_code == 2 and "a fire is one pixel's" in answer.stderr


def test_intervals_are_a_table_of_their_own(tmp_path):
    """A row of scores for every quantity and share would count its pixels several times."""
    report = xr.Dataset(
        {
            "bias": ("group", [0.1, 0.2]),
            "code_count": ("code", [5]),
            "interval_held": (("quantity", "share"), [[0.6, 0.9], [0.7, 1.0]]),
        },
        {"group": ["all", "aod 0 to 1"], "code": ["success"], "share": [68, 95]},
    )
    commands._write_csv(report, tmp_path / "scores.csv")
    tables = (tmp_path / "scores.csv").read_text().split("\n\n")
    assert [len(table.strip().splitlines()) for table in tables] == [3, 2, 5]


def test_the_demonstration_ends_with_scores(folder, capsys):
    finish_demo(folder)
    with xr.open_dataset(folder / "retrieval.nc") as written:
        assert (written["result_code"] == ResultCode.SUCCESS).sum() >= 10
    assert (folder / "scores.csv").is_file()
    assert "inside EE" in capsys.readouterr().out


def test_readmes_code_retrieves(folder, monkeypatch):
    (folder / "abi-demo").mkdir()
    (folder / "result.nc").rename(folder / "abi-demo" / "result.nc")
    monkeypatch.chdir(folder)
    names = run_block(0)
    assert (names["found"]["result_code"] == ResultCode.SUCCESS).sum() >= 5


def test_trouble_is_one_sentence(folder, run):
    answer = run("retrieve", "smoke", folder / "none.nc", "--out", folder / "x.nc")
    assert answer.exit_code == 2 and "does not exist" in answer.stderr
    answer = run(
        "retrieve", "smoke", folder / "result.nc", "--out", folder / "x.nc", "--bands", "C01,C06"
    )
    assert answer.exit_code == 2 and "no band C06" in answer.stderr
    answer = run(
        "retrieve", "smoke", folder / "result.nc", "--out", folder / "x.nc", "--bands", "C99"
    )
    assert answer.exit_code == 2 and "C99" in answer.stderr
    answer = run("retrieve", "smoke", folder / "result.nc", "--out", folder / "x.nc", "--seed", "3")
    assert answer.exit_code == 2 and "--seed is of the noise that --noise adds" in answer.stderr
    answer = run("retrieve", "fog", folder / "result.nc", "--out", folder / "x.nc")
    assert answer.exit_code == 2 and "smoke, ash, dust, cloud" in answer.stderr
    answer = run("score", folder / "result.nc", folder / "result.nc")
    assert answer.exit_code == 2 and "no result_code" in answer.stderr
    assert not (folder / "x.nc").exists()
    with pytest.raises(InputError, match="does not exist"):
        finish_demo(folder / "nowhere")
