"""Radiance and reflectance factor, each from the other."""

import math

from jaxtyping import Array, Float

from ..satellites import solar_irradiance


def reflectance_factor_from_radiance(
    radiance: Float[Array, "*shape"],
    band: str,
    satellite: str = "GOES-16",
    sun_distance: Float[Array, "*#shape"] | float = 1.0,
) -> Float[Array, "*shape"]:
    r"""Reflectance factor as in ABI files. [-]

    .. math:: \rho = \pi d^2 L / E_0

    It contains the cosine of the solar zenith angle [1]_.

    Parameters
    ----------
    radiance
        Radiance L. [W m-2 sr-1 um-1]
    band, satellite
        Names, which choose the solar irradiance :math:`E_0` at 1 AU.
    sun_distance
        Distance d of the sun. [AU]

    References
    ----------
    .. [1] GOES-R Product Definition and Users' Guide, volume 3: Level 1b products (kappa0)
    """
    return radiance * (math.pi / solar_irradiance(band, satellite) * sun_distance**2)


def radiance_from_reflectance_factor(
    reflectance_factor: Float[Array, "*shape"],
    band: str,
    satellite: str = "GOES-16",
    sun_distance: Float[Array, "*#shape"] | float = 1.0,
) -> Float[Array, "*shape"]:
    """Radiance whose reflectance factor this is. [W m-2 sr-1 um-1]

    Parameters
    ----------
    reflectance_factor
        Reflectance factor, pi d^2 L / E0. [-]
    band, satellite, sun_distance
        As in `reflectance_factor_from_radiance`.
    """
    return reflectance_factor * (solar_irradiance(band, satellite) / math.pi / sun_distance**2)
