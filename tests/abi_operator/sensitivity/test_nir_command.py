"""The command that tests the near infrared."""

import numpy as np
import pytest
import xarray as xr
from conventions import complaints
from PIL import Image
from typer.testing import CliRunner

from abi_operator import cli


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
