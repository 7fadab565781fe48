r"""Rayleigh correction by the closed forms of "crefl", the corrected reflectance of MODIS.

Path reflectance, transmittance and spherical albedo of pure air, each a formula fitted by others
to Chandrasekhar's tables. Those contain the polarisation of skylight, which a solver of the
intensity alone does not. In C01, at zenith angles up to 65 degrees, that is all but a tenth (root
mean square) of the difference to `rayleigh_air`: a correction of observed pictures is better off
with crefl there, one of simulated pictures with `rayleigh_air`.
"""

from typing import Any

import numpy as np
from jaxtyping import Array, Float

from ._arrays import floats, safe_log, sine
from .air_response import AirResponse

# Twice the coefficient of P_2 in the phase function, (1 - gamma) / (1 + 2 gamma) with
# gamma = rho / (2 - rho), for the depolarisation rho = 0.0279 of the fit. [-]
_ANISOTROPY = 0.958725775
# Fit of the light scattered more than once, mode by mode in azimuth: constant and factor of
# ln(tau), for mode 0 before the five terms 1, mu0 + mu, mu0 mu, mu0^2 + mu^2 and (mu0 mu)^2. [-]
# (subroutine CHAND of 6S, Vermote et al., 1997; the same figures in crefl 1.7.1 and in satpy 0.60)
_MODE0_CONSTANT = (0.33243832, 0.16285370, -0.30924818, -0.10324388, 0.11493334)
_MODE0_LOGARITHM = (-6.777104e-02, 1.577425e-03, -1.240906e-02, 3.241678e-02, -3.503695e-02)
_MODE1 = (0.19666292, -5.439061e-02)
_MODE2 = (0.14545937, -2.910845e-02)
# E_1(x) + ln x for 0 < x <= 1, by powers of x; error 2e-7. [-] (M. Abramowitz and I. A. Stegun,
# "Handbook of Mathematical Functions", 1964, 5.1.53)
_EXPONENTIAL_INTEGRAL = (
    -0.57721566,
    0.99999193,
    -0.24991055,
    0.05519968,
    -0.00976004,
    0.00107857,
)


def crefl_air(
    tau: float | Float[Array | np.ndarray, "*#shape"],
    mu0: Float[Array | np.ndarray, "*#shape"],
    mu: Float[Array | np.ndarray, "*#shape"],
    relative_azimuth: Float[Array | np.ndarray, "*#shape"],
) -> AirResponse:
    """Response of pure air by crefl's formulas.

    Its `AirResponse.albedo` is crefl's rho_s = x / (1 + S x) of x = (rho - rho_ray) / (T(mu0)
    T(mu)), where rho is the bidirectional reflectance factor.

    Parameters
    ----------
    tau
        Rayleigh optical depth, up to 1. [-]
    mu0, mu
        Cosines of the solar and view zenith angle, above 0. [-]
    relative_azimuth
        0 with sun and satellite on the same side (backscatter). [rad]

    References
    ----------
    .. [1] E. F. Vermote et al., "Second Simulation of the Satellite Signal in the Solar Spectrum,
       6S: an overview", IEEE Trans. Geosci. Remote Sens., 35, 675-686, 1997, doi:10.1109/36.581987
    """
    xp, (tau, mu0, mu, relative_azimuth) = floats(tau, mu0, mu, relative_azimuth)
    down, up = _transmittance(xp, tau, mu0), _transmittance(xp, tau, mu)
    path = _path_reflectance(xp, tau, mu0, mu, relative_azimuth)
    return AirResponse(path, down * up, _spherical_albedo(xp, tau))


def _path_reflectance(xp: Any, tau: Any, mu0: Any, mu: Any, relative_azimuth: Any) -> Any:
    r"""Sum of the modes :math:`\cos m\Delta\phi` of light scattered once and more than once."""
    sines = sine(xp, mu0) * sine(xp, mu)
    phase = (
        1 + _ANISOTROPY / 8 * (3 * mu0**2 - 1) * (3 * mu**2 - 1),
        1.5 * _ANISOTROPY * mu0 * mu * sines,
        0.375 * _ANISOTROPY * sines**2,
    )
    once = -xp.expm1(-tau * (1 / mu0 + 1 / mu)) / (4 * (mu0 + mu))
    again = xp.expm1(-tau / mu0) * xp.expm1(-tau / mu)
    logarithm = safe_log(xp, tau)
    terms = (1.0, mu0 + mu, mu0 * mu, mu0**2 + mu**2, (mu0 * mu) ** 2)
    constant = sum(a * x for a, x in zip(_MODE0_CONSTANT, terms, strict=True))
    slope = sum(a * x for a, x in zip(_MODE0_LOGARITHM, terms, strict=True))
    fits = (
        constant + slope * logarithm,
        *(first + second * logarithm for first, second in (_MODE1, _MODE2)),
    )
    return sum(phase[m] * (once + again * fits[m]) * xp.cos(m * relative_azimuth) for m in range(3))


def _transmittance(xp: Any, tau: Any, mu: Any) -> Any:
    r"""Direct and diffuse, :math:`[2/3 + \mu + (2/3 - \mu)e^{-\tau/\mu}] / (4/3 + \tau)`."""
    return (2 / 3 + mu + (2 / 3 - mu) * xp.exp(-tau / mu)) / (4 / 3 + tau)


def _spherical_albedo(xp: Any, tau: Any) -> Any:
    r""":math:`[3\tau - (4 + 2\tau)E_3(\tau) + 2e^{-\tau}] / (4 + 3\tau)`."""
    series = sum(a * tau**k for k, a in enumerate(_EXPONENTIAL_INTEGRAL))
    first = series - safe_log(xp, tau)
    third = (xp.exp(-tau) * (1 - tau) + tau**2 * first) / 2
    return (3 * tau - third * (4 + 2 * tau) + 2 * xp.exp(-tau)) / (4 + 3 * tau)
