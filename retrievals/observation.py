"""What the imager measured at each pixel, how well, and where that can be used."""

from typing import Literal

import equinox as eqx
import numpy as np
import xarray as xr
from jaxtyping import Array, ArrayLike, Float

from abi_operator.nomenclature import QUALITY_FLAGS

from .results import ResultCode

NOISE_FLOOR = 4.8e-4
"""Noise in reflectance factor of a dark scene, `noise_sigma`. [-]"""
NOISE_SLOPE = 1.09e-5
"""Growth of the noise's variance with reflectance factor, `noise_sigma`. [-]"""

_ATTEMPTED = ResultCode.SUCCESS
# Flags of pixels that are not attempted. Optics beyond what they were fitted to are no reason: the
# retrieval's operator has the same.
_UNUSABLE = sum(bit for name, bit in QUALITY_FLAGS.items() if name != "outside_fit")


class Observation(eqx.Module):
    """Reflectance factors of one column and the standard deviation of their noise. [-]"""

    reflectance_factor: Float[Array | np.ndarray, "*batch band"]
    sigma: Float[Array | np.ndarray, "*batch band"]


def noise_sigma(reflectance_factor: ArrayLike) -> np.ndarray:
    r"""Noise of a reflectance factor, :math:`\sigma^2 = a^2 + b\rho`. [-]

    The two constants meet the requirement of a signal-to-noise ratio of 300 at rho = 1 and the
    ratio of 57 at rho = 0.05 that was measured in C02 [1]_.

    References
    ----------
    .. [1] R. A. Iacovazzi and X. Wu, J. Appl. Remote Sens., 14, 026502, 2020,
       doi:10.1117/1.JRS.14.026502
    """
    return np.sqrt(NOISE_FLOOR**2 + NOISE_SLOPE * np.maximum(reflectance_factor, 0))


def add_noise(reflectance_factor: xr.DataArray, seed: int) -> xr.DataArray:
    """Add Gaussian noise of `noise_sigma`, independent between pixels and bands."""
    values = reflectance_factor.values
    draws = np.random.default_rng(seed).standard_normal(values.shape)
    return reflectance_factor.copy(data=values + noise_sigma(values) * draws)


def observe(columns: xr.Dataset, bands: tuple[str, ...]) -> Observation:
    """Take the measurement vectors of a Dataset with a dimension ``column``."""
    measured = columns["reflectance_factor"].sel(band=list(bands))
    values = measured.transpose("column", "band").values.astype(np.float64)
    return Observation(values, noise_sigma(values))


def usable(
    image: xr.Dataset, bands: tuple[str, ...], species: str, where: Literal["plume", "all"]
) -> np.ndarray:
    """Result code of the pixels that are not to be attempted, 0 (success) elsewhere.

    Parameters
    ----------
    image
        A result of one time.
    bands
        Bands that are to be used.
    species
        Name of the plume.
    where
        ``"plume"``: only where the specified plume is (its brightness above 0), as if a plume mask
        had been made beforehand; ``"all"``: everywhere.
    """
    codes = np.full((image.sizes["y"], image.sizes["x"]), _ATTEMPTED, np.int8)
    measured = image["reflectance_factor"].sel(band=list(bands)).transpose("band", "y", "x")
    codes[~np.isfinite(measured.values).all(axis=0)] = ResultCode.INVALID_INPUT
    codes[(image["quality_flag"].values & _UNUSABLE) != 0] = ResultCode.UNUSABLE
    if where == "plume":
        codes[~(image[f"{species}_brightness"].values > 0)] = ResultCode.NO_PLUME
    return codes
