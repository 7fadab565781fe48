"""Pictures in the colours that an eye would see."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Array, Float

from .green import derived_green

# Reflectance shown as black. [-]
_DARKEST = 0.0223


def natural_color(
    brf: Mapping[str, Float[Array | np.ndarray, "*shape"]],
) -> Float[Array | np.ndarray, "*shape 3"]:
    r"""Red, green and blue of a picture in natural colours, 0 to 1.

    Red is C02, blue is C01 and green is `derived_green`; each is brightened by the logarithmic
    stretch of CIRA, as satpy's ``cira_stretch`` does,

    .. math:: y = \frac{\log_{10} R - \log_{10} 0.0223}{0.75\,(1 - \log_{10} 0.0223)}

    and clipped to 0..1 for display. Grasso et al. (2013) call this natural color and satpy
    ``true_color`` (its ``natural_color`` is another composite). Air is not corrected for.

    Parameters
    ----------
    brf
        Bidirectional reflectance factor in C01, C02 and C03, each (y, x) say. [-]

    Returns
    -------
    Array of the kind given, with the colours on a last axis; NaN where a band is NaN.
    """
    red, blue = brf["C02"], brf["C01"]
    colours = (red, derived_green(red, blue, brf["C03"]), blue)
    xp = _namespace(red)
    return xp.stack([_stretch(xp, colour) for colour in colours], axis=-1)


def _stretch(xp: Any, reflectance: Any) -> Any:
    """CIRA's logarithmic stretch, clipped to 0..1."""
    darkest = math.log10(_DARKEST)
    visible = xp.maximum(reflectance, _DARKEST)
    return xp.minimum((xp.log10(visible) - darkest) / (0.75 * (1 - darkest)), 1.0)


def _namespace(array: Any) -> Any:
    """The module whose array this is, `numpy` or `jax.numpy`."""
    return array.__array_namespace__()
