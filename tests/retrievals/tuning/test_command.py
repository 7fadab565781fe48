"""The command compares, fits where it is told to, and writes what it says."""

import numpy as np
import pytest
import typer
import xarray as xr
from typer.testing import CliRunner

from abi_operator.files.result import ResultWriter
from retrievals.tuning.command import tune


@pytest.fixture
def files(image, tmp_path):
    """A result, and a file of what was observed of it."""
    attributes = {"num_streams": 2, "gases": "none"}
    time = image["time"].values
    with ResultWriter(
        tmp_path / "result.nc", times=time, shape=(3, 8), attributes=attributes
    ) as writer:
        writer.write(0, slice(0, 3), image.drop_vars("time"))
    seen = xr.Dataset(
        {f"C0{k}": (("y", "x"), 0.9 * image["reflectance_factor"].values[k - 1]) for k in (1, 2)}
        | {name: image[name].variable for name in ("latitude", "longitude")}
    )
    seen.to_netcdf(tmp_path / "observed.nc")
    return tmp_path / "result.nc", tmp_path / "observed.nc"


@pytest.fixture
def run():
    app = typer.Typer()
    app.command("tune")(tune)
    return lambda *arguments: CliRunner().invoke(app, [str(a) for a in arguments])


def test_it_compares_and_writes_table_maps_and_picture(run, files, tmp_path):
    answer = run(*files, "--out", tmp_path / "found", "--plot")
    assert answer.exit_code == 0, answer.output
    assert "observed: C01, C02 of" in answer.output and "wrote" in answer.output
    assert (tmp_path / "found/tuning.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "found/tuning.csv").read_text().startswith("band,region,stage,count,")
    with xr.open_dataset(tmp_path / "found/tuning.nc") as found:
        assert list(found["stage"].values) == ["scene"]
        ratio = found["simulated"].sel(stage="scene") / found["observed"]
        np.testing.assert_allclose(ratio, 1 / 0.9, rtol=1e-6)
        assert found.attrs["history"].splitlines()[0].endswith("--plot")
        assert found["latitude"].dims == ("y", "x")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--fit", "colour"], "what is fitted is some of strength, ssa"),
        (["--fit", "ssa", "--where", "shade"], "those of 'plume' or 'clear'"),
        (["--fit", "ssa", "--forward-error", "2"], "below 1; got 2"),
        (["--where", "plume"], "--where is of a fit; say what to fit with --fit."),
        (["--calibration", "--prior", "p.toml"], "--calibration, --prior are of a fit"),
        (["--forward-error", "0"], "--forward-error is of a fit"),
        (["--bands", "C03"], "C03 is not in both scene and observation"),
        (["--time", "1"], "the result has 1 times"),
        (["--species", "ash"], "no plume of ash"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(run, files, tmp_path, arguments, sentence):
    answer = run(*files, "--out", tmp_path / "found", *arguments)
    assert answer.exit_code == 2 and sentence in " ".join(answer.stderr.split())
    assert not (tmp_path / "found").exists()


def test_without_matplotlib_it_says_so_first(run, files, tmp_path, monkeypatch):
    def missing(name):
        raise ModuleNotFoundError("none", name="matplotlib")

    monkeypatch.setattr("retrievals.tuning.command.import_module", missing)
    answer = run(*files, "--out", tmp_path / "found", "--plot")
    assert answer.exit_code == 2 and "--plot needs matplotlib; install it" in answer.stderr
