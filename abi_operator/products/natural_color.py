"""Pictures in the colours that an eye would see."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from jaxtyping import Array, Float

from .enhancement import cira_stretch
from .green import Correction, corrected_colors


def natural_color(
    brf: Mapping[str, Float[Array | np.ndarray, "*shape"]],
    *,
    recipe: str = "grasso2013",
    correction: Correction | None = None,
    order: str = "green_first",
    enhancement: Callable[[Any], Any] = cira_stretch,
) -> Float[Array | np.ndarray, "*shape 3"]:
    """Red, green and blue of a picture in natural colours, 0 to 1.

    Red is C02, blue is C01 and green is `derived_green`; each is brightened by `cira_stretch`,
    CIRA's logarithmic stretch, and clipped to 0..1 for display. Grasso et al. (2013) call this
    natural color and satpy ``true_color`` (its ``natural_color`` is another composite). Air is not
    corrected for, unless asked.

    Parameters
    ----------
    brf
        Bidirectional reflectance factor in C01, C02 and C03, each (y, x) say. [-]
    recipe, correction, order
        How green is derived and the air taken out: see `corrected_colors`.
    enhancement
        Function of the three colours on a last axis that returns them for display.

    Returns
    -------
    Array of the kind given, with the colours on a last axis; NaN where a band is NaN.

    Raises
    ------
    ValueError
        If the recipe or the order is unknown.
    """
    return enhancement(corrected_colors(brf, correction, order, recipe=recipe))
