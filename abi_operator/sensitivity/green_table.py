"""Green by look-up in a table of samples, where recipes are straight lines."""

from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import distance_transform_edt

CELL = 0.02
"""Width of a cell of the table in each band. [-]"""


class GreenTable(NamedTuple):
    """Mean reflectance at 0.555 um in cells of the reflectances in C02, C01 and C03.

    What such a table does with the near infrared is what its samples do, and it is no straight
    line: whoever brightens C03 alone asks it for a colour that none of them may have.

    Parameters
    ----------
    centres
        Of the cells along C02, C01 and C03. [-]
    green
        Mean of the samples in each cell; in cells without any, that of the nearest cell with some.
        [-]
    samples
        Number of samples in each cell. [-]
    """

    centres: tuple[np.ndarray, np.ndarray, np.ndarray]
    green: np.ndarray
    samples: np.ndarray

    def __call__(self, red: np.ndarray, blue: np.ndarray, near_infrared: np.ndarray) -> np.ndarray:
        """Green between the cells, linear in each band, and that of the edge beyond it. [-]"""
        points = [
            np.clip(x, centre[0], centre[-1])
            for x, centre in zip((red, blue, near_infrared), self.centres, strict=True)
        ]
        return RegularGridInterpolator(self.centres, self.green)(np.stack(points, axis=-1))


def green_table(
    red: np.ndarray, blue: np.ndarray, near_infrared: np.ndarray, green: np.ndarray
) -> GreenTable:
    """Make a table of samples.

    Parameters
    ----------
    red, blue, near_infrared, green
        Bidirectional reflectance factors in C02, C01, C03 and at 0.555 um of the same places, of
        any shape; those with NaN are left out. [-]

    Raises
    ------
    ValueError
        Where no sample is left.
    """
    samples = np.stack([np.ravel(x) for x in (red, blue, near_infrared, green)])
    samples = samples[:, np.isfinite(samples).all(axis=0)]
    if not samples.size:
        raise ValueError("a table of green needs samples; none of them is finite.")
    cells = np.floor(samples[:3] / CELL).astype(int)
    first = cells.min(axis=1, keepdims=True)
    # Two cells at least along each band, between which to interpolate.
    shape = tuple(np.maximum((cells - first).max(axis=1) + 1, 2))
    place = np.ravel_multi_index(tuple(cells - first), shape)
    size = int(np.prod(shape))
    count = np.bincount(place, minlength=size).reshape(shape)
    total = np.bincount(place, samples[3], size).reshape(shape)
    nearest: Any = distance_transform_edt(count == 0, return_distances=False, return_indices=True)
    mean = total / np.maximum(count, 1)
    centres = [CELL * (first[k, 0] + np.arange(shape[k]) + 0.5) for k in range(3)]
    return GreenTable((centres[0], centres[1], centres[2]), mean[tuple(nearest)], count)
