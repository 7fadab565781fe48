"""Light scattered or reflected once, exactly, and its angle."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..._numerics import safe_sqrt
from ...machine.algebra import fenced
from ...machine.kernels import one_kernel
from .mode_layers import read

# Below which 1 - exp(-x) is right to rounding by so many terms of its series, in double precision
# and in single.
_THIN, _TERMS, _TERMS_OF_FLOAT32 = 0.05, 8, 4


def cos_scattering_angle(
    mu0: Float[Array, "*#batch"],
    mu: Float[Array, "*#batch"],
    relative_azimuth: Float[Array, "*#batch"],
) -> Float[Array, "*batch"]:
    r"""Cosine of the angle by which sunlight is turned towards the satellite. [-]

    :math:`\cos\Theta = -\mu\mu_0 - \sqrt{1-\mu^2}\sqrt{1-\mu_0^2}\cos\Delta\phi` with the relative
    azimuth 0 where sun and satellite stand on the same side; -1 is exact backscatter.
    """
    sines = safe_sqrt((1 - mu) * (1 + mu)) * safe_sqrt((1 - mu0) * (1 + mu0))
    return -mu * mu0 - sines * jnp.cos(relative_azimuth)


def exact_single_scattering(
    tau: Float[Array, "layer *batch"],
    scattering_ratio: Float[Array, "layer *batch"],
    phase_function: Float[Array, "layer view *batch"],
    mu0: Float[Array, "*batch"],
    mu: Float[Array, "view *batch"],
    sun_secants: Float[Array, "layer *batch"],
) -> Float[Array, "view *batch"]:
    r"""Reflectance of light scattered once (the correction "TMS").

    .. math::
       \sum_i \frac{\omega_i P_i(\Theta)}{1-\omega_i f_i}\, e^{-\sum_{j<i}s_j\tau'_j}\,
       \frac{1 - e^{-s_i\tau'_i}}{4\mu\mu_0 s_i}, \qquad s_i = 1/\mu + 1/\mu_{0,i} .

    Parameters
    ----------
    tau
        delta-M scaled optical depths, top first. [-]
    scattering_ratio
        omega / (1 - omega f), of the unscaled single-scattering albedo. [-]
    phase_function
        Exact phase function at the scattering angle, mean 1 over the sphere. [-]
    mu0, mu
        Cosines of sun and views. [-]
    sun_secants
        By which the beam is attenuated in each layer: 1 / mu0 in plane-parallel air. [-]

    References
    ----------
    .. [1] T. Nakajima and M. Tanaka, "Algorithms for radiative intensity calculations in moderately
       thick atmospheres using a truncation approximation", J. Quant. Spectrosc. Radiat. Transfer,
       40, 51-69, 1988, doi:10.1016/0022-4073(88)90031-3
    """
    return _scattered_once(tau, scattering_ratio, phase_function, mu0, mu, sun_secants)


@jax.custom_jvp
def _scattered_once(*arguments):
    """From the top down, with one exponential function a layer: faster than `_summed`."""
    mu = arguments[4]
    return one_kernel(_from_the_top, 1, num_beams=len(mu))(*arguments)


def _from_the_top(tau, scattering_ratio, phase_function, mu0, mu, sun_secants):
    def one(k, state):
        total, above = state
        secant = 1 / mu + read(sun_secants, k)
        x = secant * read(tau, k)
        through = jnp.exp(-x)
        own = read(scattering_ratio, k) * read(phase_function, k) / secant
        return total + above * own * extinguished(x, through), above * through

    start = jnp.zeros_like(mu * mu0), jnp.ones_like(mu * mu0)
    total, _ = jax.lax.fori_loop(0, tau.shape[0], one, start)
    return total / (4 * mu * mu0)


@_scattered_once.defjvp
def _scattered_once_jvp(primals, tangents):
    # Else it would be computed column by column, where a result is turned to have the batch first.
    return jax.jvp(fenced(_summed), primals, tangents)


def extinguished(x: Float[Array, "*n"], through: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """1 - exp(-x) from exp(-x), by its series where a difference would lose digits."""
    terms = _TERMS if x.dtype == jnp.float64 else _TERMS_OF_FLOAT32
    series = jnp.ones_like(x)
    for k in range(terms, 1, -1):
        series = 1 - x / k * series
    return jnp.where(x < _THIN, x * series, 1 - through)


def _summed(tau, scattering_ratio, phase_function, mu0, mu, sun_secants):
    """The same in whole arrays, whose derivatives JAX takes."""
    secant = 1 / mu + sun_secants[:, None]
    slant = secant * tau[:, None]
    # Summed without the layer itself: taking a thick layer out again would cost its digits. Not by
    # `jnp.cumsum`, a sum over windows that XLA's CPU backend computes number by number.
    layers_above = jnp.tri(tau.shape[0], k=-1, dtype=tau.dtype)
    above = jnp.tensordot(layers_above, slant, axes=1, precision=jax.lax.Precision.HIGHEST)
    source = scattering_ratio[:, None] * phase_function * jnp.exp(-above)
    return jnp.sum(source * -jnp.expm1(-slant) / secant, axis=0) / (4 * mu * mu0)


def direct_transmission(
    tau: Float[Array, "layer *batch"],
    mu: Float[Array, "view *batch"],
    sun_secants: Float[Array, "layer *batch"],
) -> Float[Array, "view *batch"]:
    """Share of the beam that meets nothing from the sun to the ground and on to each view. [-]

    Times the ground's reflectance factor it is light reflected once and never scattered; `tau` is
    delta-M scaled, so that light scattered into the forward peak counts as unscattered.
    """
    return jnp.exp(-jnp.sum((1 / mu + sun_secants[:, None]) * tau[:, None], axis=0))
