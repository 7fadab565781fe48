r"""Scattering by air."""

import jax.numpy as jnp

from ..atmosphere import Atmosphere
from ..bands import Band
from ..constants import STANDARD_PRESSURE
from ..optical_properties import OpticalProperties, Scatterer
from .phase import RayleighPhase

# Optical depth of air down to 1013.25 hPa after the full form of Bodhaine et al. (1999), 360 ppm
# CO2, averaged over the spectral response of GOES-16 times the solar spectrum. [-] (response: NOAA
# CWG, 2016; sun: Kurucz; GOES-17 to -19 are within 0.6 %; other published sets agree to 0.6 %)
STANDARD_DEPTH = {"C01": 0.18411, "C02": 0.05381, "C03": 0.01555, "C06": 0.000338}
# Coefficient of P_2 in the phase function, 0.5 (1 - gamma) / (1 + 2 gamma), gamma = rho / (2 -
# rho), from the depolarisation rho of the same King factors: 0.02885, 0.02799, 0.02758, 0.0272.
BETA2 = {"C01": 0.47867, "C02": 0.47930, "C03": 0.47960, "C06": 0.47987}


def rayleigh(atmosphere: Atmosphere, band: Band) -> OpticalProperties:
    r"""Rayleigh scattering by the air of each layer, in proportion to its mass.

    .. math:: \tau_k = \tau_0\, (p_{k+1} - p_k) / p_0, \qquad p_0 = 1013.25\ \mathrm{hPa}

    Parameters
    ----------
    atmosphere
        One column, of which the pressure is read. [Pa]
    band
        Band for which the depth :math:`\tau_0` at standard pressure is tabulated [1]_.

    References
    ----------
    .. [1] B. A. Bodhaine et al., "On Rayleigh optical depth calculations", J. Atmos. Oceanic
       Technol., 16, 1854-1861, 1999, doi:10.1175/1520-0426(1999)016<1854:ORODC>2.0.CO;2
    """
    if band.name not in STANDARD_DEPTH:
        raise ValueError(f"no Rayleigh depth for band {band.name!r}; have {list(STANDARD_DEPTH)}.")
    scattering = jnp.diff(atmosphere.pressure) * (STANDARD_DEPTH[band.name] / STANDARD_PRESSURE)
    dtype = scattering.dtype
    phase = RayleighPhase(jnp.asarray(BETA2[band.name], dtype))
    return OpticalProperties(
        scattering[None, :], jnp.ones(1, dtype), (Scatterer(scattering, phase),)
    )
