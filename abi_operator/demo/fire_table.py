"""The fires below the smoke, as a table that `files.read_fires` reads.

Each burns along a front across the wind that is a few kilometres long, as spots of flames a
kilometre apart, so that a coarse grid has one hot pixel of it and a fine one a line of them.
"""

import csv
from pathlib import Path

import numpy as np

from .grid import latitude_longitude
from .landscape import coast_axes
from .plume_picture import Smoke

# Of the flames [K], and what burns of the strongest fire's front [m2].
_TEMPERATURE = 900.0
_AREA = 2.4e5
# Places of the spots along the front. [m]
_FRONT = np.linspace(-2e3, 2e3, 5)


def write_fires(path: Path, smoke: Smoke) -> None:
    """Write latitude, longitude [degree], temperature [K] and burning area [m2] of all spots."""
    inland, along = coast_axes(smoke.east, smoke.north)
    along = along[:, None] + _FRONT
    east, north = coast_axes(np.broadcast_to(inland[:, None], along.shape), along)
    latitude, longitude = latitude_longitude(east, north)
    area = np.broadcast_to((_AREA * smoke.strength / len(_FRONT))[:, None], along.shape)
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(["latitude", "longitude", "temperature", "area"])
        for lat, lon, square in zip(latitude.flat, longitude.flat, area.flat, strict=True):
            table.writerow([f"{lat:.5f}", f"{lon:.5f}", f"{_TEMPERATURE:g}", f"{square:g}"])
