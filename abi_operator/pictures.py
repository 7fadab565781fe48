"""Pictures on disk."""

import math
from os import PathLike

import numpy as np
from PIL import Image
from PIL.PngImagePlugin import PngInfo

# Scenes are enlarged to as many pixels along their longer side, or a few more.
_SMALLEST = 512


def grey(values: np.ndarray, black: float, white: float) -> np.ndarray:
    """Shades of grey (y, x, 3), 0 to 1, linear from one value to another; NaN stays NaN. [-]

    Parameters
    ----------
    values
        What to show (y, x).
    black, white
        Values that are black and white; those beyond are so, too. In infrared pictures the cold is
        white.
    """
    shade = np.clip((np.asarray(values, np.float64) - black) / (white - black), 0, 1)
    return np.repeat(shade[..., None], 3, axis=-1)


def write_png(path: str | PathLike[str], rgb: np.ndarray) -> None:
    """Write a picture as PNG, north at its top and small scenes enlarged.

    Every pixel becomes a square of whole pixels, so that a scene has 512 or more along its longer
    side; the PNG's text ``Scale`` tells how large the squares are. Pixels with NaN are transparent,
    as any grey would be that of clouds; a picture without any has no alpha channel.

    Parameters
    ----------
    path
        The file to write.
    rgb
        Red, green and blue (y, x, 3), 0 to 1, the southernmost row first. [-]
    """
    rgb = np.asarray(rgb)
    if rgb.ndim != 3 or rgb.shape[-1] != 3:
        raise ValueError(f"a picture has three colours, (y, x, 3); got {rgb.shape=}.")
    missing = np.isnan(rgb).any(axis=-1, keepdims=True)
    levels = np.rint(255 * np.clip(np.where(missing, 0, rgb), 0, 1))
    opaque = np.where(missing, 0, 255)
    levels = np.concatenate([levels, opaque], axis=-1) if missing.any() else levels
    picture = np.flipud(levels.astype(np.uint8))
    scale = max(1, math.ceil(_SMALLEST / max(picture.shape[:2])))
    text = PngInfo()
    text.add_text("Scale", f"{scale} x {scale} pixels per column of the scene, nearest neighbour")
    enlarged = picture.repeat(scale, axis=0).repeat(scale, axis=1)
    Image.fromarray(enlarged).save(path, format="PNG", pnginfo=text)
