r"""Thermal emission in the bands where fires and the ground shine: radiance and temperature.

The radiance of a black body, averaged over the response of a band, has the closed form that
calibration uses [1]_,

.. math:: B(T) = f\, \frac{f_{k1}}{\exp(f_{k2} / (b_{c1} + b_{c2} T)) - 1}

with the coefficients of `abi_operator.satellites`, and an inverse that is exact. From 250 to 1500 K
its relative error against the integral over the response is below 2e-4 in C05, 5e-5 in C06 and 7e-4
in C07, where it is largest at 1500 K and below 1e-4 up to 450 K (1 mK at 300 K). Outside this range
the form stays positive and smooth.

References
----------
.. [1] GOES-R Product Definition and Users' Guide, volume 3: Level 1b products (planck_fk1,
   planck_fk2, planck_bc1 and planck_bc2 of the band's files)
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from .bands import AnyName, constants
from .satellites import planck_coefficients


def wavenumber_radiance_factor(band_name: str, satellite: str = "GOES-16") -> float:
    r"""Radiance in W m-2 sr-1 um-1 that makes 1 mW m-2 sr-1 (cm-1)-1.

    Files give C07 per wavenumber, everything else here is per wavelength. Both are means over one
    response S, so that their ratio depends on nothing else:

    .. math:: f = 10^{-3}\, \frac{\int S\, \mathrm{d}\nu}{\int S\, \mathrm{d}\lambda}
       = 10\, \frac{\int S \lambda^{-2}\, \mathrm{d}\lambda}{\int S\, \mathrm{d}\lambda}

    with wavelength in um and wavenumber in cm-1. Multiply to go to wavelength, divide to come back.

    Parameters
    ----------
    band_name, satellite
        Names, ``"C07"`` and ``"GOES-16"`` for example.
    """
    return planck_coefficients(band_name, satellite).factor


def in_band_radiance(
    temperature: Float[Array, "*shape"], band_name: AnyName, satellite: str = "GOES-16"
) -> Float[Array, "*shape"]:
    """Radiance of a black body averaged over the response of a band. [W m-2 sr-1 um-1]

    Rounding is amplified by hc / (lambda k T), which is 60 in C05 at 150 K.

    Parameters
    ----------
    temperature
        Temperature, above 0. [K]
    band_name
        ``"C05"``, ``"C06"`` or ``"C07"``: at shorter wavelengths emission is negligible.
    satellite
        Satellite whose response is meant.

    Raises
    ------
    ValueError
        Where emission in the band is negligible, or band or satellite are unknown.
    """
    fk1, fk2, bc1, bc2, factor = constants(
        lambda name: planck_coefficients(name, satellite), band_name, temperature.dtype
    )
    # In exp(-x) nothing overflows: exp(x), and its square in the derivative, would in float32.
    x = fk2 / (bc1 + bc2 * temperature)
    return factor * fk1 * jnp.exp(-x) / -jnp.expm1(-x)


def brightness_temperature(
    radiance: Float[Array, "*shape"], band_name: str, satellite: str = "GOES-16"
) -> Float[Array, "*shape"]:
    """Temperature of the black body with this radiance in a band, the inverse of the above. [K]

    Parameters
    ----------
    radiance
        Radiance averaged over the response. [W m-2 sr-1 um-1] Where it is not positive, as noise
        can make it, no temperature belongs to it: the result is NaN, with derivative 0.
    band_name, satellite
        As in `in_band_radiance`.
    """
    fk1, fk2, bc1, bc2, factor = planck_coefficients(band_name, satellite)
    positive = radiance > 0
    safe = jnp.where(positive, radiance, factor)
    # log(1 + fk1 / L) for radiances whose reciprocal would overflow, too.
    x = jnp.log(safe + factor * fk1) - jnp.log(safe)
    return jnp.where(positive, (fk2 / x - bc1) / bc2, jnp.nan)
