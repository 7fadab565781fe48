"""What the products make of the columns' reflectances: green, colours, corrected air, contrast."""

from collections.abc import Collection
from functools import partial

import numpy as np
from jaxtyping import Array, Float

from ..products import (
    GREEN_RECIPES,
    cimss_stretch,
    cira_stretch,
    corrected_colors,
    crefl_air,
    crefl_stretch,
    derived_green,
    fire_contrast,
    hybrid_green,
    jma_true_color,
    natural_color,
    nir_test,
    rayleigh_air,
    rayleigh_corrected,
    surrounding_mean,
)
from ..products.green import ORDERS
from ..products.rayleigh_correction import METHODS
from .seen import Seen

PRODUCT_BANDS = ("C01", "green", "C02", "C03", "C06")
"""Bands that products are made of."""

_COLOUR_BANDS = ("C01", "C02", "C03")
_STRETCHES = {"cira": cira_stretch, "cimss": cimss_stretch, "crefl": crefl_stretch}
_COLOURS = ("red", "green", "blue")
_AIRY = ("C01", "green", "C02", "C03")  # bands of which the air is taken out
_GAS, _VAPOUR = 0.93, 0.88  # transmittances along the path down and up [-]
_LOW_PRESSURE = 8e4  # of high ground [Pa]
# Radiances of C06 around a burning pixel, of which another burns too. [W m-2 sr-1 um-1]
_PICTURE = 0.5 + 0.01 * np.arange(225.0).reshape(15, 15)
_BURNING, _BURNING_TOO = (7, 6), (7, 9)
# Rayleigh depths: the largest of crefl's formulas; one for each cell of the tables' splines and one
# below. [-]
_THICKEST_OF_CREFL = 1.0
_DEPTHS = 1e-3 * 400.0 ** (np.array([-0.5, 0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5]) / 8)
# Cosines and azimuth at which the air is lit and seen. [-], [rad]
_COSINES = 0.1 + 0.9 * (np.arange(24) + 0.5) / 24
_AZIMUTH = np.array(0.7)


def product_outputs(seen: Seen) -> dict[str, Float[Array | np.ndarray, " column"]]:
    """Outputs by name, those whose bands are there.

    ``derived_green`` by every recipe, ``nir_test``, ``corrected_colors`` in either order and
    ``natural_color`` by every enhancement, of C01, C02 and C03; ``hybrid_green`` of green and C03;
    ``rayleigh_corrected`` by either method, over high ground and below gases; ``fire_contrast`` of
    C06 against a fixed picture around it.

    Parameters
    ----------
    seen
        Values of the columns.
    """
    found = _corrected(seen)
    if set(_COLOUR_BANDS) <= set(seen.value):
        found |= _of_colours(seen)
    if {"green", "C03"} <= set(seen.value):
        found["hybrid_green"] = hybrid_green(seen.brf("green"), seen.brf("C03"))
    if "C06" in seen.value:
        burning = seen.radiance("C06", "GOES-16")
        found["fire_contrast"] = fire_contrast(burning, _background())
    return found


def product_constants(bands: Collection[str]) -> dict[str, float]:
    """Outputs by name that are functions of no column: the response of pure air.

    Sums over all angles of each depth, to which every number of the tables adds something, and of
    crefl's formulas where they end, to which their highest powers do.
    """
    if not set(_AIRY) & set(bands):
        return {}
    found = {}
    angles = _COSINES[:, None], _COSINES, _AZIMUTH
    layers = {f"{tau:.4f}": rayleigh_air(tau, *angles) for tau in _DEPTHS}
    layers["crefl"] = crefl_air(_THICKEST_OF_CREFL, *angles)
    for layer, air in layers.items():
        for name, value in zip(air._fields, air, strict=True):
            found[f"pure_air.{name}.{layer}"] = float(np.sum(value))
    return found


def _correction(seen: Seen):
    return partial(
        rayleigh_corrected,
        mu0=seen.mu0,
        mu=seen.mu,
        relative_azimuth=seen.relative_azimuth,
    )


def _corrected(seen: Seen) -> dict[str, Float[Array | np.ndarray, " column"]]:
    correct, found = _correction(seen), {}
    for band in (x for x in _AIRY if x in seen.value):
        brf = seen.brf(band)
        for method in METHODS:
            found[f"rayleigh_corrected.{band}.{method}"] = correct(band, brf, method=method)
        found[f"rayleigh_corrected.{band}.below_gases"] = correct(
            band,
            brf,
            pressure=_LOW_PRESSURE,
            gas_transmittance=_GAS,
            vapour_transmittance=_VAPOUR,
        )
    return found


def _of_colours(seen: Seen) -> dict[str, Float[Array | np.ndarray, " column"]]:
    brf = {band: seen.brf(band) for band in _COLOUR_BANDS}
    bands = brf["C02"], brf["C01"], brf["C03"]
    found = {f"derived_green.{x}": derived_green(*bands, recipe=x) for x in GREEN_RECIPES}
    change = nir_test(*bands)
    found |= {f"nir_test.{name}": x for name, x in zip(change._fields, change, strict=True)}
    pictures = {
        f"corrected_colors.{order}": corrected_colors(brf, _correction(seen), order)
        for order in ORDERS
    }
    pictures["jma_true_color"] = jma_true_color(corrected_colors(brf, None))
    for name, stretch in _STRETCHES.items():
        pictures[f"natural_color.{name}"] = natural_color(brf, enhancement=stretch)
    for name, picture in pictures.items():
        found |= {f"{name}.{colour}": picture[:, k] for k, colour in enumerate(_COLOURS)}
    return found


def _background() -> Float[np.ndarray, ""]:
    """Mean around the burning pixel. [W m-2 sr-1 um-1]"""
    fire = np.zeros(_PICTURE.shape, bool)
    fire[_BURNING] = fire[_BURNING_TOO] = True
    return np.asarray(surrounding_mean(_PICTURE, fire)[_BURNING])
