"""Writing a result block by block and reading it back."""

import resource

import netCDF4
import numpy as np
import pytest
import xarray as xr

from abi_operator.files import (
    InputError,
    ResultWriter,
    note_files,
    noted_files,
    output_folder,
    read_result,
)
from abi_operator.nomenclature import QUALITY_FLAGS, SCENARIO

TIMES = np.array(["2007-10-23T18:00:00", "2007-10-23T18:30:00.5"], "datetime64[ns]")
SHAPE = (5, 3)
SIZES = {"band": 2, "layer": 4, "level": 5, "y": 5, "x": 3}


@pytest.fixture
def results():
    """A whole result at each of two times."""
    rng = np.random.default_rng(7)

    def values(*dims):
        return dims, rng.uniform(size=[SIZES[dim] for dim in dims])

    position = {name: values("y", "x") for name in ("latitude", "longitude")}
    optics = {"smoke_ssa": values("band"), "smoke_base": values()}
    datasets = []
    for time in TIMES:
        fields = {name: values(*v.dims) for name, v in SCENARIO.items() if name not in position}
        fields["quality_flag"] = ("y", "x"), rng.integers(0, 32, SHAPE)
        fields["reflectance_factor"] = values("band", "y", "x")
        fields["brf"] = values("band", "y", "x")
        fields["brf"][1][0, 2, 1] = np.nan
        fields["smoke_brightness"] = values("y", "x")
        coords = {"band": ["C01", "C02"], "time": time, **position}
        datasets.append(xr.Dataset(fields | optics, coords))
    return datasets


@pytest.fixture
def path(tmp_path, results):
    """A file with both results, written in blocks of two rows, southern rows last."""
    path = tmp_path / "result.nc"
    with ResultWriter(path, times=TIMES, shape=SHAPE, attributes={"bands": "C01 C02"}) as writer:
        write_all(writer, results)
    return path


def write_all(writer, results):
    for time_index, result in enumerate(results):
        for start in (4, 2, 0):
            rows = slice(start, start + 2)
            writer.write(time_index, rows, result.isel(y=rows))


def test_what_is_read_is_what_was_written(path, results):
    with read_result(path) as result:
        assert set(result.variables) == set(results[0].variables)
        for index, written in enumerate(results):
            read = result.isel(time=index)
            for name in written.variables:
                np.testing.assert_array_equal(read[name], written[name])
                assert read[name].dims == written[name].dims
        assert result["time"].dtype == "datetime64[ns]"
        assert result["reflectance_factor"].dims == ("time", "band", "y", "x")
        assert result["latitude"].dims == ("y", "x")
        assert result["smoke_ssa"].dims == ("band",)
        assert result["smoke_base"].dims == ()
        assert result["quality_flag"].dtype == np.uint8
        assert result["brf"].dtype == np.float64
        assert result.sel(band="C02")["reflectance_factor"].sizes == {"time": 2, "y": 5, "x": 3}


def test_the_file_follows_the_conventions(path):
    with netCDF4.Dataset(path) as file:
        assert file.Conventions == "CF-1.11"
        assert file.source.startswith("abi_operator ")
        assert "written by abi_operator" in file.history
        assert file.bands == "C01 C02"
        flag = file["quality_flag"]
        assert flag.dtype == np.uint8
        assert flag.flag_masks.dtype == np.uint8
        assert dict(zip(flag.flag_meanings.split(), flag.flag_masks, strict=True)) == QUALITY_FLAGS
        assert file["time"].standard_name == "time"
        brf = file["brf"]
        assert brf.coordinates == "latitude longitude"
        assert brf.units == "1"
        assert brf.filters()["zlib"]
        assert brf.filters()["complevel"] == 1
        assert np.isnan(brf.getncattr("_FillValue"))
        assert brf.chunking() == [1, 2, 1, 3]  # rows of the first block written
        assert file["solar_zenith_angle"].standard_name == "solar_zenith_angle"
        assert file["smoke_ssa"].long_name == "single-scattering albedo of the plume"


def test_a_vertical_coordinate_says_where_it_grows(path):
    with netCDF4.Dataset(path) as file:
        assert file["height"].positive == "up"
        assert file["pressure"].coordinates == "height latitude longitude"
        assert "positive" not in file["pressure"].ncattrs()


def test_bands_have_their_names_and_wavelengths(tmp_path, results):
    about = {"units": "um"}
    results = [r.assign_coords(band_wavelength=("band", [0.47, 0.64], about)) for r in results]
    path = tmp_path / "result.nc"
    with ResultWriter(path, times=TIMES, shape=SHAPE) as writer:
        write_all(writer, results)
    with netCDF4.Dataset(path) as file:
        assert file["band"].standard_name == "sensor_band_identifier"
        assert "units" not in file["band"].ncattrs()
        wavelength = file["band_wavelength"]
        assert wavelength.standard_name == "sensor_band_central_radiation_wavelength"
        assert wavelength.units == "um"
        assert file["brf"].coordinates == "band_wavelength latitude longitude"
        assert file["smoke_ssa"].coordinates == "band_wavelength"
    with read_result(path) as result:
        assert float(result["band_wavelength"].sel(band="C02")) == 0.64


def test_a_grid_on_a_map_has_coordinates_of_it(tmp_path, results):
    axes = {"x": ("x", 1e3 * np.arange(3.0)), "y": ("y", 1e3 * np.arange(5.0))}
    crs = {"crs": ((), np.int32(0), {"grid_mapping_name": "mercator"})}
    path = tmp_path / "result.nc"
    with ResultWriter(path, times=TIMES, shape=SHAPE, grid=xr.Dataset(coords=axes | crs)) as writer:
        write_all(writer, results)
    with netCDF4.Dataset(path) as file:
        assert file["crs"].grid_mapping_name == "mercator"
        assert file["brf"].grid_mapping == file["pressure"].grid_mapping == "crs"
        assert "grid_mapping" not in file["smoke_ssa"].ncattrs()
    with read_result(path) as result:
        np.testing.assert_array_equal(result["brf"].sel(y=2e3, x=1e3), result["brf"][..., 2, 1])
    with xr.open_dataset(path) as plain:  # as a user without this package has it
        assert set(plain["brf"].coords) == {"time", "band", "latitude", "longitude", "x", "y"}


def test_a_history_goes_on(tmp_path, results):
    path, told = tmp_path / "result.nc", {"history": "as it was"}
    with ResultWriter(path, times=TIMES, shape=SHAPE, attributes=told) as writer:
        write_all(writer, results)
    with netCDF4.Dataset(path) as file:
        own, before = file.history.splitlines()
    assert "written by abi_operator" in own and before == "as it was"


def test_the_history_tells_the_command(tmp_path, results):
    words = "abi-operator simulate 'a file' --out folder"
    with ResultWriter(tmp_path / "a.nc", times=TIMES, shape=SHAPE, command=words) as writer:
        write_all(writer, results)
    with netCDF4.Dataset(tmp_path / "a.nc") as file:
        assert f"Z {words} (abi_operator " in file.history


def test_positions_of_a_moving_grid_depend_on_time(tmp_path, results):
    results[1]["latitude"] = results[1]["latitude"] + 1
    path = tmp_path / "moving.nc"
    with ResultWriter(path, times=TIMES, shape=SHAPE, moving=True) as writer:
        write_all(writer, results)
    with read_result(path) as result:
        assert result["latitude"].dims == ("time", "y", "x")
        np.testing.assert_array_equal(result["latitude"][1], results[1]["latitude"])


def test_positions_that_change_without_notice_are_refused(tmp_path, results):
    results[1]["latitude"] = results[1]["latitude"] + 1
    with pytest.raises(ValueError, match="latitude differs from time to time"):
        with ResultWriter(tmp_path / "result.nc", times=TIMES, shape=SHAPE) as writer:
            write_all(writer, results)
    assert not (tmp_path / "result.nc").exists()


def test_aerosol_properties_that_change_are_refused(tmp_path, results):
    results[1]["smoke_ssa"] = results[1]["smoke_ssa"] / 2
    with pytest.raises(ValueError, match="smoke_ssa differs from block to block"):
        with ResultWriter(tmp_path / "result.nc", times=TIMES, shape=SHAPE) as writer:
            write_all(writer, results)


def test_rows_that_nobody_wrote_are_missed(tmp_path, results):
    with pytest.raises(ValueError, match="8 of 10 rows of .* were never written"):
        with ResultWriter(tmp_path / "result.nc", times=TIMES, shape=SHAPE) as writer:
            writer.write(0, slice(0, 2), results[0].isel(y=slice(0, 2)))
    assert not (tmp_path / "result.nc").exists()


def test_blocks_that_do_not_fit_are_refused(tmp_path, results):
    with pytest.raises(KeyboardInterrupt):
        with ResultWriter(tmp_path / "result.nc", times=TIMES, shape=SHAPE) as writer:
            with pytest.raises(ValueError, match="is no block of"):
                writer.write(0, slice(0, 3), results[0].isel(y=slice(0, 2)))
            with pytest.raises(ValueError, match="not of 2007-10-23T18:30"):
                writer.write(1, slice(0, 2), results[0].isel(y=slice(0, 2)))
            writer.write(0, slice(0, 2), results[0].isel(y=slice(0, 2)))
            with pytest.raises(ValueError, match="the first one had"):
                writer.write(0, slice(2, 4), results[0].isel(y=slice(2, 4)).drop_vars("brf"))
            raise KeyboardInterrupt
    assert not (tmp_path / "result.nc").exists()


def test_a_folder_that_is_not_there_is_an_input_error(tmp_path):
    with pytest.raises(InputError, match="result.nc cannot be written"):
        ResultWriter(tmp_path / "absent" / "result.nc", times=TIMES, shape=SHAPE)


def test_results_without_their_variables_are_refused(path, tmp_path):
    with read_result(path) as result:
        result.drop_vars(["quality_flag", "latitude"]).to_netcdf(tmp_path / "less.nc")
    with pytest.raises(InputError, match="has no latitude, quality_flag; give a result"):
        read_result(tmp_path / "less.nc")
    with pytest.raises(InputError, match="absent.nc does not exist"):
        read_result(tmp_path / "absent.nc")


@pytest.fixture
def no_large_files():
    """Files end after 8 kB, as on a disk that is full."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8192, limits[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_a_full_disk_is_said_in_one_sentence(tmp_path, results, no_large_files):
    with pytest.raises(
        InputError, match=r"out cannot be written \(NetCDF: .*\) after .*; make room"
    ):
        with output_folder(tmp_path / "out") as folder:
            with ResultWriter(folder / "result.nc", times=TIMES, shape=SHAPE) as writer:
                write_all(writer, results)
    assert list(tmp_path.iterdir()) == []


def test_a_result_that_is_closed_can_be_written_to(path):
    with read_result(path) as result:
        assert result["brf"].values.size
    with netCDF4.Dataset(path, "a") as file:
        file.note = "HDF5 refuses this where the file is still open"


def test_files_that_were_made_of_a_result_are_known(path, tmp_path):
    assert noted_files(path) == []
    (tmp_path / "a.png").touch()
    note_files(path, ["a.png", "gone.png", "../a.png"])
    assert noted_files(path) == ["a.png"]
    with netCDF4.Dataset(path, "a") as file:
        file.source = "another program"
    assert noted_files(path) == noted_files(tmp_path / "nothing.nc") == []
    path.write_text("no NetCDF")
    assert noted_files(path) == []
