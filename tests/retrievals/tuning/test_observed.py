"""Observations of every layout land on the scene's grid, or are refused with a reason."""

import numpy as np
import pytest
import xarray as xr

from abi_operator.files import InputError
from abi_operator.files.result import ResultWriter
from retrievals.tuning import compared, read_observed, report_lines
from retrievals.tuning.fixed_grid import nearest_on_axis, scan_angles
from retrievals.tuning.observed import bands_in_common
from retrievals.tuning.placing import once_each, spacing_km
from retrievals.tuning.satellite import check_satellite

# Of GOES-16, as its files have it.
PROJECTION = {
    "semi_major_axis": 6378137.0,
    "semi_minor_axis": 6356752.31414,
    "perspective_point_height": 35786023.0,
    "longitude_of_projection_origin": -75.0,
    "sweep_angle_axis": "x",
}


def named(image, name="C0{}", scale=1.0, units="1", **changes):
    """A file's content: variables of C01 to C03 and where they are."""
    values = image["reflectance_factor"].values
    variables = {
        name.format(k): (("lat", "lon"), scale * values[k - 1], {"units": units}) for k in (1, 2, 3)
    }
    places = {x: (("lat", "lon"), image[x].values) for x in ("latitude", "longitude")}
    return xr.Dataset(variables | places | changes)


@pytest.fixture
def write(tmp_path):
    def write(dataset, name="observed.nc"):
        dataset.to_netcdf(tmp_path / name)
        return [tmp_path / name]

    return write


def test_named_variables_lie_on_the_same_grid(image, write):
    seen = read_observed(write(named(image)), image)
    assert (
        seen.attrs["regridding"] == "none" and seen.attrs["observed_variables"] == "C01, C02, C03"
    )
    np.testing.assert_array_equal(seen["reflectance_factor"], image["reflectance_factor"])
    assert list(bands_in_common(image, seen)) == ["C01", "C02", "C03"]


def test_a_result_with_several_times_is_taken_at_the_scenes(image, tmp_path):
    time = image["time"].values
    dark = image.assign(reflectance_factor=0 * image["reflectance_factor"])
    times = np.array([time - np.timedelta64(1, "h"), time])
    with ResultWriter(tmp_path / "result.nc", times=times, shape=(3, 8)) as writer:
        for k, block in enumerate((dark, image)):
            writer.write(k, slice(0, 3), block.drop_vars("time"))
    for quantity in ("reflectance_factor", "brf"):  # a result says itself which it is
        seen = read_observed([tmp_path / "result.nc"], image, quantity=quantity)
        np.testing.assert_allclose(seen["reflectance_factor"], image["reflectance_factor"])
    with pytest.raises(InputError, match="30 minutes apart"):
        read_observed(
            [tmp_path / "result.nc"], image.assign_coords(time=time + np.timedelta64(2, "h"))
        )


def test_a_division_by_the_cosine_of_the_sun_is_undone(image, write):
    mu0 = np.cos(np.radians(48.0))
    for name, quantity in (("brf_C0{}", "reflectance_factor"), ("C0{}", "brf")):
        seen = read_observed(write(named(image, name, 1 / mu0)), image, quantity=quantity)
        np.testing.assert_allclose(seen["reflectance_factor"], image["reflectance_factor"])


def test_what_says_that_it_was_not_divided_is_believed(image, write):
    own = image["reflectance_factor"]
    for name in ("reflectance_factor_C0{}", "CMI_C0{}"):
        seen = read_observed(write(named(image, name)), image, quantity="brf")
        np.testing.assert_array_equal(seen["reflectance_factor"], own)
    red = own.sel(band="C02").values
    seen = read_observed(write(abi_file(image, "C02", red)), image, quantity="brf")
    assert np.nanmax(np.abs(seen["reflectance_factor"].values - red)) < 1e-12


def test_bands_of_modis_stand_for_abis(image, write):
    seen = read_observed(write(named(image, "Band{}")), image)
    assert list(seen["band"].values) == ["C01", "C02", "C03"]
    own = image["reflectance_factor"].values
    # Band 1 is red, 2 near infrared and 3 blue; what is of no such band is missing.
    np.testing.assert_array_equal(seen["reflectance_factor"], own[[2, 0, 1]])
    assert "Band3 of MODIS" in seen.attrs["observed_variables"]


def test_missing_values_are_missing_pixel_by_pixel(image, write):
    file = named(image)
    file["C02"][1, 2] = np.nan
    lost = np.isnan(read_observed(write(file), image)["reflectance_factor"].values)
    assert lost.sum() == 1 and lost[1, 1, 2]


def test_flags_of_a_file_of_several_bands_are_each_bands_own(image, write):
    """As of ABI's multi-band imagery: 1 is usable under conditions, 2 saturated."""
    file = named(image, "CMI_C0{}")
    quality = np.zeros(file["CMI_C01"].shape, np.int8)
    quality[1, 2], quality[0, 0] = 2, 1
    file["DQF_C01"] = (("lat", "lon"), quality)
    lost = np.isnan(read_observed(write(file), image)["reflectance_factor"].values)
    assert lost.sum() == 1 and lost[0, 1, 2]


def test_the_nearest_pixel_is_taken_where_that_is_asked_for(image, write):
    moved = named(image)
    moved["latitude"] = moved["latitude"] + 0.01  # 1.1 km
    with pytest.raises(InputError, match=r"1.11 km away .* which are 4.\d* km apart; regrid it"):
        read_observed(write(moved), image)
    seen = read_observed(write(moved), image, nearest_km=2.0)
    np.testing.assert_array_equal(seen["reflectance_factor"], image["reflectance_factor"])
    assert seen.attrs["regridding"] == "nearest pixel within 2 km"
    # Of a file of half the rows, the others have none.
    half = moved.isel(lat=slice(0, 1))
    seen = read_observed(write(half), image, nearest_km=2.0)["reflectance_factor"]
    assert np.isfinite(seen.values).all(axis=(0, 2)).tolist() == [True, False, False]
    with pytest.raises(InputError, match="no pixel of .* is within 1 km"):
        read_observed(write(moved), image, nearest_km=1.0)


def abi_file(image, band, values, step=28e-6):
    """An L1b file around the scene, as ABI's are, on a grid finer than the scene's (4 km)."""
    x, y = scan_angles(image["latitude"].values, image["longitude"].values, PROJECTION)
    columns = np.arange(np.nanmin(x) - 5 * step, np.nanmax(x) + 5 * step, step)
    rows = np.arange(np.nanmax(y) + 5 * step, np.nanmin(y) - 5 * step, -step)
    (r, _), (c, _) = nearest_on_axis(rows, y), nearest_on_axis(columns, x)
    distance, esun = 0.995, 2017.18
    radiance = np.zeros((rows.size, columns.size))
    radiance[r, c] = values * esun / (np.pi * distance**2)
    quality = np.zeros(radiance.shape, np.int8)
    quality[r[0, 0], c[0, 0]] = 3
    return xr.Dataset(
        {
            "Rad": (("y", "x"), radiance, {"units": "W m-2 sr-1 um-1"}),
            "DQF": (("y", "x"), quality),
            "esun": ((), esun),
            "earth_sun_distance_anomaly_in_AU": ((), distance),
            "band_id": (("band",), [int(band[1:])]),
            "goes_imager_projection": ((), 0, PROJECTION),
        },
        {"y": rows, "x": columns},
        {"time_coverage_start": "2007-10-23T18:01:17.2Z"},
    )


def test_a_place_has_the_pixel_of_an_abi_file_that_it_is_seen_in(image, write):
    own = image["reflectance_factor"]
    files = [
        *write(abi_file(image, "C02", own.sel(band="C02").values), "C02.nc"),
        *write(abi_file(image, "C01", own.sel(band="C01").values), "C01.nc"),
    ]
    seen = read_observed(files, image)
    assert list(seen["band"].values) == ["C01", "C02"]
    difference = np.abs(seen["reflectance_factor"].values - own.sel(band=["C01", "C02"]).values)
    assert np.isnan(difference[:, 0, 0]).all()  # of quality "no value"
    assert np.nanmax(difference) < 1e-12
    assert seen.attrs["observed_time"] == "2007-10-23T18:01:17"


def test_another_satellite_is_refused(image, write, tmp_path):
    """Of which a file says by its grid where it stands, and a result by its attributes."""
    east = image.assign_attrs(satellite="GOES-16", satellite_longitude=-75.2)
    west = image.assign_attrs(satellite="GOES-18", satellite_longitude=-137.0)
    own = image["reflectance_factor"].sel(band="C02").values
    files = write(abi_file(image, "C02", own), "abi.nc")
    assert np.isfinite(read_observed(files, east)["reflectance_factor"]).any()  # nominally at -75
    with pytest.raises(InputError, match="at longitude -75 and .* GOES-18 at -137, under other"):
        read_observed(files, west)
    path, times = tmp_path / "west.nc", np.atleast_1d(image["time"].values)
    with ResultWriter(path, times=times, shape=(3, 8), attributes=dict(west.attrs)) as writer:
        writer.write(0, slice(0, 3), image.drop_vars("time"))
    assert read_observed([path], west).sizes["band"] == 3
    with pytest.raises(InputError, match="at longitude -137 and .* GOES-16 at -75.2, under"):
        read_observed([path], east.drop_attrs(deep=False).assign_attrs(satellite="GOES-16"))
    assert read_observed([path], image).sizes["band"] == 3  # a scene that does not say
    # Both sides of the date line are near.
    check_satellite(-179.8, image.assign_attrs(satellite_longitude=179.9), path)


def test_an_observed_pixel_counts_once(image, write):
    """A coarse observation of a fine scene is no more measurements than it has pixels."""
    coarse = named(image).isel(lat=slice(1, None, 3), lon=slice(0, None, 4))
    seen = read_observed(write(coarse), image, nearest_km=20.0)
    values, own = (x["reflectance_factor"].values for x in (seen, image))
    assert (np.isfinite(values).sum(axis=(1, 2)) == 2).all()
    np.testing.assert_array_equal(values[:, 1, [0, 4]], own[:, 1, [0, 4]])  # the nearest have it
    assert "(22 pixels of the scene left out, as nearer ones" in seen.attrs["regridding"]
    lines = report_lines(compared(image, seen))
    assert "(22 pixels of the scene left out, as nearer ones" in lines[0]
    by_angles = abi_file(image, "C02", own[1], step=300e-6)
    values = read_observed(write(by_angles, "abi.nc"), image)["reflectance_factor"].values[0]
    there = values[np.isfinite(values)]
    assert 1 < there.size == np.unique(there).size < 12


def test_the_nearest_of_several_keeps_what_was_observed():
    index = np.array([[3, 3, -1, 5], [3, 7, 7, -1]])
    apart = np.array([[2.0, 1.0, np.inf, 9.0], [3.0, 4.0, 4.0, np.nan]])
    expected = [[-1, 3, -1, 5], [-1, 7, -1, -1]]
    np.testing.assert_array_equal(once_each(index, apart), expected)


def test_files_of_abi_hold_counts_and_others_may_not(image, write, tmp_path):
    """Rounding is part of what is not known of them, band by band."""
    own = image["reflectance_factor"]
    files = [
        *write(named(image)[["C01", "latitude", "longitude"]], "C01.nc"),
        *write(abi_file(image, "C02", own.sel(band="C02").values), "C02.nc"),
    ]
    assert read_observed(files, image)["quantised"].values.tolist() == [0, 1]
    imagery = read_observed(write(named(image, "CMI_C0{}"), "CMI.nc"), image)
    assert imagery["quantised"].values.tolist() == [1, 1, 1]
    for counts in (0, 1):
        path, times = tmp_path / f"{counts}.nc", np.atleast_1d(image["time"].values)
        with ResultWriter(
            path, times=times, shape=(3, 8), attributes={"quantised": counts}
        ) as writer:
            writer.write(0, slice(0, 3), image.drop_vars("time"))
        assert (read_observed([path], image)["quantised"] == counts).all()


def test_scan_angles_are_those_of_the_users_guide():
    """The example of its section 5.1.2.8.2, and a place that is out of sight."""
    projection = PROJECTION | {"semi_minor_axis": 6356752.31414}
    x, y = scan_angles(np.array([33.846162, 0.0]), np.array([-84.690932, 100.0]), projection)
    np.testing.assert_allclose([x[0], y[0]], [-0.024052, 0.095340], atol=1e-6)
    assert np.isnan(x[1]) and np.isnan(y[1])


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (dict(units="%"), "has the units '%' where '1' is expected|units '%'"),
        (dict(scale=100.0), "it seems to be in per cent"),
        (dict(name="radiance{}"), "has no reflectances"),
        (dict(scale=np.nan), "has no finite value"),
    ],
)
def test_what_is_no_reflectance_is_refused(image, write, change, sentence):
    with pytest.raises(InputError, match=sentence):
        read_observed(write(named(image, **change)), image)


def test_a_file_without_places_and_bands_twice_are_refused(image, write):
    paths = write(named(image).drop_vars(["latitude", "longitude"]), "a.nc")
    with pytest.raises(InputError, match="cannot be laid on the scene"):
        read_observed(paths, image)
    paths = [*write(named(image), "b.nc"), *write(named(image), "c.nc")]
    with pytest.raises(InputError, match="C01, C02, C03 was observed by more than one"):
        read_observed(paths, image)
    with pytest.raises(InputError, match="C06 is not in both"):
        bands_in_common(image, read_observed(paths[:1], image), ["C06"])


def test_neighbours_are_as_far_apart_as_the_sphere_has_it(image):
    expected = np.radians(0.043) * np.cos(np.radians(33.036)) * 6371
    own = image["latitude"].values, image["longitude"].values
    assert abs(spacing_km(*own) / expected - 1) < 1e-6


@pytest.mark.parametrize("rows", [slice(None), slice(0, 1)])
def test_a_scene_may_be_one_column_wide_or_one_pixel(image, write, rows):
    narrow = image.isel(x=slice(3, 4), y=rows)
    file = named(narrow)
    seen = read_observed(write(file), narrow)
    np.testing.assert_array_equal(seen["reflectance_factor"], narrow["reflectance_factor"])
    file["latitude"] = file["latitude"] + 0.01
    with pytest.raises(InputError, match="1.11 km away"):
        read_observed(write(file, "moved.nc"), narrow)
