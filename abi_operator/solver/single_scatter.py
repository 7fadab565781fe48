"""Light scattered once, exactly, and its angle."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._numerics import safe_sqrt


def cos_scattering_angle(
    mu0: Float[Array, "*batch"],
    mu: Float[Array, "*batch"],
    relative_azimuth: Float[Array, "*batch"],
) -> Float[Array, "*batch"]:
    r"""Cosine of the angle by which sunlight is turned towards the satellite. [-]

    :math:`\cos\Theta = -\mu\mu_0 - \sqrt{1-\mu^2}\sqrt{1-\mu_0^2}\cos\Delta\phi` with the relative
    azimuth 0 where sun and satellite stand on the same side; -1 is exact backscatter.
    """
    sines = safe_sqrt(1 - mu * mu) * safe_sqrt(1 - mu0 * mu0)
    return -mu * mu0 - sines * jnp.cos(relative_azimuth)


def exact_single_scattering(
    tau: Float[Array, "layer *batch"],
    scattering_ratio: Float[Array, "layer *batch"],
    phase_function: Float[Array, "layer *batch"],
    mu0: Float[Array, "*batch"],
    mu: Float[Array, "*batch"],
) -> Float[Array, "*batch"]:
    r"""Reflectance of light scattered once (the correction "TMS").

    .. math::
       \sum_i \frac{\omega_i P_i(\Theta)}{1-\omega_i f_i}\, e^{-s\sum_{j<i}\tau'_j}\,
       \frac{1 - e^{-s\tau'_i}}{4\mu\mu_0 s}, \qquad s = 1/\mu + 1/\mu_0 .

    Parameters
    ----------
    tau
        delta-M scaled optical depths, top first. [-]
    scattering_ratio
        omega / (1 - omega f), of the unscaled single-scattering albedo. [-]
    phase_function
        Exact phase function at the scattering angle, mean 1 over the sphere. [-]
    mu0, mu
        Cosines of sun and view. [-]

    References
    ----------
    .. [1] T. Nakajima and M. Tanaka, "Algorithms for radiative intensity calculations in moderately
       thick atmospheres using a truncation approximation", J. Quant. Spectrosc. Radiat. Transfer,
       40, 51-69, 1988, doi:10.1016/0022-4073(88)90031-3
    """
    secant = 1 / mu + 1 / mu0
    above = jnp.cumsum(tau, axis=0) - tau
    source = scattering_ratio * phase_function * jnp.exp(-secant * above)
    return jnp.sum(source * -jnp.expm1(-secant * tau), axis=0) / (4 * mu * mu0 * secant)
