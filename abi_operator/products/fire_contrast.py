"""How a fire stands out from its surroundings."""

from typing import Any

import numpy as np
from jaxtyping import Array, Bool, Float

from ._arrays import namespace


def fire_contrast(
    observed: Float[Array | np.ndarray, "*shape"],
    background: Float[Array | np.ndarray, "*#shape"],
) -> Float[Array | np.ndarray, "*shape"]:
    r"""Excess of a pixel with fire over the same pixel without, relative to the latter. [-]

    .. math:: C = (L - L_b) / L_b

    In C06 (2.24 um), where sunlight makes the background and a fire above some 500 K adds to it.
    Reflectance factors, bidirectional reflectance factors and radiances give the same C, as they
    differ by a factor that both share.

    Parameters
    ----------
    observed, background
        The same quantity with and without fire: reflectance factor [-] or radiance
        [W m-2 sr-1 um-1]. The background is not 0, as it is by night. It is the same scene
        simulated without fires, or `surrounding_mean`.
    """
    return (observed - background) / background


def surrounding_mean(
    field: Float[Array | np.ndarray, "*batch y x"],
    fire: Bool[Array | np.ndarray, "*#batch y x"],
    half_width: int = 5,
) -> Float[Array | np.ndarray, "*batch y x"]:
    """Mean of the pixels around each one that do not burn: the background in an observed picture.

    Over a square of 2 `half_width` + 1 pixels a side, cut off at the edges of the picture. Burning
    pixels and NaN are left out, the pixel itself too where it burns.

    Parameters
    ----------
    field
        Reflectance factor [-] or radiance [W m-2 sr-1 um-1] of C06.
    fire
        Where it burns.
    half_width
        Pixels from the middle of the square to its edge, 1 or more.

    Returns
    -------
    The mean, in the unit of `field`; NaN where all pixels of the square burn.

    Raises
    ------
    ValueError
        If `half_width` is less than 1, or the field has no two axes.
    """
    if half_width < 1:
        raise ValueError(f"{half_width=} gives no surroundings; it must be 1 or more.")
    if field.ndim < 2:
        raise ValueError(f"a picture has axes y and x; got a field of shape {field.shape}.")
    xp = namespace(field, fire)
    usable = ~(fire.astype(bool) | xp.isnan(field))  # of a mask of bytes, too
    total = _box_sum(xp, xp.where(usable, field, 0), half_width)
    count = _box_sum(xp, usable.astype(field.dtype), half_width)
    some = count > 0
    return xp.where(some, total / xp.where(some, count, 1), xp.nan)


def _box_sum(xp: Any, x: Any, half_width: int) -> Any:
    """Sum over a square around each pixel, zero beyond the edges."""
    for axis in (-2, -1):
        length, size = x.shape[axis], 2 * half_width + 1
        widths = [(0, 0)] * x.ndim
        widths[axis] = (half_width, half_width)
        padded = xp.moveaxis(xp.pad(x, widths), axis, -1)
        x = xp.moveaxis(sum(padded[..., k : k + length] for k in range(size)), -1, axis)
    return x
