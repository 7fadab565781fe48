"""Pixels before a fire is retrieved: what was measured of them, their surroundings, and which of
them are not attempted (`fires`)."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
import xarray as xr

from abi_operator.instrument import Imager, reflectance_factor_from_radiance
from abi_operator.nomenclature import QUALITY_FLAGS

from .fire_detection import Surroundings, surroundings
from .forward import THERMAL
from .observation import UNUSABLE, distance_of, known_saturated
from .results import ResultCode

# A fire shines by night too.
_UNUSABLE = UNUSABLE & ~QUALITY_FLAGS["night"]


def measured_light(
    images: Sequence[xr.Dataset], bands: tuple[str, ...], imager: Imager
) -> tuple[xr.DataArray, xr.DataArray]:
    """Reflectance factor, or radiance in C07, of all the light that arrives; and where a result
    says that it is saturated.
    """
    dims, parts, limited = ("band", "y", "x"), [], []
    for image in images:
        distance = distance_of(image)
        seen = image["radiance"].sel(band=list(bands)).transpose(*dims)
        values = seen.values.astype(np.float64)
        for i, band in enumerate(bands):
            if band != THERMAL:
                values[i] = reflectance_factor_from_radiance(
                    jnp.asarray(values[i]), band, imager.satellite, distance
                )
        parts.append(values)
        known = known_saturated(image)
        known = xr.zeros_like(seen, bool) if known is None else known.sel(band=list(bands))
        limited.append(known.transpose(*dims).values)
    measured, saturated = (
        xr.DataArray(np.stack(each), {"band": list(bands)}, ("image", *dims))
        for each in (parts, limited)
    )
    return measured, saturated


def surroundings_by_day_and_night(
    image: xr.Dataset,
    measured: np.ndarray,
    bands: tuple[str, ...],
    imager: Imager,
    threshold: float,
) -> Surroundings:
    """Those of the pixels by day among these, and of the others by night."""
    night = (image["quality_flag"].values.astype(int) & QUALITY_FLAGS["night"]) != 0
    dark, lit = (
        surroundings(np.where(side, measured, np.nan), bands, imager, threshold)
        for side in (night, ~night)
    )
    return Surroundings(*(np.where(night, *pair) for pair in zip(dark, lit, strict=True)))


def codes_before(
    image: xr.Dataset,
    measured: np.ndarray,
    around: Surroundings,
    threshold: float | None,
    hottest: int,
) -> np.ndarray:
    """Result code of the pixels that are not to be attempted, 0 (success) elsewhere; without
    threshold whatever their score. Where nobody could look for a fire, none is denied.
    """
    codes = np.full(measured.shape[1:], ResultCode.SUCCESS, np.int8)
    if threshold is not None:
        codes[~(around.score >= threshold)] = ResultCode.NO_PLUME
        codes[~np.isfinite(measured[hottest])] = ResultCode.INVALID_INPUT
    codes[~np.isfinite(measured).any(axis=0)] = ResultCode.INVALID_INPUT
    codes[(image["quality_flag"].values.astype(int) & _UNUSABLE) != 0] = ResultCode.UNUSABLE
    return codes
