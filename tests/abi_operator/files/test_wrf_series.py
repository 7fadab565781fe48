"""Several output files of WRF as one series of times."""

import netCDF4
import numpy as np
import pytest
import xarray as xr

from abi_operator.files import InputError, open_wrf_series, read_wrf, wrf_series


@pytest.fixture
def one_time_each(write_wrf_twin):
    """Files of one time each, of an hour that is not the first in the alphabet of names."""
    names = {"c": "2007-10-23_18:00:00", "a": "2007-10-23_19:00:00", "b": "2007-10-24_18:00:00"}

    def write(name, text):
        path = write_wrf_twin(time_texts=(text, text), name=f"wrfout_{name}")
        keep_first_time(path)
        return path

    return [write(*pair) for pair in sorted(names.items())]


def keep_first_time(path, num_columns=2):
    """Write a file anew without all but its first time, and with so many columns from the west."""
    with netCDF4.Dataset(path) as file:
        parts = {"Time": slice(1), "west_east": slice(num_columns)}
        variables = {
            name: (x.dtype, x.dimensions, x[tuple(parts.get(d, slice(None)) for d in x.dimensions)])
            for name, x in file.variables.items()
        }
        sizes = {name: None if name == "Time" else len(x) for name, x in file.dimensions.items()}
        attributes = {name: file.getncattr(name) for name in file.ncattrs()}
    with netCDF4.Dataset(path, "w") as file:
        file.setncatts(attributes)
        for name, size in (sizes | {"west_east": num_columns}).items():
            file.createDimension(name, size)
        for name, (kind, dims, values) in variables.items():
            file.createVariable(name, kind, dims)[:] = values


def change(path, **attributes):
    with netCDF4.Dataset(path, "a") as file:
        file.setncatts(attributes)


def move(path, degrees):
    with netCDF4.Dataset(path, "a") as file:
        file["XLONG"][:] += degrees


def test_times_of_all_files_come_in_order(one_time_each):
    a, b, c = one_time_each
    series = open_wrf_series(one_time_each)
    hours = ["2007-10-23T18", "2007-10-23T19", "2007-10-24T18"]
    np.testing.assert_array_equal(series.times, np.array(hours, "datetime64[ns]"))
    assert series.places == ((c, 0), (a, 0), (b, 0)) and not series.moving
    assert series.coordinates(1).sizes == {"time": 3, "y": 3, "x": 2}
    assert series.read(1, slice(1, 3)).identical(read_wrf(a, 0, slice(1, 3)))
    assert open_wrf_series(c).places == ((c, 0),)


def test_blocks_of_files_that_stay_open(one_time_each, monkeypatch):
    """As by `read`, but that a file is opened once for its blocks, and closed before the next."""
    series = open_wrf_series(one_time_each)
    opened, closed, whole = [], [], wrf_series.opened_wrf

    def noted(path):
        file = whole(path)

        def close():
            closed.append(path)
            file.close()

        told = file.copy()
        told.set_close(close)
        opened.append(path)
        return told

    monkeypatch.setattr(wrf_series, "opened_wrf", noted)
    (first, _), (second, _), _ = series.places
    with pytest.raises(KeyboardInterrupt), series.opened() as read:
        for time in range(2):
            for rows in (slice(0, 1), slice(1, 3)):
                assert read(time, rows).identical(series.read(time, rows))
        assert (opened, closed) == ([first, second], [first])
        raise KeyboardInterrupt
    assert closed == [first, second]


def test_patterns_stand_for_the_files_that_match(one_time_each, tmp_path):
    a, b, c = one_time_each
    series = open_wrf_series([tmp_path / "wrfout_[ab]", a])
    assert series.places == ((a, 0), (b, 0))
    with pytest.raises(InputError, match=r"no file matches .*wrf_\*; check the pattern"):
        open_wrf_series(tmp_path / "wrf_*")


@pytest.mark.parametrize(
    ("wanted", "found"),
    [
        (None, (0, 1, 2)),
        (1, (1,)),
        ("1", (1,)),
        ("2007-10-23T19:00", (1,)),
        ("2007-10-23_19:00:00", (1,)),
        ("2007-10-23T19:00:00Z", (1,)),
        ("2007-10-23", (0, 1)),
        ("2007-10-24, 0", (0, 2)),
    ],
)
def test_times_are_chosen_by_name_or_number(one_time_each, wanted, found):
    assert open_wrf_series(one_time_each).find(wanted) == found


@pytest.mark.parametrize(
    ("wanted", "sentence"),
    [
        (3, "the series of 3 files has 3 times; ask for one of them, from 0, not 3"),
        ("-1", "not -1"),
        ("2007-10-25", "has no time 2007-10-25; it has 2007-10-23T18:00:00, "),
        ("noon", "'noon' is no time; write it as 2005-08-28T12:00"),
        ("NaT", "'NaT' is no time"),
        ("", "'' is no time"),
    ],
)
def test_times_that_are_not_there_are_refused(one_time_each, wanted, sentence):
    with pytest.raises(InputError, match=sentence):
        open_wrf_series(one_time_each).find(wanted)


@pytest.mark.parametrize(
    ("breaks", "sentence"),
    [
        (lambda path: change(path, MP_PHYSICS=8), r"MP_PHYSICS is 8 in .*b and 10 in .*a; give"),
        (lambda path: move(path, 1.0), "wrfout_b is of another place than .*wrfout_a; give files"),
        (lambda path: path.write_bytes(path.with_name("wrfout_c").read_bytes()), "give it once"),
    ],
)
def test_files_that_do_not_belong_together_are_refused(one_time_each, breaks, sentence):
    breaks(one_time_each[1])
    with pytest.raises(InputError, match=sentence):
        open_wrf_series(one_time_each)


def test_nests_may_move_from_file_to_file(one_time_each):
    for path in one_time_each:
        change(path, GRID_ID=2)
    move(one_time_each[1], 1.0)
    series = open_wrf_series(one_time_each)
    assert series.moving and series.coordinates(0).attrs["moving_nest"] == 1
    shift = series.coordinates(2)["longitude"] - series.coordinates(0)["longitude"]
    np.testing.assert_allclose(shift, 1.0, rtol=1e-5)


def test_one_grid_is_asked_for(one_time_each):
    keep_first_time(one_time_each[1], num_columns=1)
    with pytest.raises(InputError, match="west_east is 1 in .*wrfout_b and 2 in .*wrfout_a; give"):
        open_wrf_series(one_time_each)


@pytest.mark.parametrize("beside", [True, False])
def test_a_time_that_a_file_has_twice_is_refused(write_wrf_twin, one_time_each, beside):
    """Its second picture and result would take the place of the first."""
    text = "2007-10-25_18:00:00"
    path = write_wrf_twin(time_texts=(text, text), name="wrfout_twice")
    with pytest.raises(InputError, match="twice has the time 2007-10-25T18:00:00 twice; cut one"):
        open_wrf_series([path, *one_time_each] if beside else path)


def test_a_time_dimension_that_was_squeezed_out_is_one_time(write_wrf_twin, tmp_path):
    path = write_wrf_twin(time_texts=("2007-10-23_18:00:00", "2007-10-23_18:30:00"))
    squeezed = tmp_path / "squeezed.nc"
    with xr.open_dataset(path, decode_times=False) as file:
        file.isel(Time=1).to_netcdf(squeezed, unlimited_dims=())
    whole, one = open_wrf_series(path), open_wrf_series(squeezed)
    assert one.places == ((squeezed, 0),)
    np.testing.assert_array_equal(one.times, whole.times[1:])
    assert one.coordinates(0).sizes == {"time": 1, "y": 3, "x": 2}
    for rows in (slice(None), slice(1, 3)):
        assert one.read(0, rows).identical(whole.read(1, rows))
    with pytest.raises(InputError, match="has 1 times; ask for one of them, from 0, not 1"):
        read_wrf(squeezed, 1)
