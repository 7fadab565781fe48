"""The paper's arguments on a scene."""

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from abi_operator import Fire, cli
from abi_operator.files import InputError
from abi_operator.products import derived_green
from abi_operator.sensitivity import albedo_figure, fires_by_hour, fires_figure, green_figure
from abi_operator.sensitivity.figure_fires import ALBEDOS, SHOWS, TEMPERATURES
from abi_operator.sensitivity.nir_study import brf_by_band
from abi_operator.sensitivity.panels import curves, scatter

FIRE = Fire(0.04, 800.0)


def test_the_command_draws_green(result_file, image, tmp_path, monkeypatch):
    monkeypatch.setattr(cli, "entry_points", lambda **_: ())
    words = ["figure", "green", str(result_file), "--out", str(tmp_path / "out")]
    outcome = CliRunner().invoke(cli.make_app(), words)
    assert outcome.exit_code == 0, outcome.output
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["green.nc", "green.png"]
    brf = brf_by_band(image)
    off = derived_green(brf["C02"], brf["C01"], brf["C03"]) - brf["green"]
    line = f"grasso2013                            all {off.mean():+10.4f} {off.std():10.4f}"
    assert line in outcome.output
    # The air makes up for most of what the recipe lacks of the grounds' own green.
    assert abs(off.mean()) < 0.02
    with Image.open(tmp_path / "out" / "green.png") as picture:
        assert picture.width > 2 * 384
    outcome = CliRunner().invoke(cli.make_app(), ["figure", "grin", *words[2:]])
    assert outcome.exit_code == 2 and "choose from green, albedo, fires" in outcome.stderr


def test_kinds_of_pixels_are_all_of_them(image):
    lines = [x.split() for x in green_figure(image).lines if "grasso2013" in x]
    counts = [int(x[-1]) for x in lines]
    assert counts[0] == sum(counts[1:]) == image.sizes["y"] * image.sizes["x"]


def test_panels_of_lines_and_of_pairs():
    x = np.linspace(0, 1, 20)
    drawn = curves("t", x, {"a": x, "b": np.full(20, np.nan)}, 0, 1, "y").picture
    assert drawn.shape == (384, 384, 3) and (drawn < 0.9).any()
    pairs = scatter("t", x, x, 1.0, "y").picture
    # South is below: equal values are dark from the lower left to the upper right.
    assert pairs[-8:, :8].mean() < 0.9 and pairs[:8, -8:].mean() < 0.9
    assert pairs[60:90, 10:40].mean() == 1


@pytest.mark.slow
def test_a_constant_albedo_hides_what_the_ground_does(image):
    figure = albedo_figure(image, FIRE)
    fields, inside = figure.fields, image["ash_brightness"].values > 0
    land = np.isfinite(fields["fire_contrast_MODIS"])
    clear = land & ~inside
    spread = {
        name: np.std(np.log(fields[f"fire_contrast_{name}"][clear]))
        for name in ("MODIS", "constant")
    }
    # The sun and the satellite move by a degree or two over the scene, and nothing else.
    assert spread["constant"] < 0.05 < 0.2 < spread["MODIS"]
    for name in spread:
        # To rounding: columns are solved in company.
        assert np.abs(fields[f"plume_contrast_C02_{name}"][clear]).max() < 1e-12
        assert (fields[f"plume_contrast_C02_{name}"][land & inside] != 0).all()
    with pytest.raises(InputError, match="lacks C06"):
        albedo_figure(image.sel(band=["C01", "C02", "C03"]), FIRE)


@pytest.mark.slow
def test_fires_show_over_dark_grounds_and_by_a_low_sun(image):
    found = fires_by_hour(image, FIRE)
    assert (np.diff(found.contrast, axis=1) < 0).all()  # a brighter ground
    assert (np.diff(found.contrast, axis=2) > 0).all()  # a hotter fire
    noon = int(np.argmin(found.solar_zenith))
    # The demonstration's scene is at 18 UTC, and the sun highest an hour and a half later.
    assert 19 <= found.hours[noon] <= 20
    lowest = found.lowest
    assert (np.diff(lowest, axis=1) > 0).all()
    assert (np.diff(lowest[: noon + 1], axis=0) > 0).all()
    at = np.interp(lowest[noon, 2], TEMPERATURES, np.log(found.contrast[noon, 2]))
    assert abs(at - np.log(SHOWS)) < 1e-9
    lines = fires_figure(image, FIRE).lines
    assert len(lines) == 2 + len(found.hours) and len(lines[-1].split()) == 2 + len(ALBEDOS)


def test_what_a_figure_lacks_is_told(image):
    some = image.sel(band=["C01", "C02", "C03"])
    with pytest.raises(InputError, match="no band green; simulate it"):
        green_figure(some)
    with pytest.raises(InputError, match="of C06 at a time, which the result lacks"):
        fires_figure(some, FIRE)
    with pytest.raises(InputError, match="lacks C06"):
        albedo_figure(some, FIRE)
