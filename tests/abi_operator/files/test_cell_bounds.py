"""Corners of cells of which the centres are known."""

import numpy as np
import pytest

from abi_operator.files.cell_bounds import cell_bounds


def grid(latitude, longitude, step=0.5):
    """Centres and corners of 3 x 4 cells of so many degrees, south-western centre first."""
    rows, columns = np.arange(3), np.arange(4)
    centres = np.meshgrid(latitude + step * rows, longitude + step * columns, indexing="ij")
    half = step / 2
    south, west = centres[0] - half, centres[1] - half
    corners = (
        np.stack([south, south, south + step, south + step], axis=-1),
        np.stack([west, west + step, west + step, west], axis=-1),
    )
    return centres, corners


# Great circles leave parallels by this much over half a cell at 60 degrees. [degree]
BENT = 2e-3


@pytest.mark.parametrize(("latitude", "longitude"), [(0.0, 10.0), (-60.0, 20.0), (33.0, 179.5)])
def test_corners_are_midway(latitude, longitude):
    centres, expected = grid(latitude, longitude)
    found = cell_bounds(*centres)
    np.testing.assert_allclose(found[0], expected[0], atol=BENT)
    apart = (found[1] - expected[1] + 180) % 360 - 180
    np.testing.assert_allclose(apart, 0, atol=2 * BENT)


def test_neighbours_share_their_corners():
    rng = np.random.default_rng(1)
    centres, _ = grid(40.0, 100.0)
    bent = [values + rng.uniform(-0.1, 0.1, values.shape) for values in centres]
    for corners in cell_bounds(*bent):
        np.testing.assert_array_equal(corners[:, :-1, 1], corners[:, 1:, 0])
        np.testing.assert_array_equal(corners[:, :-1, 2], corners[:, 1:, 3])
        np.testing.assert_array_equal(corners[:-1, :, 3], corners[1:, :, 0])
        np.testing.assert_array_equal(corners[:-1, :, 2], corners[1:, :, 1])


def test_a_pole_is_a_place_like_others():
    """Centres on a square about the north pole, as a polar-stereographic model has them."""
    x, y = np.meshgrid([-1.5, -0.5, 0.5, 1.5], [-1.5, -0.5, 0.5, 1.5])
    latitude, longitude = 90 - np.hypot(x, y), np.degrees(np.arctan2(y, x))
    corner_latitude, _ = cell_bounds(latitude, longitude)
    np.testing.assert_allclose(corner_latitude[1, 1, 2], 90.0, atol=1e-10)
    np.testing.assert_allclose(corner_latitude[1, 1, 0], 90 - np.sqrt(2), atol=1e-3)
