"""Corners of the cells of a curvilinear grid of which only the centres are known."""

import numpy as np


def cell_bounds(latitude: np.ndarray, longitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Latitudes and longitudes of the corners of cells (y, x, corner), in the order of CF. [degree]

    A corner is the mean of the four centres about it, as points of a sphere, so that neither poles
    nor the date line matter; beyond the outermost centres the grid goes on as it came. Neighbours
    have their corners in common to the last digit.

    Parameters
    ----------
    latitude, longitude
        Of the centres (y, x), two rows and two columns at least. [degree]
    """
    phi, lam = np.radians(latitude), np.radians(longitude)
    centres = np.stack([np.cos(phi) * np.cos(lam), np.cos(phi) * np.sin(lam), np.sin(phi)])
    wide = _continued(_continued(centres, axis=1), axis=2)
    x, y, z = wide[:, :-1, :-1] + wide[:, :-1, 1:] + wide[:, 1:, :-1] + wide[:, 1:, 1:]
    corner_latitude = np.degrees(np.arctan2(z, np.hypot(x, y)))
    corner_longitude = np.degrees(np.arctan2(y, x))
    return _around(corner_latitude), _around(corner_longitude)


def _continued(values: np.ndarray, axis: int) -> np.ndarray:
    """The same with one more value at both ends of an axis, in line with the two before."""
    first, second = values.take([0], axis), values.take([1], axis)
    last, last_but_one = values.take([-1], axis), values.take([-2], axis)
    return np.concatenate([2 * first - second, values, 2 * last - last_but_one], axis)


def _around(corners: np.ndarray) -> np.ndarray:
    """Corners (y + 1, x + 1) by cell (y, x, corner), round it and not crosswise."""
    return np.stack(
        [corners[:-1, :-1], corners[:-1, 1:], corners[1:, 1:], corners[1:, :-1]], axis=-1
    )
