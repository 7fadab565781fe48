"""The maps of WRF's grids, against PROJ."""

import numpy as np
import pytest
import xarray as xr
from conventions import complaints

from abi_operator.files import ResultWriter
from abi_operator.files.projection import projected

PROJ = "+R=6370000 +units=m +no_defs"
MAPS = {
    # Name: the attributes of a file, PROJ's words for the same, and corner and spacing of a grid.
    "lambert": (
        {"MAP_PROJ": 1, "TRUELAT1": 30.0, "TRUELAT2": 60.0, "STAND_LON": -98.0, "CEN_LAT": 40.0},
        "+proj=lcc +lat_1=30 +lat_2=60 +lon_0=-98 +lat_0=40",
        (-1.5e6, -0.6e6, 12e3),
    ),
    "lambert, one true latitude, in the south": (
        {"MAP_PROJ": 1, "TRUELAT1": -35.0, "TRUELAT2": -35.0, "STAND_LON": 175.0, "CEN_LAT": -41.0},
        "+proj=lcc +lat_1=-35 +lat_2=-35 +lon_0=175 +lat_0=-41",
        (0.2e6, -0.1e6, 9e3),  # across the date line
    ),
    "north pole": (
        {"MAP_PROJ": 2, "TRUELAT1": 60.0, "TRUELAT2": 60.0, "STAND_LON": -150.0},
        "+proj=stere +lat_0=90 +lat_ts=60 +lon_0=-150",
        (-0.3e6, -2.5e6, 20e3),
    ),
    "south pole": (
        {"MAP_PROJ": 2, "TRUELAT1": -71.0, "STAND_LON": 0.0},
        "+proj=stere +lat_0=-90 +lat_ts=-71 +lon_0=0",
        (-2.5e6, 0.4e6, 20e3),
    ),
    "mercator": (
        {"MAP_PROJ": 3, "TRUELAT1": 20.0, "STAND_LON": 170.0},
        "+proj=merc +lat_ts=20 +lon_0=170",
        (0.5e6, -0.3e6, 25e3),  # across the date line
    ),
}


def place_of(words, corner, shape=(6, 9), **attributes):
    """Positions of a grid, in float32 as WRF writes them, and where PROJ has it."""
    proj = pytest.importorskip("pyproj").Proj(f"{words} {PROJ}")
    x, y = (start + corner[2] * np.arange(n) for start, n in zip(corner, shape[::-1], strict=False))
    longitude, latitude = proj(*np.meshgrid(x, y), inverse=True)
    fields = {"latitude": latitude, "longitude": longitude}
    variables = {n: (("y", "x"), v.astype(np.float32).astype(float)) for n, v in fields.items()}
    return xr.Dataset(variables, attrs=attributes), x, y


@pytest.mark.parametrize("name", MAPS)
def test_x_and_y_are_those_of_the_map(name):
    attributes, words, corner = MAPS[name]
    place, x, y = place_of(words, corner, **attributes)
    grid = projected(place)
    np.testing.assert_allclose(grid["x"], x, atol=3.0)  # [m]; the file's positions are float32
    np.testing.assert_allclose(grid["y"], y, atol=3.0)
    assert grid["x"].attrs["standard_name"] == "projection_x_coordinate"
    assert grid["x"].attrs["units"] == "m" and grid["y"].attrs["axis"] == "Y"


@pytest.mark.parametrize("name", MAPS)
def test_the_grid_mapping_says_so_in_the_words_of_cf(name):
    attributes, words, corner = MAPS[name]
    place, x, y = place_of(words, corner, **attributes)
    pyproj = pytest.importorskip("pyproj")
    crs = pyproj.CRS.from_cf(projected(place)["crs"].attrs)
    there = pyproj.Transformer.from_crs(crs.geodetic_crs, crs, always_xy=True).transform(
        place["longitude"].values, place["latitude"].values
    )
    apart = there[0] - x, there[1] - y[:, None]
    if (
        name == "mercator"
    ):  # PROJ returns to the other end of the map at 180 degrees from its middle
        circle = 2 * np.pi * 6.37e6 * np.cos(np.radians(20))
        apart = (apart[0] + circle / 2) % circle - circle / 2, apart[1]
    np.testing.assert_allclose(apart, 0, atol=3.0)


def test_degrees_are_their_own_map(tmp_path):
    longitude, latitude = np.meshgrid(np.arange(178.0, 183.0), np.arange(-2.0, 2.0))
    fields = {"latitude": latitude, "longitude": (longitude + 180) % 360 - 180}
    place = xr.Dataset({n: (("y", "x"), v) for n, v in fields.items()}, attrs={"MAP_PROJ": 6})
    grid = projected(place)
    assert grid["crs"].attrs["grid_mapping_name"] == "latitude_longitude"
    np.testing.assert_allclose(np.diff(grid["x"]), 1.0)
    np.testing.assert_allclose(grid["y"], [-2.0, -1.0, 0.0, 1.0], atol=1e-9)
    assert grid["x"].attrs["units"] == "degrees_east"
    assert projected(place.assign_attrs(POLE_LAT=40.0)) is None
    flag = ("y", "x"), np.zeros((4, 5), np.uint8)
    result = place.assign(quality_flag=flag).assign_coords(band=["C02"]).set_coords(list(fields))
    times = np.array(["2007-10-23T18:00"], "datetime64[ns]")
    with ResultWriter(tmp_path / "a.nc", times=times, shape=(4, 5), grid=grid) as writer:
        writer.write(0, slice(0, 4), result)
    assert complaints(tmp_path / "a.nc") == []


def test_what_is_no_regular_grid_on_its_map_has_no_map():
    attributes, words, corner = MAPS["lambert"]
    place, _, _ = place_of(words, corner, **attributes)
    for wrong in ({"MAP_PROJ": 3}, {"MAP_PROJ": 0}, {"STAND_LON": -90.0}):
        assert projected(place.assign_attrs(wrong)) is None
    del place.attrs["STAND_LON"]
    assert projected(place) is None
