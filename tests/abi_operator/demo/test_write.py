"""The demonstration's files, read back by the readers that a user's files go through."""

import hashlib

import netCDF4
import numpy as np
import pytest
from PIL import Image

from abi_operator.constants import DRY_AIR_GAS_CONSTANT, GRAVITY, VAPOUR_GAS_CONSTANT
from abi_operator.demo import write_demo
from abi_operator.files import read_mcd43a1, read_plume, read_wrf, wrf_coordinates

BANDS = ("C01", "C02", "C03", "C06")
SIZE = 48


@pytest.fixture(scope="module", params=[0, 1])
def inputs(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo") / "inputs"
    return write_demo(folder, size=SIZE, seed=request.param)


@pytest.fixture(scope="module")
def model(inputs):
    return read_wrf(inputs.wrf, 0)


@pytest.fixture(scope="module")
def albedo(inputs):
    return read_mcd43a1(inputs.albedo, BANDS)


def density(model):
    """Air with its vapour and cloud water. [kg m-3]"""
    vapour = model["vapour_mixing_ratio"]
    moist = 1 + vapour * VAPOUR_GAS_CONSTANT / DRY_AIR_GAS_CONSTANT
    dry = model["layer_pressure"] / (DRY_AIR_GAS_CONSTANT * model["layer_temperature"] * moist)
    return dry * (1 + vapour + model["cloud_mixing_ratio"])


def liquid_path(model):
    """Cloud water of each column. [kg m-2]"""
    dry = density(model) / (1 + model["vapour_mixing_ratio"] + model["cloud_mixing_ratio"])
    thickness = -np.diff(model["height"], axis=0)
    return (dry * model["cloud_mixing_ratio"] * thickness).sum("layer").values


def test_time_and_place_are_those_of_the_santa_ana_fires(inputs):
    coordinates = wrf_coordinates(inputs.wrf)
    assert inputs.wrf.name == "wrfout_d01_2007-10-23_18-00-00.nc"
    assert list(coordinates["time"].values) == [np.datetime64("2007-10-23T18:00")]
    assert coordinates.attrs["microphysics_scheme"] == "morrison"
    assert coordinates.attrs["bottom_top_levels_of_run"] == 27
    assert float(coordinates["latitude"].mean()) == pytest.approx(33.5, abs=0.02)
    assert float(coordinates["longitude"].mean()) == pytest.approx(-117.5, abs=0.02)


def test_the_domain_is_as_large_at_any_size(inputs, tmp_path):
    for size in (8, SIZE):
        path = inputs.wrf if size == SIZE else write_demo(tmp_path, size=size).wrf
        with netCDF4.Dataset(path) as file:
            assert file.DX * size == pytest.approx(256e3)
            step = np.radians(float(file["XLAT"][0, 1, 0] - file["XLAT"][0, 0, 0]))
        # Mercator is true at 33.5 N, and larger by 2 % at the southern edge than there.
        assert step * 6.37e6 * size == pytest.approx(256e3, rel=0.02)


def test_air_reaches_from_the_ground_to_50_hpa(model):
    assert model.sizes["layer"] == 27
    assert (np.diff(model["layer_pressure"], axis=0) > 0).all()
    assert 50e2 < model["layer_pressure"][0].max() < 80e2
    assert 195 < model["layer_temperature"].min() < model["layer_temperature"].max() < 310


def test_air_is_hydrostatic(model):
    weight = GRAVITY * density(model).values * -np.diff(model["height"], axis=0)
    surface_pressure = weight.sum(axis=0) + 50e2
    # The file is float32: heights are good to 2e-3 m and the lowest layers are 60 m thick.
    np.testing.assert_allclose(surface_pressure, model["surface_pressure"], rtol=1e-5)


def test_land_rises_from_the_sea(inputs, model):
    sea = model["land_mask"].values == 0
    ground = model["height"].values[-1]
    assert 0.35 < sea.mean() < 0.55
    assert sea[: SIZE // 4, : SIZE // 4].mean() > 0.8
    assert not sea[-SIZE // 4 :, -SIZE // 4 :].any()
    np.testing.assert_array_equal(ground[sea], 0)
    assert (ground[~sea] > 0).all()
    assert 1200 < ground.max() < 1600
    with netCDF4.Dataset(inputs.wrf) as file:
        np.testing.assert_allclose(ground, file["HGT"][0], atol=1e-3)


def test_clouds_are_low_over_the_sea_and_cover_a_fifth(model):
    path = liquid_path(model)
    cloudy = path > 0
    sea = model["land_mask"].values == 0
    assert 0.15 < cloudy.mean() < 0.25
    assert cloudy[sea].sum() > 5 * cloudy[~sea].sum() > 0
    height = (model["height"].values[1:] + model["height"].values[:-1]) / 2
    deck = height[(model["cloud_mixing_ratio"].values > 0) & sea]
    assert 250 < deck.min() < deck.max() < 1000
    optical_depth = 1.5 * path[cloudy] / (1000 * 10e-6)  # droplets of 10 um
    assert 5 < np.median(optical_depth) < 15
    assert np.quantile(optical_depth, 0.95) < 30


def test_clouds_are_saturated_and_no_air_is_supersaturated(model):
    celsius = model["layer_temperature"] - 273.15
    vapour_pressure = 611.2 * np.exp(17.67 * celsius / (celsius + 243.5))
    ratio = DRY_AIR_GAS_CONSTANT / VAPOUR_GAS_CONSTANT
    saturated = ratio * vapour_pressure / (model["layer_pressure"] - vapour_pressure)
    humidity = (model["vapour_mixing_ratio"] / saturated).values
    cloudy = model["cloud_mixing_ratio"].values > 0
    np.testing.assert_allclose(humidity[cloudy], 1, rtol=1e-4)  # float32, steep in temperature
    assert humidity[~cloudy].max() < 0.97


def test_albedo_covers_the_scene_and_brackets_the_date(model, albedo):
    assert albedo["lat"].min() < model["latitude"].min() < model["latitude"].max()
    assert model["latitude"].max() < albedo["lat"].max()
    assert albedo["lon"].min() < model["longitude"].min() < model["longitude"].max()
    assert model["longitude"].max() < albedo["lon"].max()
    assert albedo["time"].min() < np.datetime64("2007-10-23") < albedo["time"].max()
    assert -albedo["lat"].diff("lat").mean() < model["latitude"][:, 0].diff("y").mean()


def test_albedo_is_known_on_land_and_missing_at_sea(model, albedo):
    latitude, longitude = model["latitude"].variable, model["longitude"].variable
    nearest = albedo.sel(lat=latitude, lon=longitude, method="nearest")
    values = nearest["surface_albedo"].values  # band, time, y, x
    sea = model["land_mask"].values == 0
    assert np.isfinite(values[..., ~sea]).all()
    assert np.isnan(values[..., : SIZE // 8, : SIZE // 8]).all()
    missing = np.isnan(albedo["surface_albedo"])
    assert 0.3 < missing.mean() < 0.5
    np.testing.assert_array_equal(albedo["albedo_quality"] == 255, missing)
    assert set(np.unique(albedo["albedo_quality"])) == {0, 1, 255}
    assert albedo["surface_albedo"].attrs["num_outside_unit_interval"] == 0


def test_albedo_is_green_at_the_coast_and_brown_inland(albedo):
    blue, red, near_infrared, shortwave_infrared = albedo["surface_albedo"][:, 1].values
    land = np.isfinite(red)
    for band, low, high in (
        (blue, 0.02, 0.25),
        (red, 0.03, 0.45),
        (near_infrared, 0.1, 0.6),
        (shortwave_infrared, 0.05, 0.6),
    ):
        assert low < band[land].min() < band[land].max() < high
    ndvi = (near_infrared - red) / (near_infrared + red)
    assert np.quantile(ndvi[land], 0.9) > 0.45
    assert np.quantile(ndvi[land], 0.1) < 0.25
    north_east = red[: len(red) // 4, -red.shape[1] // 4 :]
    assert np.nanmean(north_east) > 1.2 * np.nanmean(red)


def test_smoke_blows_from_the_land_over_the_sea(inputs, model):
    brightness = read_plume(inputs.plume, (SIZE, SIZE))
    smoky = brightness > 0
    sea = model["land_mask"].values == 0
    assert 0.2 < smoky.mean() < 0.3
    assert brightness.max() == 1
    assert (brightness == 1).mean() < 0.01
    assert 0.1 < np.median(brightness[smoky]) < 0.6
    assert smoky[sea].mean() > 0.3
    assert smoky[~sea].any()
    assert not smoky[-SIZE // 4 :, -SIZE // 4 :].any()  # upwind, in the north-east
    with Image.open(inputs.plume) as image:
        assert image.mode == "L"


def test_files_depend_on_the_seed_alone(tmp_path):
    def digests(name, seed):
        inputs = write_demo(tmp_path / name, size=8, seed=seed)
        values = [read_wrf(inputs.wrf, 0), read_mcd43a1(inputs.albedo, BANDS).fillna(-1)]
        arrays = [v.values for dataset in values for v in dataset.data_vars.values()]
        arrays.append(read_plume(inputs.plume, (8, 8)))
        return [hashlib.sha256(np.ascontiguousarray(a).tobytes()).hexdigest() for a in arrays]

    first = digests("a", 3)
    assert digests("b", 3) == first
    assert digests("c", 4) != first


def test_a_tiny_size_is_refused(tmp_path):
    with pytest.raises(ValueError, match="got size=4"):
        write_demo(tmp_path, size=4)
