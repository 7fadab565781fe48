"""The command, with an experiment that costs nothing."""

import pytest
import typer
import xarray as xr
from typer.testing import CliRunner

from retrievals.experiments import EXPERIMENTS, Experiment, command


def counted(*, size: int = 5, seed: int = 0) -> xr.Dataset:
    """How many pixels
    are there?

    The rest of the story.
    """
    return xr.Dataset({"pixels": ("case", [size**2])}, {"case": [f"{seed}"]}, {"rows": "case"})


def drawn(table, figure):
    figure.subplots().plot(table["pixels"], "o")


@pytest.fixture
def run(monkeypatch):
    monkeypatch.setattr(command, "EXPERIMENTS", {"count": Experiment(counted, drawn)})
    app = typer.Typer()
    app.command("experiment")(command.experiment)
    return lambda *arguments: CliRunner().invoke(app, [str(a) for a in arguments])


def test_without_a_name_all_are_listed(run):
    assert run().output == "count: How many pixels are there?\n"
    for experiment in EXPERIMENTS.values():
        assert experiment.sentence.endswith("?") and "\n" not in experiment.sentence


def test_it_prints_a_table_and_writes_it_with_a_picture(run, tmp_path):
    answer = run("count")
    assert answer.exit_code == 0, answer.output
    assert [line.split() for line in answer.output.splitlines()] == [
        ["case", "pixels"],
        ["0", "25"],
    ]
    folder = tmp_path / "new"
    answer = run("count", "--output", folder, "--size", 6, "--seed", 4)
    assert answer.exit_code == 0, answer.output
    assert f"wrote {folder / 'count.png'}" in answer.output
    assert (folder / "count.png").read_bytes().startswith(b"\x89PNG")
    with xr.open_dataset(folder / "count.nc") as written:
        assert written["pixels"].item() == 36
        assert written.attrs["title"] == "How many pixels are there?"
        assert written.attrs["source"].endswith(f"count --output {folder} --size 6 --seed 4")


def test_without_matplotlib_it_says_so_before_it_starts(run, tmp_path, monkeypatch):
    def missing(name):
        raise ModuleNotFoundError("none", name="matplotlib")

    monkeypatch.setattr(command, "import_module", missing)
    answer = run("count", "--output", tmp_path)
    assert answer.exit_code == 2 and "--output needs matplotlib; install it" in answer.stderr
    assert "25" not in answer.output


def test_an_unknown_name_is_refused(run):
    answer = run("nothing")
    assert answer.exit_code == 2 and "choose from count" in answer.stderr
