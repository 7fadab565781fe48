"""The paper's arguments on a scene."""

import importlib

import numpy as np
import pytest
import xarray as xr
from conventions import complaints
from PIL import Image
from typer.testing import CliRunner

from abi_operator import Fire, cli
from abi_operator.files import InputError
from abi_operator.files.stored import stored
from abi_operator.nomenclature import QUALITY_FLAGS
from abi_operator.products import derived_green
from abi_operator.sensitivity import albedo_figure, fires_by_hour, fires_figure, green_figure
from abi_operator.sensitivity.figure_fires import ALBEDOS, SHOWS, TEMPERATURES, _clear_place
from abi_operator.sensitivity.nir_study import brf_by_band
from abi_operator.sensitivity.panels import Bar, _end_texts, curves, scatter

FIRE = Fire(0.04, 800.0)
figure_fires = importlib.import_module("abi_operator.sensitivity.figure_fires")
figure_albedo = importlib.import_module("abi_operator.sensitivity.figure_albedo")


def kinds_of(image):
    """How many pixels are of which kind."""
    lines = [x.split() for x in green_figure(image).lines if "grasso2013" in x]
    return {" ".join(x[1:-3]): int(x[-1]) for x in lines}


def land_of(image):
    """Pixels (y, x) whose ground, simulated with 0.03 over water, is land."""
    return image["surface_albedo"].isel(band=0, drop=True) != np.float32(0.03)


def snowing(image, where):
    """The same with snow in the air of some pixels, and no more of cloud water."""
    path, depth = (xr.zeros_like(image[f"liquid_{x}"]) for x in ("mass_path", "optical_depth"))
    return image.assign(
        snow_mass_path=path + 0.1 * where,
        snow_number_path=path + 1e6 * where,
        snow_optical_depth=depth + 0.5 * where,
    )


@pytest.fixture
def grounds_drawn(monkeypatch):
    """A function from a result to the grounds of the figure of albedo, for which nothing is solved.

    By band and name, of land in the order of its pixels.
    """
    seen = []

    def contrasts(states, *_):
        seen.append(states.albedo)
        return np.ones((len(states.geometry.solar_zenith), 5))

    def drawn(image):
        seen.clear()
        figure = albedo_figure(image, FIRE)
        land = np.isfinite(figure.fields["fire_contrast_MODIS"])
        return land, dict(zip(("MODIS", "constant"), seen, strict=True))

    monkeypatch.setattr(figure_albedo, "_contrasts", contrasts)
    monkeypatch.setattr("abi_operator.scene.grounds.sea_albedo", lambda _, wind: 0.05 + 0 * wind)
    return drawn


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
    with xr.open_dataset(tmp_path / "out" / "green.nc") as maps:
        assert maps["green_derived"].attrs["grid_mapping"] == "crs" not in maps.coords
        assert maps["time"].values == image["time"].values
        assert maps["x"].values.tolist() == image["x"].values.tolist()
    assert complaints(tmp_path / "out" / "green.nc") == []
    with Image.open(tmp_path / "out" / "green.png") as picture:
        assert picture.width > 2 * 384
    outcome = CliRunner().invoke(cli.make_app(), ["figure", "grin", *words[2:]])
    assert outcome.exit_code == 2 and "choose from green, albedo, fires" in outcome.stderr


def test_kinds_of_pixels_are_all_of_them(image):
    kinds = kinds_of(image)
    assert list(kinds)[1:3] == ["clear water", "clear land"]
    assert kinds["all"] == sum(kinds.values()) / 2 == image.sizes["y"] * image.sizes["x"]


def test_water_is_told_in_sunlight_and_by_its_share(image):
    """In C07 each ground has its own emissivity, and a sea under wind its albedo by band."""
    kinds, albedo, land = kinds_of(image), image["surface_albedo"], land_of(image)
    shines = image.reindex(band=[*image["band"].values, "C07"], fill_value=0.02)
    assert kinds_of(shines) == kinds
    rough = albedo.where(land, albedo + xr.DataArray(0.01 * np.arange(5), dims="band"))
    share = xr.where(land, 0.0, 1.0)
    windy = image.assign(surface_albedo=rough, water_share=share, wind_speed=5 + 0 * share)
    assert kinds_of(windy) == kinds
    # Land of one albedo is land, where that is known, and so is a sea most of which is ice.
    assert kinds_of(windy.assign(surface_albedo=xr.full_like(albedo, 0.2))) == kinds
    frozen = kinds_of(windy.assign(water_share=0.3 * share))
    assert "clear water" not in frozen
    assert frozen["clear land"] == kinds["clear water"] + kinds["clear land"]


def test_land_that_may_be_water_is_not_called_either(image):
    """By a second albedo that is one in all bands, or where the result says that it was filled."""
    kinds, land = kinds_of(image), land_of(image)
    filled = image.assign_attrs(last_resort_albedo_count=1)
    grey = image.assign(surface_albedo=image["surface_albedo"].where(~land, 0.2))
    for some, moved in ((filled, 0), (grey, kinds["clear land"])):
        found = kinds_of(some)
        assert "clear water" not in found and "plume over water" not in found
        assert found["clear water or land"] == kinds["clear water"] + moved
        assert any("it may be water or land" in line for line in green_figure(some).lines)
    assert not any("it may be" in line for line in green_figure(image).lines)


def test_snow_in_the_air_is_cloud(image, grounds_drawn):
    kinds = kinds_of(image)
    clear = (image["liquid_optical_depth"].sel(band="C03") < 0.01) & land_of(image)
    clear &= image["ash_brightness"] == 0
    some = snowing(image, clear)
    found = kinds_of(some)
    assert "clear land" not in found and found["cloud"] == kinds["cloud"] + kinds["clear land"]
    land, _ = grounds_drawn(image)
    assert kinds_of(stored(some, ("image",))) == found
    without, _ = grounds_drawn(some)
    assert (without == land & ~clear.values).all()
    place = _clear_place(image)
    other = _clear_place(snowing(image, xr.DataArray(place, dims=("y", "x"))))
    assert place.sum() == other.sum() == 1 and not (place & other).any()


def test_constant_albedo_is_the_mean_of_what_land_reflects(image, grounds_drawn):
    """Over land alone, and to all sides, also where land reflects by kernels and water by wind."""
    land, plain = grounds_drawn(image)
    albedo, share = image["surface_albedo"], xr.where(land_of(image), 0.0, 1.0)
    kernels = {
        f"{name}_kernel_weight": (0.2 * albedo).where(share == 0, 0.0)
        for name in ("volume", "geometric")
    }
    by_band = xr.DataArray(0.01 * np.arange(5), dims="band")
    sea = {"water_share": share, "wind_speed": 5 + 0 * share}
    rough = image.assign(surface_albedo=albedo + by_band * share, **kernels, **sea)
    same, uneven = grounds_drawn(rough)
    assert (same == land).all()
    for band, mean in plain["constant"].items():
        own = albedo.sel(band=band).values[land].astype(np.float64)
        np.testing.assert_allclose(mean, own.mean(), rtol=1e-12)
        np.testing.assert_allclose(uneven["constant"][band], mean, rtol=1e-12)
        assert uneven["MODIS"][band].land.f_vol.max() > 0.01
    grey = image.assign(surface_albedo=xr.full_like(albedo, 0.2))
    with pytest.raises(InputError, match="whose albedo differs between bands"):
        grounds_drawn(grey)


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


@pytest.fixture
def times_asked(monkeypatch):
    """Times at which the sun is looked for, of a pixel of an image at a longitude and a time."""

    def asked(image, longitude, time):
        times, find = [], figure_fires.find_angles

        def noted(when, *where):
            times.append(when)
            return find(when, *where)

        place = np.zeros((image.sizes["y"], image.sizes["x"]), bool)
        place[0, 0] = True
        zeros = 0 * image["longitude"]
        some = image.assign(latitude=zeros, longitude=zeros + longitude, time=np.datetime64(time))
        with monkeypatch.context() as patch:
            patch.setattr(figure_fires, "find_angles", noted)
            return times, *figure_fires._sun(some, place)

    return asked


@pytest.mark.parametrize("longitude, first", [(-155.0, 16.0), (-100.0, 12.0), (170.0, 18.0)])
def test_hours_are_times_of_day(image, times_asked, longitude, first):
    """Also where the place's day holds a midnight of UTC."""
    _, hours, zenith, _ = times_asked(image, longitude, "2007-03-20T18:00")
    assert ((hours >= 0) & (hours < 24)).all() and first <= hours[0] <= first + 1.5
    np.testing.assert_allclose(np.diff(np.unwrap(hours, period=24.0)), 0.5)
    assert len(hours) > 20 and abs(np.argmin(zenith) - len(hours) / 2) <= 1


def test_the_day_is_that_of_the_place(image, times_asked):
    """In the evening of the day before that of UTC."""
    times, *_ = times_asked(image, -120.0, "2007-03-20T02:00")
    assert min(times) == np.datetime64("2007-03-19T08:00")
    assert max(times) == np.datetime64("2007-03-20T07:30")


def test_an_axis_of_hours_begins_again():
    assert _end_texts(Bar(10.5, 28.5, ""), "", 24.0) == ("10.5", "19.5", "4.5 ")
    assert _end_texts(Bar(-0.5, 28.5, "K"), "+", None) == ("-0.5", "14", "+28.5 K")


def test_fires_that_all_show_are_not_said_to_show_from_the_coolest_on(monkeypatch):
    contrast = np.ones((2, len(ALBEDOS), len(TEMPERATURES)))
    contrast[1] = SHOWS * TEMPERATURES / 500
    contrast[1, -1] = 0.01
    found = figure_fires.ByHour(np.array([18.0, 18.5]), np.array([30.0, 40.0]), contrast)
    assert (found.lowest[0] == -np.inf).all() and np.isnan(found.lowest[1, -1])
    np.testing.assert_allclose(found.lowest[1, :-1], 500)
    monkeypatch.setattr(figure_fires, "fires_by_hour", lambda *_: found)
    lines = fires_figure(xr.Dataset(), FIRE).lines
    assert lines[2].split()[2:] == 5 * ["<400"]
    assert lines[3].split()[2:] == [*4 * ["500"], "nan"]


def test_what_a_figure_lacks_is_told(image):
    some = image.sel(band=["C01", "C02", "C03"])
    with pytest.raises(InputError, match="no band green; simulate it"):
        green_figure(some)
    with pytest.raises(InputError, match="of C06 at a time, which the result lacks"):
        fires_figure(some, FIRE)
    with pytest.raises(InputError, match="lacks C06"):
        albedo_figure(some, FIRE)


@pytest.mark.parametrize("figure", [green_figure, albedo_figure, fires_figure])
def test_no_figure_is_of_the_night_or_of_half_a_result(image, figure):
    how = () if figure is green_figure else (FIRE,)
    night = image.assign(quality_flag=image["quality_flag"] | QUALITY_FLAGS["night"])
    with pytest.raises(InputError, match="the sun shines on none of those chosen"):
        figure(night, *how)
    half = stored(image, ("image",)) if how else image.drop_vars("surface_albedo")
    missing = "pressure, height, liquid_mass_path" if how else "surface_albedo; keep"
    with pytest.raises(InputError, match=f"the result has no {missing}"):
        figure(half, *how)
    with pytest.raises(InputError, match="one time at a time"):
        figure(image.expand_dims("time"), *how)
