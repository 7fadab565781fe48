"""Radiance as the integers of an L1b file."""

import math

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..planck import wavenumber_radiance_factor
from ..satellites import packing


def quantise(
    radiance: Float[Array, "*shape"], band: str, satellite: str = "GOES-16"
) -> Float[Array, "*shape"]:
    r"""Radiance after it was packed into an L1b file and read again. [W m-2 sr-1 um-1]

    .. math:: L' = s\, n + o, \qquad n = \mathrm{round}((L - o) / s), \quad 0 \le n \le 2^b - 2

    with scale s, offset o and bits b of `abi_operator.satellites.packing`. A file holds nothing
    outside these counts, so that radiance beyond them becomes the end of the range. The result is
    a staircase: its derivative is 0 wherever there is one, and 0 is what differentiation gives.
    Leave quantisation out of what is to be differentiated.

    Parameters
    ----------
    radiance
        Radiance of footprints. [W m-2 sr-1 um-1]
    band, satellite
        Names, ``"C01"`` to ``"C07"`` and ``"GOES-16"`` for example.
    """
    scale, offset, _ = packed = packing(band, satellite)
    unit = _unit(band, satellite)
    count = jnp.round((radiance / unit - offset) / scale)
    count = jnp.clip(count, 0, packed.highest_count)
    return (count * scale + offset) * unit


def rounding_deviation(band: str, satellite: str = "GOES-16") -> float:
    r"""Standard deviation of what `quantise` rounds off, :math:`s / \sqrt{12}`.
    [W m-2 sr-1 um-1]

    Parameters
    ----------
    band, satellite
        Names, ``"C01"`` to ``"C07"`` and ``"GOES-16"`` for example.
    """
    return packing(band, satellite).scale * _unit(band, satellite) / math.sqrt(12)


def _unit(band: str, satellite: str) -> float:
    """What the packed number is to be multiplied by: C07 is packed by wavenumber."""
    return wavenumber_radiance_factor(band, satellite) if band == "C07" else 1.0
