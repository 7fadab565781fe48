"""The green band that the imager does not have, and the three colours with it."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Array, Float

from ._arrays import namespace

Correction = Callable[[str, Any], Any]
"""Takes the air out of one band: its name and bidirectional reflectance factor to another."""


class GreenRecipe(NamedTuple):
    """Weights of C02, C01 and C03 in a derived green, and a constant. [-]"""

    red: float
    blue: float
    near_infrared: float
    constant: float = 0.0


GREEN_RECIPES: dict[str, GreenRecipe] = {
    # Eq. (1) of Grasso et al. (2013), from MODIS albedos; the one with a constant.
    "grasso2013": GreenRecipe(0.416, 0.523, 0.065, -0.005),
    # The default of satpy's SimulatedGreen (satpy 0.60).
    "satpy": GreenRecipe(0.465, 0.465, 0.07),
    # CIMSS: M. K. Bah et al., "Generation of GOES-16 true color imagery without a green band",
    # Earth Space Sci., 5, 549-558, 2018, doi:10.1029/2018EA000379.
    "bah2018": GreenRecipe(0.45, 0.45, 0.10),
    # EDC (edc.occ-data.org/goes16/python), as listed with satpy's SimulatedGreen.
    "edc": GreenRecipe(red=0.48358168, blue=0.45706946, near_infrared=0.06038137),
}
"""Published recipes by name, each a weighted sum of three bands."""

ORDERS = ("green_first", "correct_first")


def derived_green(
    red: Float[Array | np.ndarray, "*shape"],
    blue: Float[Array | np.ndarray, "*shape"],
    near_infrared: Float[Array | np.ndarray, "*shape"],
    *,
    recipe: str = "grasso2013",
) -> Float[Array | np.ndarray, "*shape"]:
    """Reflectance at 0.555 um derived from the bands at hand. [-]

    By default G = 0.416 R + 0.523 B + 0.065 NIR - 0.005, Eq. (1) of Grasso et al. [1]_.

    Parameters
    ----------
    red, blue, near_infrared
        Bidirectional reflectance factors in C02, C01 and C03. [-]
    recipe
        One of `GREEN_RECIPES`: ``"grasso2013"``, ``"satpy"``, ``"bah2018"`` (CIMSS) or ``"edc"``.

    Raises
    ------
    ValueError
        If the recipe is unknown.

    References
    ----------
    .. [1] L. D. Grasso et al., "Use of MODIS 16-day albedos in generating GOES-R Advanced Baseline
       Imager imagery", J. Appl. Remote Sens., 7, 2013
    """
    if recipe not in GREEN_RECIPES:
        raise ValueError(f"no green recipe {recipe!r}; choose from {list(GREEN_RECIPES)}.")
    weight = GREEN_RECIPES[recipe]
    colours = weight.red * red + weight.blue * blue
    return colours + weight.near_infrared * near_infrared + weight.constant


def hybrid_green(
    green: Float[Array | np.ndarray, "*shape"],
    near_infrared: Float[Array | np.ndarray, "*shape"],
    *,
    fraction: float = 0.15,
) -> Float[Array | np.ndarray, "*shape"]:
    r"""Green of an imager whose band at 0.51 um misses the peak of chlorophyll. [-]

    .. math:: G = (1 - F)\,G_{0.51} + F\,R_{0.86}

    For comparison with AHI and FCI; ABI has no such band.

    Parameters
    ----------
    green, near_infrared
        Bidirectional reflectance factors at 0.51 um and at 0.86 um. [-]
    fraction
        F, by default as in satpy's HybridGreen (satpy 0.60). [-]

    References
    ----------
    .. [1] S. D. Miller et al., "A sight for sore eyes: the return of true color to geostationary
       satellites", Bull. Amer. Meteor. Soc., 97, 1803-1816, 2016, doi:10.1175/BAMS-D-15-00154.1
       (the supplement is doi:10.1175/BAMS-D-15-00154.2)
    """
    return (1 - fraction) * green + fraction * near_infrared


def corrected_colors(
    brf: Mapping[str, Float[Array | np.ndarray, "*shape"]],
    correction: Correction | None,
    order: str = "green_first",
    *,
    recipe: str = "grasso2013",
) -> Float[Array | np.ndarray, "*shape 3"]:
    """Red, green and blue with the air taken out, before any enhancement. [-]

    The two orders differ where the correction is not the same straight line in all bands, which it
    never is. The recipe of Grasso et al. (2013) was regressed on albedos of the ground, so that
    ``"correct_first"`` is what it was made for; green at the top of the atmosphere is what that
    paper displays, and over standard grounds the nearer to 0.555 um, as what the recipe lacks over
    plants and water and what the air adds nearly cancel (`benchmarks/paper_figures.py`).

    Parameters
    ----------
    brf
        Bidirectional reflectance factor at the top of the atmosphere in C01, C02 and C03. [-]
    correction
        Function of a band's name and its reflectance that returns the corrected reflectance, such
        as `rayleigh_corrected` with its angles filled in; None changes nothing. It is asked for
        ``"C01"``, ``"C02"`` and either ``"green"`` (0.555 um) or ``"C03"``; one that returns C03
        as it is leaves that band uncorrected, as satpy does.
    order
        ``"green_first"``: green is derived from the bands as they are and corrected as light of
        0.555 um. ``"correct_first"``: the three bands are corrected and green derived from them.
    recipe
        As in `derived_green`.

    Returns
    -------
    Array of the kind given, with the colours on a last axis.

    Raises
    ------
    ValueError
        If the order or the recipe is unknown.
    """
    if order not in ORDERS:
        raise ValueError(f"no order {order!r} of green and correction; choose from {ORDERS}.")
    red, blue, near_infrared = brf["C02"], brf["C01"], brf["C03"]
    correct = _unchanged if correction is None else correction
    if order == "green_first":
        green = correct("green", derived_green(red, blue, near_infrared, recipe=recipe))
        red, blue = correct("C02", red), correct("C01", blue)
    else:
        red, blue = correct("C02", red), correct("C01", blue)
        green = derived_green(red, blue, correct("C03", near_infrared), recipe=recipe)
    return namespace(red).stack([red, green, blue], axis=-1)


def _unchanged(_band: str, brf: Any) -> Any:
    return brf
