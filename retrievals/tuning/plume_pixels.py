"""The pixels of a plume that are looked at together, block by block so that few are in memory."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from abi_operator import State
from abi_operator.instrument import Imager
from abi_operator.radiance import FIRE_BANDS
from abi_operator.scene import states_of_result

from ..observation import noise_sigma

BLOCK = 8192
"""Pixels whose columns are in memory at a time. [-]"""


@dataclass(frozen=True)
class PlumePixels:
    """Pixels in a row, and what was observed of them.

    Parameters
    ----------
    image
        The scene's result, of one time.
    y, x
        Indices of the pixels.
    bands
        Bands that are looked at.
    measured
        Observed reflectance factors (pixel, band), NaN where there is none that counts. [-]
    quantised
        Which of the bands were observed as counts, so that rounding is part of their errors.
    """

    image: xr.Dataset
    y: np.ndarray
    x: np.ndarray
    bands: tuple[str, ...]
    measured: np.ndarray
    quantised: tuple[bool, ...]

    @property
    def counts(self) -> np.ndarray:
        """Which measurements count (pixel, band)."""
        return np.isfinite(self.measured)

    def blocks(self) -> Iterator[tuple[slice, State]]:
        """Rows of each block, and their columns, without fires: where one shines nothing counts."""
        for start in range(0, len(self.y), BLOCK):
            rows = slice(start, min(start + BLOCK, len(self.y)))
            y, x = (xr.DataArray(index[rows], dims="column") for index in (self.y, self.x))
            states = states_of_result(self.image.isel(y=y, x=x), self.bands)
            yield rows, replace(states, fire=None)

    def thinned(self, count: int) -> "PlumePixels":
        """So many of the pixels where something counts, evenly, or all if there are fewer."""
        rows = np.flatnonzero(self.counts.any(axis=1))
        if rows.size > count:
            rows = rows[np.linspace(0, rows.size - 1, count).astype(int)]
        return replace(self, y=self.y[rows], x=self.x[rows], measured=self.measured[rows])

    def on_map(self, values: np.ndarray) -> np.ndarray:
        """Numbers of the pixels (pixel, band) as maps (band, y, x), NaN elsewhere."""
        maps = np.full((values.shape[1], self.image.sizes["y"], self.image.sizes["x"]), np.nan)
        maps[:, self.y, self.x] = values.T
        return maps


def plume_pixels(
    image: xr.Dataset,
    observed: xr.Dataset,
    inside: np.ndarray,
    counted: np.ndarray,
    bands: tuple[str, ...],
) -> PlumePixels:
    """The pixels of a plume with what was observed there.

    Parameters
    ----------
    image, observed
        The scene's result of one time, and what was observed of it.
    inside
        Pixels of the plume that the sun shines on (y, x).
    counted
        Those of them by which the plume may be judged (y, x). What is saturated does not count, nor
        what a fire of the scene shines in.
    bands
        Bands that both have.
    """
    y, x = np.nonzero(inside)
    measured = observed["reflectance_factor"].sel(band=list(bands)).transpose("band", "y", "x")
    saturated = observed["saturated"].sel(band=list(bands)).transpose("band", "y", "x")
    values = np.where((saturated.values == 0) & counted, measured.values, np.nan)
    values = np.where(lit_by_fires(image, bands), np.nan, values)
    counts = [False] * len(bands)
    if "quantised" in observed:
        counts = [bool(one) for one in observed["quantised"].sel(band=list(bands)).values]
    return PlumePixels(image, y, x, bands, values[:, y, x].T.astype(np.float64), tuple(counts))


def lit_by_fires(image: xr.Dataset, bands: Sequence[str]) -> np.ndarray:
    """Where and in which bands a fire of the scene shines (band, y, x): no fit predicts that."""
    shines = np.array([band in FIRE_BANDS for band in bands])[:, None, None]
    if "fire_fraction" not in image:
        return shines & np.zeros((image.sizes["y"], image.sizes["x"]), bool)
    return shines & (image["fire_fraction"].values > 0)


def error_of(
    predicted: np.ndarray,
    bands: Sequence[str],
    imagers: Sequence[Imager],
    forward_error: float,
) -> np.ndarray:
    """Standard deviation of what is measured of a prediction (pixel, band). [-]

    The instrument's noise at the prediction, as that at the measurement would be small where noise
    made the measurement small, with what rounding to counts takes off, and the forward model's own
    relative error.

    Parameters
    ----------
    predicted
        Reflectance factors (pixel, band). [-]
    bands, imagers
        Names of the bands, and the instrument as it observed each of them.
    forward_error
        Relative standard deviation of the forward model. [-]
    """
    each = zip(bands, imagers, strict=True)
    noise = [noise_sigma(predicted[:, i], band, imager) for i, (band, imager) in enumerate(each)]
    return np.hypot(np.stack(noise, axis=-1), forward_error * predicted)
