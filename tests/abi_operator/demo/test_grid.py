"""The demonstration's map."""

import numpy as np

from abi_operator.demo.grid import east_north, latitude_longitude, make_grid
from abi_operator.demo.landscape import coast_axes

ROUNDING = 1e-12


def test_map_and_globe_agree_both_ways():
    grid = make_grid(9)
    latitude, longitude = latitude_longitude(grid.east, grid.north)
    east, north = east_north(latitude, longitude)
    np.testing.assert_allclose(east, grid.east, atol=ROUNDING * 1e9)
    np.testing.assert_allclose(north, grid.north, atol=ROUNDING * 1e9)


def test_centre_is_the_centre_and_rows_go_north():
    grid = make_grid(9)
    latitude, longitude = latitude_longitude(grid.east, grid.north)
    np.testing.assert_allclose([latitude[4, 4], longitude[4, 4]], [33.5, -117.5], rtol=ROUNDING)
    assert (np.diff(latitude, axis=0) > 0).all()
    assert (np.diff(longitude, axis=1) > 0).all()


def test_axes_along_the_coast_are_their_own_inverse():
    """So that fires lie at the heads of the plumes that the picture has."""
    grid = make_grid(9)
    there_and_back = coast_axes(*coast_axes(grid.east, grid.north))
    np.testing.assert_allclose(there_and_back, (grid.east, grid.north), atol=ROUNDING * 1e6)
