"""How much the derived green owes to the near infrared, which no eye sees."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Float

from .green import derived_green


class GreenChange(NamedTuple):
    """Relative change of green when the near infrared grows and when it shrinks. [-]"""

    increase: Float[Array | np.ndarray, "*shape"]
    decrease: Float[Array | np.ndarray, "*shape"]


def green_change(
    red: Float[Array | np.ndarray, "*shape"],
    blue: Float[Array | np.ndarray, "*shape"],
    near_infrared: Float[Array | np.ndarray, "*shape"],
    factor: float | Float[Array | np.ndarray, "*#shape"],
    *,
    recipe: str = "grasso2013",
) -> Float[Array | np.ndarray, "*shape"]:
    r"""Change of the derived green when C03 is multiplied by a factor, relative to the new green.

    .. math:: \frac{G(R, B, f\,NIR) - G(R, B, NIR)}{G(R, B, f\,NIR)}

    Eqs. (2) and (3) of Grasso et al. (2013) with f = 1.1 and f = 0.9: the changed green stands
    below the line.

    Parameters
    ----------
    red, blue, near_infrared
        Bidirectional reflectance factors in C02, C01 and C03, not all black. [-]
    factor
        f. [-]
    recipe
        As in `derived_green`.

    Returns
    -------
    Relative change, 0.01 for a per cent. [-]

    References
    ----------
    .. [1] L. D. Grasso et al., "Use of MODIS 16-day albedos in generating GOES-R Advanced Baseline
       Imager imagery", J. Appl. Remote Sens., 7, 2013
    """
    changed = derived_green(red, blue, factor * near_infrared, recipe=recipe)
    return (changed - derived_green(red, blue, near_infrared, recipe=recipe)) / changed


def nir_test(
    red: Float[Array | np.ndarray, "*shape"],
    blue: Float[Array | np.ndarray, "*shape"],
    near_infrared: Float[Array | np.ndarray, "*shape"],
    *,
    change: float = 0.1,
    recipe: str = "grasso2013",
) -> GreenChange:
    r"""The test of Grasso et al. (2013): the near infrared 10 % brighter, then 10 % darker. [-]

    Green is linear in C03, so that with :math:`x = c\,w\,NIR / G`, where c is the change and w the
    weight of C03, the two are :math:`x / (1 + x)` and :math:`-x / (1 - x)`: of equal steps the
    decrease is always the larger in size.

    Parameters
    ----------
    red, blue, near_infrared, recipe
        As in `green_change`.
    change
        c, by which C03 grows and shrinks. [-]
    """
    increase, decrease = (
        green_change(red, blue, near_infrared, factor, recipe=recipe)
        for factor in (1 + change, 1 - change)
    )
    return GreenChange(increase, decrease)
