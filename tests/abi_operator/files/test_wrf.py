"""The WRF reader: what it makes of WRF's variables, of old files' quirks and of broken files."""

from pathlib import Path

import netCDF4
import numpy as np
import pytest

from abi_operator.files import InputError, read_wrf, wrf_coordinates
from abi_operator.files.wrf import VARIABLE_MAP
from abi_operator.nomenclature import MODEL

# Rounding of float32 input, of which pressure is a sum.
FLOAT32 = 1e-7

LAYERS = ("Time", "bottom_top", "south_north", "west_east")
LEVELS = ("Time", "bottom_top_stag", "south_north", "west_east")
SURFACE = ("Time", "south_north", "west_east")


@pytest.fixture
def twin(write_wrf_twin):
    """A file with one variable changed by `change(values)`."""

    def write(name, change):
        path = write_wrf_twin()
        with netCDF4.Dataset(path, "a") as file:
            file[name][:] = change(file[name][:])
        return path

    return write


def test_variables_are_ours_top_first_in_si(write_wrf_twin):
    path = write_wrf_twin()
    dataset = read_wrf(path, 1)
    with netCDF4.Dataset(path) as file:
        names = [name for name in VARIABLE_MAP if name in file.variables]
        raw = {name: np.array(file[name][1], np.float64) for name in names}
    pressure = (raw["P"] + raw["PB"])[::-1]
    temperature = (raw["T"] + 300)[::-1] * (pressure / 1e5) ** (2 / 7)
    np.testing.assert_allclose(dataset["layer_pressure"], pressure, rtol=FLOAT32)
    np.testing.assert_allclose(dataset["layer_temperature"], temperature, rtol=FLOAT32)
    np.testing.assert_allclose(dataset["height"], (raw["PH"] + raw["PHB"])[::-1] / 9.81)
    np.testing.assert_array_equal(dataset["surface_pressure"], raw["PSFC"])
    np.testing.assert_array_equal(dataset["vapour_mixing_ratio"], raw["QVAPOR"][::-1])
    np.testing.assert_array_equal(dataset["cloud_mixing_ratio"], raw["QCLOUD"][::-1])
    np.testing.assert_array_equal(dataset["latitude"], raw["XLAT"])
    np.testing.assert_array_equal(dataset["longitude"], raw["XLONG"])
    assert (np.diff(dataset["layer_pressure"], axis=0) > 0).all()
    assert dataset["time"].values == np.datetime64("2007-10-23T18:30:00", "ns")


def test_variables_are_as_the_nomenclature_says(write_wrf_twin):
    for name, array in read_wrf(write_wrf_twin(), 0).variables.items():
        if name != "time":
            entry = MODEL[name]
            assert array.dims == entry.dims
            assert array.dtype == np.float64
            assert array.attrs["units"] == entry.units
            assert array.attrs["long_name"] == entry.long_name
            assert array.attrs.get("standard_name") == entry.standard_name


def test_a_block_of_rows_is_the_same_as_those_rows_of_the_whole(write_wrf_twin):
    path = write_wrf_twin()
    whole = read_wrf(path, 0)
    for rows in (slice(1, 3), slice(0, 1), slice(1, 2), slice(2, 3)):
        block = read_wrf(path, 0, rows)
        assert set(block.variables) == set(whole.variables)
        for name in {*whole.variables} - {"time"}:
            np.testing.assert_array_equal(block[name], whole[name].isel(y=rows), err_msg=name)


def test_attributes_tell_of_the_run(write_wrf_twin):
    path = write_wrf_twin()
    for dataset in (read_wrf(path, 0), wrf_coordinates(path)):
        assert dataset.attrs["title"] == "OUTPUT FROM WRF V4.2 MODEL"
        assert dataset.attrs["microphysics_scheme"] == "morrison"
        assert dataset.attrs["bottom_top_levels_of_run"] == 29


@pytest.mark.parametrize("dimension", ["DateStrLen", "string19"])
def test_times_are_read_whatever_their_dimension_is_called(write_wrf_twin, dimension):
    coordinates = wrf_coordinates(write_wrf_twin(times=dimension))
    expected = np.array(["2007-10-23T18:00", "2007-10-23T18:30"], "datetime64[ns]")
    np.testing.assert_array_equal(coordinates["time"], expected)
    assert coordinates["time"].dtype == "datetime64[ns]"


@pytest.mark.parametrize(
    ("numbers", "units"),
    [
        ((0.0, 30.0), ""),
        ((0.0, 30.0), "minutes since 2007-10-23 18:00:00"),
        ((42.0, 42.5), "hours since 2007-10-22 00:00:00"),
    ],
)
def test_times_come_from_xtime_where_there_are_no_others(write_wrf_twin, numbers, units):
    file = write_wrf_twin(times=None, xtime=numbers, xtime_units=units)
    expected = np.array(["2007-10-23T18:00", "2007-10-23T18:30"], "datetime64[ns]")
    np.testing.assert_array_equal(wrf_coordinates(file)["time"], expected)


def test_units_of_xtime_that_are_none_are_refused(write_wrf_twin):
    for units, words in (("fortnights", "in 'fortnights'"), ("hours since then", "no time")):
        with pytest.raises(InputError, match=words):
            wrf_coordinates(write_wrf_twin(times=None, xtime=(0.0, 1.0), xtime_units=units))


def test_positions_may_be_written_once_for_all_times(write_wrf_twin):
    path = write_wrf_twin(timeless=("XLAT", "XLONG"))
    np.testing.assert_allclose(
        read_wrf(path, 1)["latitude"][:, 0], [33.0, 33.1, 33.2], rtol=FLOAT32
    )
    assert wrf_coordinates(path).attrs["moving_nest"] == 0


def test_positions_of_a_moving_nest_are_those_of_the_time(twin):
    path = twin("XLAT", lambda latitude: latitude + np.array([0, 1])[:, None, None])
    assert wrf_coordinates(path).attrs["moving_nest"] == 1
    moved = wrf_coordinates(path, 1)["latitude"] - wrf_coordinates(path)["latitude"]
    np.testing.assert_allclose(moved, 1, rtol=100 * FLOAT32)
    np.testing.assert_array_equal(wrf_coordinates(path, 1)["latitude"], read_wrf(path, 1).latitude)


@pytest.mark.parametrize(
    ("name", "values", "expected"), [("LANDMASK", [1, 0], [1, 0]), ("XLAND", [1, 2], [1, 0])]
)
def test_land_mask_is_one_over_land(write_wrf_twin, name, values, expected):
    mask = np.broadcast_to(np.array(values, np.float32), (2, 3, 2))
    path = write_wrf_twin(extra={name: (SURFACE, mask)})
    for dataset in (read_wrf(path, 0), wrf_coordinates(path)):
        np.testing.assert_array_equal(dataset["land_mask"], np.broadcast_to(expected, (3, 2)))


def test_sea_ice_and_snow_are_read(write_wrf_twin):
    rng = np.random.default_rng(7)
    names = {"SEAICE": "sea_ice", "SNOWC": "snow_cover", "SNOW": "snow_mass"}
    extra = {name: (SURFACE, rng.uniform(0, 1, (2, 3, 2)).astype(np.float32)) for name in names}
    path = write_wrf_twin(extra=extra)
    for name, ours in names.items():
        np.testing.assert_array_equal(read_wrf(path, 1)[ours], extra[name][1][1])
    np.testing.assert_array_equal(wrf_coordinates(path, 1)["sea_ice"], extra["SEAICE"][1][1])


def test_land_use_is_read_with_its_scheme(write_wrf_twin):
    extra = {
        name: (SURFACE, np.full((2, 3, 2), value, np.float32))
        for name, value in {"IVGTYP": 10, "LU_INDEX": 7, "ALBEDO": 0.25}.items()
    }
    path = write_wrf_twin(extra=extra)
    with netCDF4.Dataset(path, "a") as file:
        file.MMINLU = "USGS"
    dataset = read_wrf(path, 0)
    assert (dataset["land_use"] == 7).all() and (dataset["broadband_albedo"] == 0.25).all()
    assert dataset.attrs["land_use_scheme"] == "USGS"


def test_optional_variables_are_absent_where_the_file_has_none(write_wrf_twin):
    dataset = read_wrf(write_wrf_twin(without=("PSFC",)), 0)
    for name in ("surface_pressure", "rain_mixing_ratio", "ice_mixing_ratio", "land_mask"):
        assert name not in dataset


@pytest.mark.parametrize(
    ("name", "ours"),
    [
        ("QRAIN", "rain_mixing_ratio"),
        ("QICE", "ice_mixing_ratio"),
        ("QSNOW", "snow_mixing_ratio"),
        ("QGRAUP", "graupel_mixing_ratio"),
        ("QHAIL", "hail_mixing_ratio"),
        ("QNCLOUD", "cloud_number_mixing_ratio"),
        ("QNDROP", "cloud_number_mixing_ratio"),
        ("QNRAIN", "rain_number_mixing_ratio"),
        ("QNICE", "ice_number_mixing_ratio"),
        ("QNSNOW", "snow_number_mixing_ratio"),
        ("QNGRAUPEL", "graupel_number_mixing_ratio"),
        ("QNHAIL", "hail_number_mixing_ratio"),
        ("RE_CLOUD", "cloud_effective_radius"),
        ("RE_ICE", "ice_effective_radius"),
        ("RE_SNOW", "snow_effective_radius"),
    ],
)
def test_optional_hydrometeors_are_read(write_wrf_twin, name, ours):
    values = np.arange(2 * 4 * 3 * 2, dtype=np.float32).reshape(2, 4, 3, 2)
    values *= np.float32(1e-5)
    dataset = read_wrf(write_wrf_twin(extra={name: (LAYERS, values)}), 0)
    np.testing.assert_array_equal(dataset[ours], values[0, ::-1])


def test_further_categories_of_ice_are_added_up(write_wrf_twin):
    one = np.full((2, 4, 3, 2), 1e-3, np.float32)
    dataset = read_wrf(write_wrf_twin(extra={"QICE2": (LAYERS, one), "QICE3": (LAYERS, one)}), 0)
    np.testing.assert_allclose(dataset["other_ice_mixing_ratio"], 2e-3, rtol=FLOAT32)
    assert "ice_mixing_ratio" not in dataset


def test_the_ground_is_read_where_it_is_there(write_wrf_twin):
    values = np.linspace(280, 300, 12, dtype=np.float32).reshape(2, 3, 2)
    fields = {"TSK": (SURFACE, values), "EMISS": (SURFACE, values / 320)}
    dataset = read_wrf(write_wrf_twin(extra=fields), 1)
    np.testing.assert_array_equal(dataset["surface_temperature"], values[1])
    np.testing.assert_array_equal(dataset["surface_emissivity"], (values / 320)[1])
    assert "surface_temperature" not in read_wrf(write_wrf_twin(), 1)


def test_a_scheme_without_a_name_keeps_its_number(write_wrf_twin):
    path = write_wrf_twin()
    with netCDF4.Dataset(path, "a") as file:
        file.MP_PHYSICS = np.int32(99)
    assert read_wrf(path, 0).attrs["microphysics_scheme"] == "MP_PHYSICS=99"


def test_negative_mixing_ratios_are_set_to_zero_and_counted(write_wrf_twin):
    values = np.zeros((2, 4, 3, 2), np.float32)
    values[0, 0, 0, :] = -1e-12
    values[0, 1, 0, 0] = 2e-4
    rain = read_wrf(write_wrf_twin(extra={"QRAIN": (LAYERS, values)}), 0)["rain_mixing_ratio"]
    assert rain.attrs["num_negative_set_to_zero"] == 2
    assert rain.min() == 0
    assert rain.sum() == values[0, 1, 0, 0]


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match="wrfout_d01 does not exist"):
        wrf_coordinates(tmp_path / "wrfout_d01")


def test_a_file_of_another_kind_is_refused(tmp_path):
    (tmp_path / "wrfout").write_text("no NetCDF")
    with pytest.raises(InputError, match="wrfout cannot be read as NetCDF"):
        read_wrf(tmp_path / "wrfout", 0)


@pytest.mark.parametrize("read", [wrf_coordinates, lambda path: read_wrf(path, 0)])
def test_all_missing_variables_are_named_at_once(write_wrf_twin, read):
    path = write_wrf_twin(without=("PB", "QCLOUD", "XLONG"))
    with pytest.raises(InputError, match="has no PB, QCLOUD, XLONG; give a WRF output file"):
        read(path)


@pytest.mark.parametrize("time", [-1, 2])
def test_a_time_that_the_file_lacks_is_refused(write_wrf_twin, time):
    with pytest.raises(InputError, match=f"has 2 times; ask for one of them, from 0, not {time}"):
        read_wrf(write_wrf_twin(), time)


def test_a_variable_on_the_wrong_grid_is_refused(write_wrf_twin):
    values = np.zeros((2, 5, 3, 2), np.float32)
    with pytest.raises(InputError, match="QVAPOR in .* has dimensions .*bottom_top_stag"):
        read_wrf(write_wrf_twin(extra={"QVAPOR": (LEVELS, values)}), 0)


def test_values_that_are_not_finite_are_refused(twin):
    def spoil(values):
        values[0, 2, 1, 1] = np.nan
        return values

    path = twin("T", spoil)
    place = "at Time=0, bottom_top=2, south_north=1, west_east=1"
    with pytest.raises(InputError, match=rf"T in .* is missing .* {place} \(1 of the 24 val"):
        read_wrf(path, 0)
    read_wrf(path, 1)  # the other time is sound


def test_pressure_that_does_not_fall_with_height_is_refused(twin):
    def swap(values):
        values[:, [1, 2], 0, 0] = values[:, [2, 1], 0, 0]
        return values

    with pytest.raises(InputError, match="does not fall monotonically .* in 1 of the 6 columns"):
        read_wrf(twin("PB", swap), 0)


def test_surface_pressure_below_that_of_the_lowest_layer_is_refused(twin):
    with pytest.raises(InputError, match="PSFC .* in 6 of the 6 columns"):
        read_wrf(twin("PSFC", lambda values: values - 300e2), 0)


def test_a_layer_without_thickness_is_refused(twin):
    def squeeze(values):
        values[:, 3] = values[:, 2] - 1000
        return values

    with pytest.raises(InputError, match="does not rise from level to level in 6 of the 6 columns"):
        read_wrf(twin("PHB", squeeze), 0)


def test_a_time_that_is_none_is_refused(write_wrf_twin):
    # Nanoseconds cannot count the last, which NumPy takes for a day of 1754.
    for text in ("0000-00-00_00:00:00", " " * 19, "0001-01-01_18:00:00"):
        with pytest.raises(InputError, match=f"Times in .* is '{text}', which is no time"):
            wrf_coordinates(write_wrf_twin(time_texts=("2007-10-23_18:00:00", text)))


def test_no_time_at_all_is_refused(write_wrf_twin):
    with pytest.raises(InputError, match="has no Times, nor XTIME"):
        wrf_coordinates(write_wrf_twin(times=None))


@pytest.mark.real
def test_real_file_with_a_cut_column_and_a_moving_nest(sample_data: Path):
    path = sample_data / "wrf_mercator_sample.nc"
    coordinates = wrf_coordinates(path)
    assert coordinates.sizes["time"] == 4
    assert coordinates["time"].values[0] == np.datetime64("2005-08-28T12:00")
    assert coordinates.attrs["microphysics_scheme"] == "wsm3"
    assert coordinates.attrs["bottom_top_levels_of_run"] == 29
    assert coordinates.attrs["moving_nest"] == 1
    num_negative_rain = 0
    for time in range(4):
        dataset = read_wrf(path, time, slice(0, 48))
        assert dataset.sizes == {"layer": 14, "level": 15, "y": 48, "x": 48, "corner": 4}
        assert 48e3 < dataset["layer_pressure"].min() < 54e3
        assert dataset["layer_pressure"].max() < dataset["surface_pressure"].max() < 103e3
        assert 255 < dataset["layer_temperature"].min() < dataset["layer_temperature"].max() < 310
        num_negative_rain += dataset["rain_mixing_ratio"].attrs["num_negative_set_to_zero"]
    assert num_negative_rain == 10  # counted in the file with netCDF4
