r"""Scattering by air."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..atmosphere import Atmosphere
from ..bands import AnyBand, constants, first_missing
from ..constants import STANDARD_PRESSURE
from ..optical_properties import OpticalProperties, Scatterer
from .air import counted_pressure
from .phase import RayleighPhase

# Optical depth of air down to 1013.25 hPa after the full form of Bodhaine et al. (1999), 360 ppm
# CO2 (`bodhaine1999`), averaged over the spectral response of GOES-16 times the solar spectrum; in
# green at 0.555 um. [-] (response: NOAA CWG, 2016; sun: Kurucz; GOES-17 to -19 are within 0.6 %,
# but for 1.7 % in C04 of GOES-19 and 1.3 % in C07 of GOES-18 and -19; other published sets agree to
# 0.6 %. But for green the gravity is that of sea level, not of the mean height of the air as in
# `bodhaine1999`: they are 0.17 % below it.)
STANDARD_DEPTH = {
    "C01": 0.18411,
    "green": 0.09355,
    "C02": 0.053806,
    "C03": 0.01555,
    "C04": 0.0024113,
    "C05": 0.0012774,
    "C06": 0.00033791,
    "C07": 3.7341e-5,
}
# Coefficient of P_2 in the phase function, 0.5 (1 - gamma) / (1 + 2 gamma), gamma = rho / (2 -
# rho), from the depolarisation rho of the same King factors at the centroid of the band: 0.02884,
# 0.02830, 0.02798, 0.02757, 0.02730, 0.02726, 0.02720, 0.02716.
BETA2 = {
    "C01": 0.47867,
    "green": 0.47907,
    "C02": 0.47930,
    "C03": 0.47960,
    "C04": 0.47980,
    "C05": 0.47983,
    "C06": 0.47987,
    "C07": 0.47990,
}

# Air of Bodhaine et al. (1999), in the CGS units of the paper.
_MOLECULES = 2.546899e19  # at 288.15 K and 1013.25 hPa [cm-3]
_AVOGADRO = 6.0221367e23  # [mol-1]
_GRAVITY = 978.916  # at 45 degrees of latitude, over air seen from sea level (eqs 11, 26) [cm s-2]
_NITROGEN, _OXYGEN, _ARGON = 78.084, 20.946, 0.934  # parts per hundred by volume


def bodhaine1999(
    wavelength_um: Float[Array, "*n"], carbon_dioxide: float = 360e-6
) -> Float[Array, "*n"]:
    r"""Rayleigh optical depth at one wavelength of air down to 1013.25 hPa. [-]

    .. math:: \tau = \sigma\, p_0 N_A / (m_a g), \qquad \sigma = \frac{24 \pi^3 (n^2 - 1)^2}
       {\lambda^4 N_s^2 (n^2 + 2)^2} F

    with the refractive index n of Peck and Reeder and the King factor F of nitrogen, oxygen, argon
    and carbon dioxide, weighted by volume: the full form of the paper [1]_ (eqs 5, 6, 17, 21 to
    25), for 45 degrees of latitude. The index was measured between 0.23 and 1.69 um and is
    extrapolated beyond.

    Parameters
    ----------
    wavelength_um
        Wavelength. [um]
    carbon_dioxide
        Mole fraction of carbon dioxide. [-]

    References
    ----------
    .. [1] B. A. Bodhaine et al., "On Rayleigh optical depth calculations", J. Atmos. Oceanic
       Technol., 16, 1854-1861, 1999, doi:10.1175/1520-0426(1999)016<1854:ORODC>2.0.CO;2
    """
    inverse2 = 1 / wavelength_um**2
    refractivity = 1e-8 * (
        8060.51 + 2480990 / (132.274 - inverse2) + 17455.7 / (39.32957 - inverse2)
    )
    refractivity = refractivity * (1 + 0.54 * (carbon_dioxide - 300e-6))
    n2_minus_1 = refractivity * (2 + refractivity)  # loses no digits in float32
    king = king_factor(wavelength_um, carbon_dioxide)
    lorenz = n2_minus_1 / (n2_minus_1 + 3)
    # Grouped so that no factor leaves the range of float32.
    per_molecule = 24 * 3.141592653589793**3 * (1e16 / _MOLECULES**2) * _AVOGADRO
    molar_mass = 15.0556 * carbon_dioxide + 28.9595
    air = 10 * STANDARD_PRESSURE / (molar_mass * _GRAVITY)
    return per_molecule * air * lorenz**2 * king * inverse2**2


def king_factor(
    wavelength_um: Float[Array, "*n"], carbon_dioxide: float = 360e-6
) -> Float[Array, "*n"]:
    r"""King factor (6 + 3 rho) / (6 - 7 rho) of dry air, of which rho is the depolarisation. [-]

    Parameters
    ----------
    wavelength_um, carbon_dioxide
        As in `bodhaine1999`, whose eqs 5, 6 and 23 these are. [um], [-]
    """
    inverse2 = 1 / wavelength_um**2
    nitrogen = 1.034 + 3.17e-4 * inverse2
    oxygen = 1.096 + 1.385e-3 * inverse2 + 1.448e-4 * inverse2**2
    dioxide = 100 * carbon_dioxide
    total = _NITROGEN + _OXYGEN + _ARGON + dioxide
    return (_NITROGEN * nitrogen + _OXYGEN * oxygen + _ARGON + 1.15 * dioxide) / total


def rayleigh(atmosphere: Atmosphere, band: AnyBand) -> OpticalProperties:
    r"""Rayleigh scattering by the air of each layer, in proportion to its mass.

    .. math:: \tau_k = \tau_0\, (p_{k+1} - p_k) / p_0, \qquad p_0 = 1013.25\ \mathrm{hPa}

    Air above the first level is that of the uppermost layer, of which :math:`p_k` counts as 0: the
    column's depth is what the pressure at the ground says, wherever the levels begin.

    Parameters
    ----------
    atmosphere
        One column, of which the pressure is read (`counted_pressure`). [Pa]
    band
        Band for which the depth :math:`\tau_0` at standard pressure is tabulated, by the full form
        of Bodhaine et al. (`bodhaine1999`).
    """
    if missing := first_missing(band.name, STANDARD_DEPTH):
        raise ValueError(f"no Rayleigh depth for band {missing!r}; have {list(STANDARD_DEPTH)}.")
    dtype = atmosphere.pressure.dtype
    per_pascal, beta2 = constants(_constants, band.name, dtype)
    scattering = jnp.diff(counted_pressure(atmosphere.pressure), axis=0) * per_pascal
    phase = RayleighPhase(jnp.asarray(beta2, dtype))
    return OpticalProperties(
        scattering[None, :], jnp.ones(1, dtype), (Scatterer(scattering, phase),)
    )


def _constants(name: str) -> tuple[float, float]:
    """Optical depth per pressure [Pa-1] and coefficient of P_2 [-] of a band."""
    return STANDARD_DEPTH[name] / STANDARD_PRESSURE, BETA2[name]
