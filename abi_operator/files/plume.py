"""The picture that draws a plume: its grey value is the plume's horizontal weight."""

from os import PathLike

import numpy as np
from PIL import Image

from .errors import InputError

# What Pillow raises for files that it cannot read.
_UNREADABLE = (OSError, SyntaxError, ValueError, Image.DecompressionBombError)


def read_plume(path: str | PathLike[str], shape: tuple[int, int]) -> np.ndarray:
    """Read the brightness of a plume from a greyscale PNG of 8 or 16 bits.

    Parameters
    ----------
    path
        The picture, north at its top. Colour is accepted where it is grey, transparency where
        there is none.
    shape
        Numbers of rows and columns of the model's grid. [-]

    Returns
    -------
    numpy.ndarray
        Brightness (y, x), 0 to 1, float64, the southernmost row first as in WRF. [-]
    """
    rows, columns = shape
    try:
        with Image.open(path) as image:
            if image.format != "PNG":
                raise InputError(f"{path} is a {image.format} picture; save it as greyscale PNG.")
            if image.size != (columns, rows):
                raise InputError(
                    f"{path} is {image.width} x {image.height} pixels where the model's grid is "
                    f"{columns} x {rows}; resample the picture to one pixel per grid column."
                )
            grey, white = _grey(image, path)
    except FileNotFoundError as error:
        raise InputError(f"{path} does not exist; check the path.") from error
    except InputError:
        raise
    except _UNREADABLE as error:
        raise InputError(
            f"{path} cannot be read as a picture ({error}); copy it again, or save it as greyscale "
            "PNG."
        ) from error
    return np.flipud(grey).astype(np.float64) / white


def _grey(image: Image.Image, path) -> tuple[np.ndarray, float]:
    """Grey values of a picture, and the value of white."""
    transparent = f"{path} is partly transparent; save it as greyscale PNG without alpha."
    if image.mode.startswith("I"):  # 16 bits
        if "transparency" in image.info:
            raise InputError(transparent)
        return np.asarray(image), 65535.0
    red, green, blue, alpha = (np.asarray(plane) for plane in image.convert("RGBA").split())
    if (alpha < 255).any():
        raise InputError(transparent)
    if (red != green).any() or (red != blue).any():
        raise InputError(f"{path} is coloured; save it as greyscale PNG.")
    return red, 255.0
