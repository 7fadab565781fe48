"""Pictures of a simulated scene, one time after the other: colours, shades of grey and heat."""

import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from .constants import STANDARD_PRESSURE
from .optics.rayleigh import STANDARD_DEPTH
from .pictures import grey, write_png
from .products import LOWEST_COSINE, natural_color, rayleigh_corrected
from .radiance import THERMAL

_COLOURS = ("C01", "C02", "C03")
_NEEDED = (
    "brf",
    "brightness_temperature",
    "rayleigh_optical_depth",
    "solar_zenith_angle",
    "view_zenith_angle",
    "relative_azimuth_angle",
)
# Brightness temperatures that are black and white in a picture. [K]
_COLD_IS_WHITE = (320.0, 220.0)


class Painter:
    """Draws a time of a scene as soon as it has its last block of rows; holds one time in memory.

    Parameters
    ----------
    folder
        Where to write the pictures.
    times
        Times of the scene. [datetime64]
    num_rows
        Rows of the scene. [-]
    rayleigh_correction
        Whether the air is taken out of natural colours (`picture_in_natural_colors`).
    """

    def __init__(
        self, folder: Path, times: np.ndarray, num_rows: int, *, rayleigh_correction: bool = True
    ) -> None:
        self.names: list[str] = []
        self._folder, self._times, self._num_rows = folder, times, num_rows
        self._rayleigh_correction = rayleigh_correction
        self._blocks: dict[int, xr.Dataset] = {}

    def add(self, time_index: int, rows: slice, result: xr.Dataset) -> None:
        """Take a block of rows of a time, all of which come before those of the next time."""
        self._blocks[rows.start] = result[[name for name in _NEEDED if name in result]]
        if sum(block.sizes["y"] for block in self._blocks.values()) < self._num_rows:
            return
        image = xr.concat([self._blocks[start] for start in sorted(self._blocks)], "y")
        self._blocks.clear()
        stamp = np.datetime_as_string(self._times[time_index], unit="s").replace(":", "")
        pictures = draw(image, rayleigh_correction=self._rayleigh_correction)
        for name, picture in pictures.items():
            self.names.append(f"{name}_{stamp}.png")
            write_png(self._folder / self.names[-1], picture)
            if np.isnan(picture).all():
                warnings.warn(
                    f"{self.names[-1]} is empty: it shows no sunlight by night, and nothing "
                    "without albedo or out of sight; quality_flag says which.",
                    stacklevel=2,
                )


def draw(image: xr.Dataset, *, rayleigh_correction: bool = True) -> dict[str, np.ndarray]:
    """Pictures (y, x, 3) of one time by name, 0 to 1, NaN where nothing was simulated. [-]

    Natural colours where C01, C02 and C03 are there, or else each of the bands of sunlight in
    shades of grey, which follow the square root of its bidirectional reflectance factor; and the
    brightness temperature of C07, of which the cold is white.
    """
    bands = [str(band) for band in image["band"].values]
    pictures = {}
    if set(_COLOURS) <= set(bands):
        pictures["natural_color"] = picture_in_natural_colors(
            image, rayleigh_correction=rayleigh_correction
        )
    else:
        for band in (band for band in bands if band not in THERMAL):
            brf = image["brf"].sel(band=band).values
            pictures[band] = grey(np.sqrt(np.maximum(brf, 0)), 0.0, 1.0)
    if "brightness_temperature" in image:
        pictures["C07"] = grey(image["brightness_temperature"].values, *_COLD_IS_WHITE)
    return pictures


def picture_in_natural_colors(image: xr.Dataset, *, rayleigh_correction: bool = True) -> np.ndarray:
    """Red, green and blue of one time, with or without the air.

    The air is that above each column's own ground, and it is taken out before green is derived, as
    the recipe for green is one for albedos: of a sea of 0.03 in all bands it makes 0.025, and of
    light at the top of the atmosphere 0.048, which is a green sea. The correction is tabulated up
    to zenith angles of 84 degrees; where sun or satellite are lower, that of 84 degrees is taken,
    which leaves some of the air in the picture.
    """
    brf = {band: image["brf"].sel(band=band).values for band in _COLOURS}
    correction = _air_taken_out(image) if rayleigh_correction else None
    return np.asarray(natural_color(brf, correction=correction, order="correct_first"))


def _air_taken_out(image: xr.Dataset) -> Callable[[str, Any], Any]:
    depth = image["rayleigh_optical_depth"].sel(band=_COLOURS[0]).values
    cosines = {
        name: np.maximum(np.cos(np.radians(image[f"{angle}_zenith_angle"].values)), LOWEST_COSINE)
        for name, angle in (("mu0", "solar"), ("mu", "view"))
    }
    return partial(
        rayleigh_corrected,
        **cosines,
        relative_azimuth=np.radians(image["relative_azimuth_angle"].values),
        pressure=STANDARD_PRESSURE * depth / STANDARD_DEPTH[_COLOURS[0]],
    )
