"""Saturation: the highest radiance that the instrument can tell."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..planck import in_band_radiance, wavenumber_radiance_factor
from ..satellites import packing


def range_ceiling(
    band: str,
    satellite: str = "GOES-16",
    saturation_temperature: Float[Array, ""] | None = None,
) -> Float[Array, ""] | float:
    """Radiance at the top of a band's range. [W m-2 sr-1 um-1]

    L1b files end at reflectance factors of 1.21 to 1.25 in C01 to C06 and at 16.9 W m-2 sr-1 um-1
    in C07, 411.9 K in GOES-16. The scene that C07 was specified for is 400 K [1]_, which is what
    Grasso et al. (2013) let it saturate at.

    Parameters
    ----------
    band, satellite
        Names, ``"C01"`` to ``"C07"`` and ``"GOES-16"`` for example.
    saturation_temperature
        Brightness temperature at which the band saturates, for C05 to C07; None for the end of
        the files' range. [K]

    References
    ----------
    .. [1] D. W. Hillger and T. J. Schmit, "Quantization noise for GOES-R ABI bands", 13th
       Conference on Satellite Meteorology and Oceanography, Amer. Meteor. Soc., P1.7, 2004
    """
    top = packing(band, satellite).ceiling
    if saturation_temperature is not None:
        return in_band_radiance(saturation_temperature, band, satellite)
    return top * wavenumber_radiance_factor(band, satellite) if band == "C07" else top


def hard_ceiling(
    radiance: Float[Array, "*shape"], ceiling: Float[Array, ""] | float
) -> Float[Array, "*shape"]:
    """Radiance, or the ceiling where it is higher: what the instrument does.

    Above the ceiling the derivative with respect to radiance is 0. What is NaN stays NaN.

    Parameters
    ----------
    radiance, ceiling
        Radiance of a footprint and the highest that can be told. [W m-2 sr-1 um-1]
    """
    return jnp.where(radiance >= ceiling, ceiling, radiance)


def smooth_ceiling(
    radiance: Float[Array, "*shape"],
    ceiling: Float[Array, ""] | float,
    width: Float[Array, ""] | float,
) -> Float[Array, "*shape"]:
    r"""A ceiling with a rounded edge, through which a minimiser can see.

    .. math:: L' = L\, \left(1 + (L / C)^{1/w}\right)^{-w}

    This is the softened minimum of L and C in their logarithms. It is below the hard ceiling by a
    factor of :math:`2^{-w}` at L = C, where the two differ most, and becomes it as w goes to 0. The
    derivative falls as :math:`(C / L)^{1 + 1/w}` above the ceiling: at twice the ceiling it is 5e-4
    for w = 0.1 and 1.5e-2 for w = 0.2. Radiance that is not positive is returned as it is.

    Parameters
    ----------
    radiance, ceiling
        Radiance of a footprint and the highest that can be told. [W m-2 sr-1 um-1]
    width
        Relative width w of the edge, above 0. [-]
    """
    positive = radiance > 0
    safe = jnp.where(positive, radiance, 1)
    excess = (jnp.log(safe) - jnp.log(ceiling)) / width
    # Two forms of one function: above the ceiling the derivative of the first is a difference of
    # nearly equal numbers.
    below = safe * jnp.exp(-width * jax.nn.softplus(excess))
    above = ceiling * jnp.exp(-width * jax.nn.softplus(-excess))
    return jnp.where(positive, jnp.where(excess < 0, below, above), radiance)
