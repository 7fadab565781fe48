"""The command line, on the demonstration's files."""

import shutil
from importlib.metadata import EntryPoint

import netCDF4
import numpy as np
import pytest
import xarray as xr
from conventions import complaints
from demonstration import SIZE
from PIL import Image
from typer.testing import CliRunner

from abi_operator import cli, scene, simulation
from abi_operator.files import read_result
from abi_operator.machine.speed import usable_cores
from abi_operator.nomenclature import QUALITY_FLAGS


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """The demonstration's folder, and what the command says of it, with no other package's step."""
    out = tmp_path_factory.mktemp("demo") / "made" / "demo"
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(cli, "entry_points", lambda group, name=None: [])
        outcome = CliRunner().invoke(
            cli.make_app(), ["demo", "--size", str(SIZE), "--out", str(out)]
        )
    return out, outcome


def test_demo_writes_inputs_result_and_picture(demo):
    out, outcome = demo
    assert outcome.exit_code == 0, outcome.output
    picture = "natural_color_2007-10-23T180000.png"
    assert sorted(path.name for path in out.iterdir()) == ["inputs", picture, "result.nc"]
    assert f"wrote {out / 'result.nc'}" in outcome.output
    assert "64 pixels; flagged: none" in outcome.output
    assert f"computed on {usable_cores()} core" in outcome.output
    with read_result(out / "result.nc") as result:
        assert result.sizes["time"] == 1 and result.sizes["band"] == 4
        assert result["brf"].dtype == np.float32 and np.isfinite(result["brf"]).all()
        assert result["reflectance_factor"].dtype == np.float64
        assert f"abi-operator demo --size {SIZE} --out {out} (abi_operator" in result.history
        np.testing.assert_allclose(np.diff(result["x"]), 32e3, rtol=1e-4)
        assert result["smoke_aod_550"].max() <= 2.0
        assert result.attrs["wrf_file"].startswith("wrfout_")
        assert "US Standard Atmosphere 1976" in result.attrs["air_above_model"]
    assert "plume of smoke: 16 of 64 columns, optical depth at 550 nm up to 2, 1 to 3 km" in (
        outcome.output
    )
    with Image.open(out / picture) as image:
        assert image.size == (512, 512)


def test_droplet_numbers_and_optics_can_be_chosen(invoke, tmp_path, inputs):
    options = ["--ocean-albedo", 0.03, "--bands", "C01,C06", "--num-streams", 2]
    options += ["--albedo", inputs.albedo, "--gases", "none", "--droplet-number"]
    depths = []
    paper = "--cloud-optics", "mitchell", "--flat-sun"
    for number, kind in (("250", ()), ("250,500", paper)):
        out = tmp_path / number
        outcome = invoke("simulate", inputs.wrf, *options, number, *kind, "--out", out)
        assert outcome.exit_code == 0, outcome.output
        with read_result(out / "result.nc") as result:
            depths.append(result["liquid_optical_depth"].sel(band="C01").values)
            assert result.attrs["cloud_optics"] == (kind or ("", "mie"))[1]
            assert result.attrs["sun_path"] == ("flat" if kind else "spherical")
            assert (
                scene.column_states(result.isel(time=0), ("C01", "C06")).atmosphere.liquid.optics
                == (result.attrs["cloud_optics"])
            )
    assert "optics of cloud droplets: modified anomalous diffraction" in outcome.output
    said = "250 cm-3 over water, 500 cm-3 over land (as asked for)"
    assert f"droplet number, assumed: {said}" in outcome.output
    thick = depths[0] > 1
    ratio = depths[1][thick] / depths[0][thick]
    # Efficiencies of the two optics differ by up to 3 %.
    assert np.all((abs(ratio - 1) < 0.03) | (abs(ratio - 2 ** (1 / 3)) < 0.06))
    outcome = invoke("simulate", inputs.wrf, *options, "1e8", "--out", tmp_path / "no")
    assert outcome.exit_code == 2 and "at most 10000 cm-3" in outcome.stderr


def test_a_result_is_all_that_the_operator_needs(demo):
    """A result that is read back and simulated again is the same result."""
    out, _ = demo
    with read_result(out / "result.nc") as result:
        stored = result.isel(time=0).load()
    streams = int(stored.attrs["num_streams"])
    again = scene.simulate(stored, num_streams=streams, error_budget=None)
    for name in ("reflectance_factor", "smoke_aod_550"):
        np.testing.assert_array_equal(again[name], stored[name])
    for name in ("brf", "smoke_optical_depth"):  # which the file has in single precision
        np.testing.assert_array_equal(again[name].astype(np.float32), stored[name])


def test_a_result_follows_the_conventions(demo):
    out, _ = demo
    assert complaints(out / "result.nc") == []
    with xr.open_dataset(out / "result.nc") as plain:  # as a user of xarray has it
        brf = plain["brf"].sel(band="C02")
        assert set(brf.coords) == {
            *("time", "band", "band_wavelength", "latitude", "longitude", "x", "y")
        }
        assert plain["crs"].attrs["grid_mapping_name"] == "mercator"


@pytest.mark.parametrize("correction", [True, False])
def test_images_and_names_are_smaller(invoke, tmp_path, inputs, correction):
    """And pictures need none of what is left out."""
    sizes = {}
    for variables in ("all", "image", "radiance,smoke_aod_550"):
        out = tmp_path / variables
        options = ["--albedo", inputs.albedo, "--ocean-albedo", 0.03, "--plume", inputs.plume]
        options += ["--gases", "none", "--variables", variables, "--out", out]
        options += ["--error-budget", 0, "--num-streams", 8]  # the demonstration's program
        options += [] if correction else ["--no-rayleigh-correction"]
        outcome = invoke("simulate", inputs.wrf, *options)
        assert outcome.exit_code == 0, outcome.output
        (picture,) = out.glob("*.png")
        sizes[variables] = (out / "result.nc").stat().st_size
        with read_result(out / "result.nc") as result:
            assert ("pressure" in result) == (variables == "all")
            assert result["radiance"].dtype == np.float32
            assert ("--no-rayleigh-correction" in result.history) != correction
            assert f"--variables {variables}" in result.history
        with Image.open(picture) as image:
            blue = np.asarray(image)[..., 2].mean()
            assert (blue > 110) != correction
    assert sizes["radiance,smoke_aod_550"] < sizes["image"] < sizes["all"]


def test_simulate_does_what_demo_does(invoke, tmp_path, inputs, demo):
    paths = {"--albedo": inputs.albedo, "--plume": inputs.plume, "--out": tmp_path / "out"}
    options = [word for option, path in paths.items() for word in (option, path)]
    options += ["--ocean-albedo", 0.03, "--gases", "none", "--error-budget", 0]
    options += ["--num-streams", 8]
    outcome = invoke("simulate", inputs.wrf, *options)
    assert outcome.exit_code == 0, outcome.output
    with read_result(tmp_path / "out" / "result.nc") as ours:
        with read_result(demo[0] / "result.nc") as theirs:
            np.testing.assert_array_equal(ours["brf"], theirs["brf"])


@pytest.mark.slow
def test_the_demonstration_can_be_of_ash(invoke, tmp_path):
    """With light of 0.555 um, and without a retrieval of smoke."""

    class Entry(EntryPoint):
        def load(self):
            raise AssertionError("smoke is retrieved of ash")

    entry = Entry("demo", "retrievals.commands:finish_demo", "abi_operator.commands")
    outcome = invoke("demo", "--plume", "ash", "--size", SIZE, "--out", tmp_path, entries=[entry])
    assert outcome.exit_code == 0 and outcome.stderr == "", outcome.output
    assert "plume of ash: 16 of 64 columns, optical depth at 550 nm up to 2, 8 to 11 km" in (
        outcome.output
    )
    with read_result(tmp_path / "result.nc") as result:
        assert result["band"].values.tolist() == ["C01", "C02", "C03", "C06", "green"]
        assert "smoke_brightness" not in result and result["ash_aod_550"].max() <= 2.0


def test_ash_and_bands_can_be_asked_for(invoke, tmp_path, inputs):
    options = ["--plume", inputs.plume, "--plume-species", "ash", "--plume-aod", 0.5]
    options += ["--bands", "C01, C06", "--num-streams", 2, "--satellite-longitude", -137]
    out = tmp_path / "out"
    outcome = invoke("simulate", inputs.wrf, "--ocean-albedo", 0.03, *options, "--out", out)
    assert outcome.exit_code == 0, outcome.output
    pictures = ["C01_2007-10-23T180000.png", "C06_2007-10-23T180000.png"]
    assert sorted(path.name for path in out.iterdir()) == [*pictures, "result.nc"]
    assert "plume of ash: 16 of 64 columns, optical depth at 550 nm up to 0.5, " in outcome.output
    with Image.open(out / pictures[0]) as image:  # land has no albedo here, and is transparent
        assert 0 < (np.asarray(image)[..., 3] == 0).mean() < 1
    assert "flagged: no_albedo" in outcome.output
    with read_result(out / "result.nc") as result:
        assert result["band"].values.tolist() == ["C01", "C06"]
        assert float(result["ash_aod_550"].max()) == pytest.approx(0.5, rel=0.01)
        assert result.attrs["satellite_longitude"] == -137.0
        land = (result["quality_flag"].values & QUALITY_FLAGS["no_albedo"]) > 0
        assert (np.isnan(result["brf"].values).all(axis=1) == land).all()


def test_blocks_of_rows_make_one_file_and_one_picture(invoke, tmp_path, inputs, monkeypatch):
    # Under a budget a column depends, within it, on which others it is solved with.
    options = ["--ocean-albedo", 0.03, "--bands", "C04", "--num-streams", 2, "--gases", "none"]
    options += ["--error-budget", 0]
    for name, block_columns in (("whole", 64), ("blocks", 24)):
        monkeypatch.setattr(simulation, "_BLOCK_COLUMNS", block_columns)
        outcome = invoke("simulate", inputs.wrf, *options, "--out", tmp_path / name)
        assert outcome.exit_code == 0, outcome.output
    picture = "C04_2007-10-23T180000.png"
    assert len({(tmp_path / name / picture).read_bytes() for name in ("whole", "blocks")}) == 1
    with read_result(tmp_path / "whole" / "result.nc") as whole:
        with read_result(tmp_path / "blocks" / "result.nc") as blocks:
            xr.testing.assert_equal(whole, blocks)


def test_variables_that_the_scene_does_not_have_leave_nothing_behind(invoke, tmp_path, inputs):
    options = ["--ocean-albedo", 0.03, "--bands", "C04", "--num-streams", 2, "--gases", "none"]
    options += ["--error-budget", 0, "--variables", "brf,vapour"]
    options += ["--out", tmp_path / "out"]
    outcome = invoke("simulate", inputs.wrf, *options)
    assert outcome.exit_code == 2
    assert "the result has no vapour; choose of brf, " in outcome.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["inputs"]


@pytest.mark.slow
def test_gases_ice_fires_and_the_heat_of_the_ground(invoke, tmp_path, inputs):
    """Of another satellite, with cloud ice in a corner and the emissivity of a surface type."""
    with netCDF4.Dataset(inputs.wrf, "a") as file:
        file["QICE"][0, 20, :3, :3] = 1e-5
        file["QRAIN"][0, 2, 5:, 5:] = 1e-4
        file["QSNOW"][0, 2, 0, :2] = -1e-9, -2e-9
    options = ["--albedo", inputs.albedo, "--ocean-wind", "model", "--num-streams", 2]
    options += [
        "--land-kernels",
        "--bands",
        "C04,C07",
        "--emissivity",
        "open shrubland",
        "--satellite",
        "GOES-18",
    ]
    options += ["--hydrometeors", "ice", "--microphysics", "wsm6", "--time", 0]
    options += ["--fires", inputs.fires]
    out = tmp_path / "out"
    outcome = invoke("simulate", inputs.wrf, *options, "--out", out)
    assert outcome.exit_code == 0, outcome.output
    assert "warning: rain of the model is not simulated" in outcome.stderr
    for line in (
        "gases that absorb: O3 H2O CO2 CH4 N2O O2 N2",
        "number of ice, assumed: as the microphysics wsm6 does",
        "emissivity of the ground in C07: 0.89 (open shrubland) over land, 0.978 over water",
        "temperature of the ground: the model's",
        "not simulated (rain)",
        "land that reflects by kernels: ",
        "water that glints: ",
        "fires: 15 in ",
        " share a column with others",
        "snow mixing ratio below 0, taken as 0: in 2 cells, down to -2e-09 kg kg-1",
    ):
        assert line in outcome.output
    pictures = ["C04_2007-10-23T180000.png", "C07_2007-10-23T180000.png"]
    assert sorted(x.name for x in out.iterdir()) == [*pictures, "result.nc"]
    with read_result(out / "result.nc") as result:
        assert result.attrs["satellite"] == "GOES-18"
        assert result.attrs["hydrometeors"] == "cloud; ice"
        assert result.attrs["negative_snow_mixing_ratio_count"] == 2
        assert result.attrs["smallest_negative_snow_mixing_ratio"] == pytest.approx(-2e-9)
        ice = result["ice_optical_depth"].sel(band="C04").values[0] > 0
        assert ice[:3, :3].all() and ice.sum() == 9
        vapour_hides = result["brf"].sel(band="C04").values[0] < 0.1
        assert (vapour_hides | ice).all() and vapour_hides.any()
        temperature = result["brightness_temperature"].values[0]
        burns = result["fire_fraction"].values[0] > 0
        assert ((temperature[~burns] > 270) & (temperature[~burns] < 330)).all()
        assert np.median(temperature[burns]) > temperature[~burns].max()
        assert result.attrs["fires_file"] == inputs.fires.name
        assert np.isfinite(result["radiance"]).all()
    assert complaints(out / "result.nc") == []
    seen = tmp_path / "seen.nc"
    how = ["--seed", 1, "--fire-saturation-temperature", 300, "--quantised", "--out", seen]
    outcome = invoke("observe", out / "result.nc", *how)
    assert outcome.exit_code == 0, outcome.output
    assert "saturated pixels: C04 0, C07 " in outcome.output
    assert complaints(seen) == []
    with read_result(seen) as report:
        assert report["brightness_temperature"].max() < 300.01
        assert report.attrs["noise"] == "of the instrument, seed 1"
        assert "temperature" in report  # all that a retrieval needs goes along
    outcome = invoke("observe", seen, "--out", tmp_path / "again.nc")
    assert outcome.exit_code == 2 and "was observed before" in outcome.stderr


def test_several_files_and_times_by_name(invoke, tmp_path, inputs):
    later = inputs.wrf.with_name("wrfout_d01_2007-10-23_20-00-00.nc")
    shutil.copy(inputs.wrf, later)
    with netCDF4.Dataset(later, "a") as file:
        file["Times"][0] = np.array(list("2007-10-23_20:00:00"), "S1")
    options = ["--ocean-albedo", 0.06, "--num-streams", 2, "--gases", "none"]
    options += ["--bands", "C01,C06", "--error-budget", 1e-3, "--out", tmp_path / "out"]
    for wrf in ([inputs.wrf, later], [inputs.wrf.with_name("wrfout_*")]):
        outcome = invoke("simulate", *wrf, *options)
        assert outcome.exit_code == 0, outcome.output
        with read_result(tmp_path / "out" / "result.nc") as result:
            hours = np.array(["2007-10-23T18", "2007-10-23T20"], "datetime64[ns]")
            np.testing.assert_array_equal(result["time"], hours)
            assert result.attrs["wrf_file"] == f"{inputs.wrf.name}; {later.name}"
            assert result.attrs["counted_over"].startswith("2 times, ")
            assert result.attrs["error_budget"] == 1e-3
            early, late = result["solar_zenith_angle"].mean(["y", "x"]).values
            assert late < early
        assert "\n128 pixels of 2 times; flagged: " in outcome.stdout
    outcome = invoke("simulate", *wrf, *options, "--time", "2007-10-23T20:00")
    assert outcome.exit_code == 0, outcome.output
    with read_result(tmp_path / "out" / "result.nc") as result:
        np.testing.assert_array_equal(result["time"], hours[1:])
        assert "counted_over" not in result.attrs
        assert result.attrs["wrf_file"] == later.name


def add_ground(path):
    """A frozen sea, snow on the northern half of the land, land use and the model's albedo."""
    with netCDF4.Dataset(path, "a") as file:
        land = file["LANDMASK"][0].data
        north = land * (np.arange(SIZE) >= SIZE // 2)[:, None]
        grounds = {"SEAICE": 1 - land, "SNOWC": north, "ALBEDO": 0.08 + 0.17 * land}
        grounds["LU_INDEX"] = np.where(land > 0, 16, 17)
        for name, values in grounds.items():
            dims = ("Time", "south_north", "west_east")
            file.createVariable(name, "f4", dims)[0] = values
        file.MMINLU = "MODIFIED_IGBP_MODIS_NOAH"
    return land > 0, north > 0


def test_grounds_without_an_albedo_file(invoke, tmp_path, inputs):
    """Land by the model, a frozen sea and snow by their names, emissivity by land use."""
    land, snow = add_ground(inputs.wrf)
    options = ["--bands", "C04,C07", "--num-streams", 2, "--satellite", "GOES-18", "--time", 0]
    options += ["--land-albedo", "model", "--snow-albedo", "old snow"]
    options += ["--sea-ice-albedo", 0.4, "--emissivity", "land-use", "--hydrometeors", "none"]
    options += ["--gases", "none", "--error-budget", 0]
    outcome = invoke("simulate", inputs.wrf, *options, "--out", tmp_path / "out")
    assert outcome.exit_code == 0, outcome.output
    assert "warning: the albedo of land is the model's, which is one for all" in outcome.stderr
    assert "warning: snow on the ground is simulated as if nothing stood in it" in outcome.stderr
    for line in (
        "albedo of the ground: land without any other the model's broadband; snow (old snow); "
        "sea ice 0.4",
        f"ice on the sea: {(~land).sum()} columns",
        f"snow on the ground: {snow.sum()} columns",
        "emissivity of the ground in C07: by land use (MODIFIED_IGBP_MODIS_NOAH) over land",
    ):
        assert line in outcome.output
    with read_result(tmp_path / "out" / "result.nc") as result:
        c04, c07 = result["surface_albedo"].isel(time=0).values
        assert (result["quality_flag"] & QUALITY_FLAGS["no_albedo"] == 0).all()
    np.testing.assert_allclose(c04, np.where(land, np.where(snow, 0.207, 0.25), 0.4), rtol=1e-6)
    np.testing.assert_allclose(1 - c07, np.where(land & ~snow, 0.86, 0.984), rtol=1e-6)
