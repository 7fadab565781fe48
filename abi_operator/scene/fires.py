"""Fires in the columns of a scene: which share of each burns, and how hot.

A fire is smaller than a column and burns in the one in whose cell it lies. A column has one fire:
of several that share a cell the burning ground is added, and the temperature is the one at which
together they give off as much as they do,

.. math:: p = \\sum_i A_i / A, \\qquad T^4 = \\sum_i A_i T_i^4 / \\sum_i A_i.

That conserves the emitted power, and not the radiance of a band: in C07 a fire of 600 K beside as
much of 1000 K is 9 % too bright, which is why it is told how often that happens.
"""

import warnings
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..files import InputError
from ..files.cell_bounds import cell_bounds
from ..radiance import FIRE_BANDS
from .account import Attribute

# Mean radius of the earth. [m]
_EARTH_RADIUS = 6.371e6
# Pairs of a fire and a cell in memory at a time.
_PAIRS = 1 << 20
_BOUNDS = "latitude_bounds", "longitude_bounds"


class BurningColumns(NamedTuple):
    """Fires of the columns (y, x) of a scene.

    Parameters
    ----------
    fraction
        Share of the ground that burns. [-]
    temperature
        Of the flames, NaN where nothing burns. [K]
    num_fires, num_joined
        Fires in these columns, and of them those that share one with others. [-]
    """

    fraction: np.ndarray
    temperature: np.ndarray
    num_fires: int
    num_joined: int

    @property
    def attributes(self) -> dict[str, Attribute]:
        """What a scene tells of them (`account.add_accounts`)."""
        return {
            "fire_count": self.num_fires,
            "fires_joined_count": self.num_joined,
            "burning_columns_count": int(np.count_nonzero(self.fraction)),
        }


def fires_inside(fires: xr.Dataset, place: xr.Dataset) -> np.ndarray:
    """Which fires lie in a scene (fire).

    Parameters
    ----------
    fires
        As `files.read_fires` returns them.
    place
        With ``latitude`` and ``longitude`` (y, x) of all columns. [degree]

    Raises
    ------
    InputError
        Where a scene of one row or column tells no cells' corners.
    """
    if min(place["latitude"].shape) < 2:
        raise InputError(
            "fires need the corners of the model's cells, which only a scene of two rows and "
            "columns or more tells."
        )
    bounds = cell_bounds(place["latitude"].values, place["longitude"].values)
    return _cell_of(fires, *bounds) >= 0


def check_fires(inside: np.ndarray, bands: tuple[str, ...]) -> None:
    """Raise `InputError` where no fire can be seen in a scene; warn of those that lie outside it.

    Parameters
    ----------
    inside
        Which fires lie in the scene (fire), at any time.
    bands
        Bands to be simulated.
    """
    if not set(bands) & set(FIRE_BANDS):
        raise InputError(
            f"fires shine in {', '.join(FIRE_BANDS)}; simulate one of these, or leave fires out."
        )
    outside = np.count_nonzero(~inside)
    if outside == inside.size:
        raise InputError(
            f"none of the {outside} fires lies in the scene; check their latitudes and longitudes, "
            "in degrees north and east."
        )
    if outside:
        warnings.warn(
            f"{outside} of {inside.size} fires lie outside the scene.", UserWarning, stacklevel=2
        )


def burning_columns(model: xr.Dataset, fires: xr.Dataset, first_row: int = 0) -> BurningColumns:
    """Fires that burn in the columns of a model at its time.

    Parameters
    ----------
    model
        One time of a model Dataset, whole or a block of rows, with its cells' corners.
    fires
        As `files.read_fires` returns them.
    first_row
        Row of the scene at which this block begins; a message counts from there. [-]

    Raises
    ------
    InputError
        Where the model lacks corners, or where more burns than a cell has ground.
    """
    time, shape = model["time"].values, (model.sizes["y"], model.sizes["x"])
    # Comparisons with a time that is not given (NaT) are False.
    burning = ~(fires["start"].values > time) & ~(fires["end"].values <= time)
    missing = [name for name in _BOUNDS if name not in model]
    if missing:
        raise InputError(
            f"fires need the corners of the model's cells ({', '.join(missing)}), which "
            "`files.read_wrf` has of two rows and columns or more."
        )
    bounds = [model[name].values for name in _BOUNDS]
    cell = np.where(burning, _cell_of(fires, *bounds), -1)
    index = cell[cell >= 0]
    area, temperature = (fires[name].values[cell >= 0] for name in ("area", "temperature"))
    count, burnt, power = (
        np.bincount(index, weights, int(np.prod(shape)))
        for weights in (None, area, area * temperature**4)
    )
    fraction = burnt / _area(*(x.reshape(-1, 4) for x in bounds))
    too_much = np.flatnonzero(fraction > 1)
    if too_much.size:
        y, x = np.unravel_index(too_much[0], shape)
        ground = burnt[too_much[0]] / fraction[too_much[0]]
        raise InputError(
            f"{burnt[too_much[0]]:.3g} m2 burn in the column at y={y + first_row}, x={x}, which "
            f"has {ground:.3g} m2; give the area that burns, not that of the fire's outline."
        )
    hot = np.where(burnt > 0, power / np.where(burnt > 0, burnt, 1.0), np.nan) ** 0.25
    joined = int(count[count > 1].sum())
    return BurningColumns(fraction.reshape(shape), hot.reshape(shape), index.size, joined)


def _cell_of(
    fires: xr.Dataset, latitude_bounds: np.ndarray, longitude_bounds: np.ndarray
) -> np.ndarray:
    """Number of the cell in which each fire lies, y by x, or -1. [-]

    A fire on the edge between two cells is in one of them: an edge is asked in the same way from
    both sides, whether it is crossed on the way to the east.
    """
    corners = latitude_bounds.reshape(-1, 4), longitude_bounds.reshape(-1, 4)
    found = np.full(fires.sizes["fire"], -1)
    portion = max(1, _PAIRS // len(corners[0]))
    for start in range(0, len(found), portion):
        some = slice(start, start + portion)
        inside = _inside(*corners, *(fires[x].values[some] for x in ("latitude", "longitude")))
        found[some] = np.where(inside.any(axis=1), inside.argmax(axis=1), -1)
    return found


def _inside(
    corner_latitude: np.ndarray, corner_longitude: np.ndarray, lat: np.ndarray, lon: np.ndarray
) -> np.ndarray:
    """Whether a place lies in a cell (place, cell), whose edges are straight on a map."""
    north = corner_latitude[None] - lat[:, None, None]
    east = (corner_longitude[None] - lon[:, None, None] + 180) % 360 - 180
    crossings = np.zeros(north.shape[:2], int)
    for k in range(4):
        one, other = ((north[..., i], east[..., i]) for i in (k - 1, k))
        # From the southern end to the northern one, whichever cell asks.
        rising = one[0] < other[0]
        y0, x0 = (np.where(rising, a, b) for a, b in zip(one, other, strict=True))
        y1, x1 = (np.where(rising, b, a) for a, b in zip(one, other, strict=True))
        crossings += ((y0 < 0) != (y1 < 0)) & (x0 * y1 - x1 * y0 > 0)
    narrow = np.ptp(east, axis=-1) < 180  # others lie on the far side of the earth
    return (crossings % 2 == 1) & narrow


def _area(latitude: np.ndarray, longitude: np.ndarray) -> np.ndarray:
    """Area of cells (cell, corner), which are small. [m2]"""
    middle = np.radians(latitude.mean(axis=1, keepdims=True))
    y = _EARTH_RADIUS * np.radians(latitude - latitude[:, :1])
    east = (longitude - longitude[:, :1] + 180) % 360 - 180
    x = _EARTH_RADIUS * np.cos(middle) * np.radians(east)
    along = x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y
    return np.abs(along.sum(axis=1)) / 2
