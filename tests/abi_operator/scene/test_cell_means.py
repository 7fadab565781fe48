"""Means over a model's cells, against a search for the cell of each centre by itself."""

import numpy as np
import pytest
import xarray as xr

from abi_operator.files import cell_bounds as bounds_module
from abi_operator.scene import cell_means as module
from abi_operator.scene.cell_means import cell_means

STEP = 0.031


def make_map(rng, missing=0.0, north_first=False, num_bands=2):
    """A map of random values, of 100 x 120 cells of 0.031 degrees from 10 N, 20 E."""
    latitude, longitude = 10 + STEP * np.arange(100), 20 + STEP * np.arange(120)
    values = rng.uniform(0, 1, (num_bands, 100, 120))
    values[rng.uniform(size=values.shape) < missing] = np.nan
    made = xr.DataArray(
        values,
        {"band": np.arange(num_bands), "lat": latitude, "lon": longitude},
        ("band", "lat", "lon"),
    )
    return made.isel(lat=slice(None, None, -1)) if north_first else made


def make_bounds(angle=0.4, step=0.3, bent=0.0, shape=(6, 7)):
    """Corners of cells of 0.3 degrees, turned and bent, in the middle of the map."""
    y, x = np.meshgrid(*[step * (np.arange(n) - n / 2) for n in shape], indexing="ij")
    x, y = x + bent * y**2, y + bent * x**2
    latitude = 11.6 + np.cos(angle) * y + np.sin(angle) * x
    longitude = 21.9 + np.cos(angle) * x - np.sin(angle) * y
    return bounds_module.cell_bounds(latitude, longitude)


def inside(latitude, longitude, corners):
    """Whether points are in a convex cell whose corners go round counter-clockwise."""
    holds = np.full(latitude.shape, True)
    for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        across = (other[1] - one[1]) * (latitude - one[0])
        holds &= across - (other[0] - one[0]) * (longitude - one[1]) > 0
    return holds


def searched(map_, bounds):
    """Mean and number of the map's cells in each model cell."""
    latitude, longitude = np.meshgrid(map_["lat"], map_["lon"], indexing="ij")
    shape = bounds[0].shape[:2]
    mean, number = np.full((map_.sizes["band"], *shape), np.nan), np.zeros(shape, int)
    for place in np.ndindex(shape):
        corners = np.stack([bounds[0][place], bounds[1][place]], axis=-1)
        chosen = inside(latitude, longitude, corners)
        number[place] = chosen.sum()
        mean[:, *place] = map_.values[:, chosen].mean(axis=1)
    return mean, number


@pytest.mark.parametrize("angle", [0.0, 0.4, -1.3, 2.5])
@pytest.mark.parametrize("north_first", [False, True])
def test_means_are_those_of_the_centres_inside(angle, north_first):
    map_ = make_map(np.random.default_rng(3), north_first=north_first)
    bounds = make_bounds(angle, bent=0.05)
    found = cell_means(map_, *bounds)
    mean, number = searched(map_, bounds)
    np.testing.assert_array_equal(found.num_cells, number)
    assert number.min() > 60
    np.testing.assert_allclose(found.mean, mean, rtol=1e-12)
    assert (found.num_missing == 0).all()


def test_every_centre_is_in_one_cell():
    """Also those on the edges: model cells as the map's own blocks of 4 x 4, through centres."""
    map_ = make_map(np.random.default_rng(3))
    edges = np.arange(0, 100, 4)
    latitude, longitude = map_["lat"].values[edges], map_["lon"].values[edges]
    lat, lon = np.meshgrid(latitude, longitude, indexing="ij")
    corners = [
        np.stack([x[:-1, :-1], x[:-1, 1:], x[1:, 1:], x[1:, :-1]], axis=-1) for x in (lat, lon)
    ]
    found = cell_means(map_, *corners)
    assert (found.num_cells == 16).all()
    blocks = map_.values[:, :96, :96].reshape(2, 24, 4, 24, 4)
    np.testing.assert_allclose(found.mean, blocks.mean(axis=(2, 4)), rtol=1e-12)


def test_portions_do_not_matter(monkeypatch):
    map_, bounds = make_map(np.random.default_rng(3), missing=0.2), make_bounds()
    whole = cell_means(map_, *bounds)
    monkeypatch.setattr(module, "_PAIRS", 40)
    for one, other in zip(whole, cell_means(map_, *bounds), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)


def test_missing_cells_are_left_out_of_the_mean():
    map_, bounds = make_map(np.random.default_rng(3)), make_bounds()
    complete, number = cell_means(map_, *bounds), 0
    values = map_.values.copy()
    values[0][np.random.default_rng(4).uniform(size=values[0].shape) < 0.1] = np.nan
    found = cell_means(map_.copy(data=values), *bounds)
    number = found.num_missing
    assert 0 < number.sum() < 0.2 * found.num_cells.sum()
    np.testing.assert_array_equal(found.mean[1], complete.mean[1])
    differs = found.mean[0] != complete.mean[0]
    np.testing.assert_array_equal(differs, number > 0)
    np.testing.assert_allclose(found.mean[0], complete.mean[0], atol=0.06)


@pytest.mark.parametrize(("num_missing", "has_mean"), [(0, True), (8, True), (9, False)])
def test_half_of_the_cells_must_have_a_value(num_missing, has_mean):
    values = np.full((1, 4, 4), 0.3)
    values[0].flat[:num_missing] = np.nan
    axes = {"band": ["C01"], "lat": np.arange(4.0), "lon": np.arange(4.0)}
    map_ = xr.DataArray(values, axes, ("band", "lat", "lon"))
    corners = np.array([[[-0.5, -0.5, 3.5, 3.5]]]), np.array([[[-0.5, 3.5, 3.5, -0.5]]])
    found = cell_means(map_, *corners)
    assert (found.num_cells[0, 0], found.num_missing[0, 0]) == (16, num_missing)
    np.testing.assert_allclose(found.mean[0, 0, 0], 0.3 if has_mean else np.nan)


def test_cells_beside_the_map_hold_nothing():
    map_, bounds = make_map(np.random.default_rng(3)), make_bounds()
    found = cell_means(map_, bounds[0] + 20, bounds[1])
    assert (found.num_cells == 0).all() and np.isnan(found.mean).all()
    found = cell_means(map_, bounds[0], bounds[1] + 20)
    assert (found.num_cells == 0).all() and np.isnan(found.mean).all()


@pytest.mark.parametrize(("step", "larger"), [(0.9, False), (1.2, False), (1.3, True), (4.0, True)])
def test_cells_are_larger_by_area(step, larger):
    """Sides in cells of the map; 1.2 times 1.2 is less than 1.5."""
    map_ = make_map(np.random.default_rng(3))
    found = cell_means(map_, *make_bounds(step=step * STEP))
    assert found.larger.all() if larger else not found.larger.any()


def test_a_cell_about_a_pole_is_not_averaged():
    x, y = np.meshgrid([-2.0, -1.0, 0.0, 1.0, 2.0], [-2.0, -1.0, 0.0, 1.0, 2.0])
    bounds = bounds_module.cell_bounds(90 - np.hypot(x, y), np.degrees(np.arctan2(y, x)))
    axes = {"band": ["C01"], "lat": np.arange(85.05, 90, 0.1), "lon": np.arange(-179.5, 180)}
    found = cell_means(
        xr.DataArray(np.full((1, 50, 360), 0.8), axes, ("band", "lat", "lon")), *bounds
    )
    assert not found.larger[2, 2] and found.larger[0, 0]
    np.testing.assert_allclose(found.mean[0, 0, 0], 0.8)
