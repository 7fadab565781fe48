"""Means of a map of fine cells over the coarser cells of a model's grid.

Along each row of the map a model cell, a quadrangle, covers the map's cells from one edge to
another, and their sum is the difference of two running sums. So the work is a model cell's rows and
not its area, and no list of cells is made.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

# A model cell has a mean where at least this share of the map's cells in it has a value. [-] (As
# MODIS's own maps of 0.05 degrees, whose quality is by what the majority of the finer cells is;
# MODIS BRDF/Albedo Product User's Guide, quality of MCD43C.)
LEAST_SHARE = 0.5
# A model cell is larger than the map's from this many of their areas on; in smaller ones the number
# of centres is a matter of luck.
LEAST_AREA = 1.5

# A cell that reaches over more longitudes lies at a pole, where edges are not straight. [degree]
_WIDEST = 90.0
# Pairs of a model cell and a row of the map in memory at a time.
_PAIRS = 1 << 18


class CellMeans(NamedTuple):
    """Means over model cells, and of how many of the map's cells.

    Parameters
    ----------
    mean
        Mean of those with a value (band, y, x), NaN where they are less than `LEAST_SHARE`.
    larger
        True where a model cell holds a centre and is larger than the map's cells (y, x), by
        `LEAST_AREA`, and does not lie at a pole: elsewhere the mean is not to be used.
    num_cells
        Cells of the map whose centres lie in a model cell (y, x), with a value or without. [-]
    num_missing
        Of them those that have no value in some band (y, x), at most. [-]
    """

    mean: np.ndarray
    larger: np.ndarray
    num_cells: np.ndarray
    num_missing: np.ndarray


def cell_means(
    albedo: xr.DataArray, latitude_bounds: np.ndarray, longitude_bounds: np.ndarray
) -> CellMeans:
    """Mean over the cells of a regular map whose centres lie in each cell of a model's grid.

    Edges of model cells are straight in latitude and longitude. A centre on an edge between two
    cells is in the one to the east or the north, so that all centres are in one cell.

    Parameters
    ----------
    albedo
        The map (band, lat, lon), axes rising or falling, of two values or more; NaN where it has
        none.
    latitude_bounds, longitude_bounds
        Corners of the model's cells (y, x, corner), longitudes counted as those of the map; see
        `files.cell_bounds`. [degree]
    """
    map_ = albedo.transpose("band", "lat", "lon")
    for axis in ("lat", "lon"):
        if map_[axis].values[0] > map_[axis].values[-1]:
            map_ = map_.isel({axis: slice(None, None, -1)})
    latitudes, longitudes = map_["lat"].values, map_["lon"].values
    corners = latitude_bounds.reshape(-1, 4), longitude_bounds.reshape(-1, 4)
    num_bands, num_columns = map_.sizes["band"], len(corners[0])
    mean = np.full((num_bands, num_columns), np.nan)
    num_cells, num_missing = np.zeros(num_columns, int), np.zeros(num_columns, int)
    for some in _portions(corners[0], latitudes):
        lat, lon = corners[0][some], corners[1][some]
        first, last = np.searchsorted(latitudes, [lat.min(), lat.max()])
        window = map_.values[:, first:last]
        row, left, right = _spans(lat, lon, latitudes[first:last], longitudes)
        num_cells[some] = (right - left).sum(axis=1)
        for index, values in enumerate(window):
            known = np.isfinite(values)
            total = _over_spans(np.where(known, values, 0.0), row, left, right)
            count = np.rint(_over_spans(known.astype(float), row, left, right))
            enough = (count > 0) & (count >= LEAST_SHARE * num_cells[some])
            mean[index, some] = np.where(enough, total / np.maximum(count, 1), np.nan)
            missing = num_cells[some] - count.astype(int)
            num_missing[some] = np.maximum(num_missing[some], missing)
    shape = latitude_bounds.shape[:2]
    one_cell = np.diff(latitudes).mean() * np.diff(longitudes).mean()
    larger = (_area(*corners) >= LEAST_AREA * one_cell) & (num_cells > 0)
    larger &= np.ptp(corners[1], axis=1) < _WIDEST
    return CellMeans(
        mean.reshape(num_bands, *shape),
        *(x.reshape(shape) for x in (larger, num_cells, num_missing)),
    )


def _area(latitude: np.ndarray, longitude: np.ndarray) -> np.ndarray:
    """Area of quadrangles, by their diagonals, (cell,). [degree2]"""
    rise, run = latitude[:, 2:] - latitude[:, :2], longitude[:, 2:] - longitude[:, :2]
    return np.abs(run[:, 0] * rise[:, 1] - run[:, 1] * rise[:, 0]) / 2


def _portions(latitude: np.ndarray, latitudes: np.ndarray) -> Iterator[slice]:
    """Runs of model cells that cover few enough rows of the map to be treated together."""
    low, high = np.searchsorted(latitudes, [latitude.min(axis=1), latitude.max(axis=1)])
    size = max(1, _PAIRS // max(1, int((high - low).max(initial=1))))
    for start in range(0, len(latitude), size):
        yield slice(start, start + size)


def _spans(
    lat: np.ndarray, lon: np.ndarray, latitudes: np.ndarray, longitudes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of the map that cross each cell (cell, row), and from where to where along them."""
    low, high = np.searchsorted(latitudes, [lat.min(axis=1), lat.max(axis=1)])
    row = low[:, None] + np.arange(max(1, int((high - low).max(initial=0))))
    inside = row < high[:, None]
    row = np.minimum(row, max(0, len(latitudes) - 1))
    here = latitudes[row] if len(latitudes) else np.zeros(row.shape)
    west, east = np.full(row.shape, np.inf), np.full(row.shape, -np.inf)
    for start in range(4):
        one, other = (start, (start + 1) % 4)
        # From south to north whichever cell asks, so that neighbours agree on the edge they share.
        south = np.where(lat[:, one] <= lat[:, other], one, other)
        north = one + other - south
        cell = np.arange(len(lat))
        lat_s, lat_n = lat[cell, south][:, None], lat[cell, north][:, None]
        lon_s, lon_n = lon[cell, south][:, None], lon[cell, north][:, None]
        crosses = (lat_s <= here) & (here < lat_n)
        rise = np.where(lat_n > lat_s, lat_n - lat_s, 1.0)
        at = lon_s + (here - lat_s) / rise * (lon_n - lon_s)
        west = np.where(crosses, np.minimum(west, at), west)
        east = np.where(crosses, np.maximum(east, at), east)
    left, right = np.searchsorted(longitudes, west), np.searchsorted(longitudes, east)
    covered = inside & (right > left)
    return row, np.where(covered, left, 0), np.where(covered, right, 0)


def _over_spans(
    values: np.ndarray, row: np.ndarray, left: np.ndarray, right: np.ndarray
) -> np.ndarray:
    """Sum over the spans of each cell of a map (lat, lon)."""
    if not values.size:
        return np.zeros(len(row))
    sums = np.concatenate([np.zeros((len(values), 1)), np.cumsum(values, axis=1)], axis=1)
    return (sums[row, right] - sums[row, left]).sum(axis=1)
