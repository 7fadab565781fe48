r"""The ground of the MODIS albedo product: Ross's volume and Li's geometric kernel.

Symbols: :math:`\theta_i, \theta_v` zenith angles of incident and reflected light,
:math:`\Delta\phi` the azimuth between them (0 in backscatter), :math:`\xi` the angle between them,
:math:`\cos\xi = \cos\theta_i\cos\theta_v + \sin\theta_i\sin\theta_v\cos\Delta\phi`.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._numerics import safe_sqrt
from .azimuth import azimuth_mode, gauss_azimuths, sine_of

# Weights of f_iso, f_vol and f_geo in white-sky albedo. [-] (Schaaf et al. 2002)
WHITE_SKY = (1.0, 0.189184, -1.377622)
# Coefficients of 1, s^2 and s^3, s the solar zenith angle in radians, in the black-sky albedo of
# the two kernels. [-] (W. Lucht, C. B. Schaaf and A. H. Strahler, "An algorithm for the retrieval
# of albedo from space using semiempirical BRDF models", IEEE Trans. Geosci. Remote Sens., 38,
# 977-998, 2000, doi:10.1109/36.841980)
BLACK_SKY_VOLUME = (-0.007574, -0.070987, 0.307588)
BLACK_SKY_GEOMETRIC = (-1.284909, -0.166314, 0.041840)
# Zenith angle from which on the kernels are bent: they were not fitted to anything lower. [degree]
BENT_FROM = 80.0


class RossLi(eqx.Module):
    r"""Ross-Thick and Li-Sparse-Reciprocal kernels, weighted.

    .. math:: \rho = f_{iso} + f_{vol} K_{vol} + f_{geo} K_{geo}

    The model is linear and knows no bounds: `reported` says where weights give a reflectance below
    0 or an albedo above 1, and nothing is clipped. `bent` tells what happens near the horizon.

    Parameters
    ----------
    f_iso, f_vol, f_geo
        Kernel weights, as in the files of MCD43A1. [-]
    num_azimuths
        Nodes in [0, pi] from which `modes` integrates the kernels: 64 give the first 32 modes
        to 1e-3, where K_geo reaches 40; modes beyond 2/3 of their number are worse.

    References
    ----------
    .. [1] C. B. Schaaf et al., "First operational BRDF, albedo nadir reflectance products from
       MODIS", Remote Sens. Environ., 83, 135-148, 2002, doi:10.1016/S0034-4257(02)00091-3
    """

    f_iso: Float[Array, "*#batch"]
    f_vol: Float[Array, "*#batch"]
    f_geo: Float[Array, "*#batch"]
    num_azimuths: int = eqx.field(static=True, default=64)

    def brdf(
        self,
        mu_out: Float[Array, "*#shape"],
        mu_in: Float[Array, "*#shape"],
        relative_azimuth: Float[Array, "*#shape"],
    ) -> Float[Array, "*shape"]:
        """Bidirectional reflectance factor. [-]

        Parameters
        ----------
        mu_out, mu_in
            Cosines of the zenith angles of reflected and incident light, both above 0. [-]
        relative_azimuth
            0 where light is sent back to where it came from, pi in the glint. [rad]
        """
        volume, geometric = kernels(mu_out, mu_in, relative_azimuth)
        return self.f_iso + self.f_vol * volume + self.f_geo * geometric

    def modes(
        self,
        m: int | Int[Array, ""],
        mu_out: Float[Array, "*#shape"],
        mu_in: Float[Array, "*#shape"],
    ) -> Float[Array, "*shape"]:
        """Azimuth mode m of `brdf`. [-]"""
        mu_out, mu_in = jnp.broadcast_arrays(mu_out, mu_in)
        azimuth, weight = gauss_azimuths(self.num_azimuths, mu_out)
        volume, geometric = (
            azimuth_mode(m, kernel, azimuth, weight)
            for kernel in kernels(mu_out[None], mu_in[None], azimuth)
        )
        # The constant is exact, where a quadrature would leave rounding in the modes above 0.
        constant = jnp.where(jnp.asarray(m) == 0, self.f_iso, 0)
        return constant + self.f_vol * volume + self.f_geo * geometric

    def white_sky_albedo(self) -> Float[Array, "*batch"]:
        """Share of isotropic light that is reflected, by the constants of the product [1]_. [-]"""
        isotropic, volume, geometric = WHITE_SKY
        return isotropic * self.f_iso + volume * self.f_vol + geometric * self.f_geo

    def black_sky_albedo(self, mu0: Float[Array, "*#batch"]) -> Float[Array, "*batch"]:
        """Share of a beam that is reflected, by the polynomials of the product. [-]

        Lucht et al. (2000) fitted them for the sun above 10 degrees or so; `directional_albedo`
        integrates the reflectance itself.

        Parameters
        ----------
        mu0
            Cosine of the beam's zenith angle. [-]
        """
        square = _zenith_squared(mu0)
        cube = square * safe_sqrt(square)
        volume, geometric = (
            c0 + c2 * square + c3 * cube for c0, c2, c3 in (BLACK_SKY_VOLUME, BLACK_SKY_GEOMETRIC)
        )
        return self.f_iso + self.f_vol * volume + self.f_geo * geometric


def bent(mu: Float[Array, "*n"]) -> Float[Array, "*n"]:
    r"""Cosine with which the kernels are evaluated: kept off the horizon, where they are infinite.

    Up to a zenith angle of 80 degrees it is the cosine itself, beyond

    .. math:: \mu_c \frac{1 + (\mu/\mu_c)^2}2, \qquad \mu_c = \cos 80°,

    which meets it with the same slope and falls to :math:`\mu_c / 2`, 85 degrees, on the horizon
    with slope 0. As sun and view are bent alike, the kernels stay reciprocal, and as all of
    their geometry follows from the bent angles, they stay kernels of directions that exist.
    """
    cut = float(np.cos(np.deg2rad(BENT_FROM)))
    return jnp.where(mu < cut, 0.5 * (cut + mu * mu / cut), mu)


def kernels(
    mu_out: Float[Array, "*#shape"],
    mu_in: Float[Array, "*#shape"],
    relative_azimuth: Float[Array, "*#shape"],
) -> tuple[Float[Array, "*shape"], Float[Array, "*shape"]]:
    r"""Ross-Thick and Li-Sparse-Reciprocal kernels at `bent` angles. [-]

    .. math::
       K_{vol} &= \frac{(\pi/2 - \xi)\cos\xi + \sin\xi}{\cos\theta_i + \cos\theta_v} - \frac\pi4 \\
       K_{geo} &= O - \sec\theta_i - \sec\theta_v
                  + \tfrac12 (1 + \cos\xi)\sec\theta_i\sec\theta_v \\
       O &= \frac1\pi (t - \sin t\cos t)(\sec\theta_i + \sec\theta_v) \\
       \cos t &= 2\,\frac{\sqrt{\tan^2\theta_i + \tan^2\theta_v - 2\tan\theta_i\tan\theta_v
                  \cos\Delta\phi + (\tan\theta_i\tan\theta_v\sin\Delta\phi)^2}}
                  {\sec\theta_i + \sec\theta_v}

    for crowns as high as wide (b/r = 1) at twice their half-height (h/b = 2); O is 0 where cos t
    would be above 1 and shadows do not overlap. O has a cusp at exact backscatter, the hot spot,
    where the derivative returned is the mean of its two sides.

    Parameters
    ----------
    mu_out, mu_in
        Cosines of the zenith angles of reflected and incident light, both above 0. [-]
    relative_azimuth
        0 where light is sent back to where it came from, pi in the glint. [rad]

    References
    ----------
    .. [1] W. Wanner, X. Li and A. H. Strahler, "On the derivation of kernels for kernel-driven
       models of bidirectional reflectance", J. Geophys. Res., 100, 21077-21089, 1995,
       doi:10.1029/95JD02371
    """
    out, into = bent(mu_out), bent(mu_in)
    sines = sine_of(out) * sine_of(into)
    backward = jnp.cos(relative_azimuth)
    cos_angle = out * into + sines * backward
    volume = _ross_function(cos_angle) / (out + into) - np.pi / 4

    secants = 1 / (out * into)
    tangents = sines * secants
    # tan^2 + tan^2 - 2 tan tan cos phi, without its cancellation near the hot spot.
    apart = (sine_of(out) / out - sine_of(into) / into) ** 2
    distance = apart + 4 * tangents * jnp.sin(relative_azimuth / 2) ** 2
    distance = distance + (tangents * jnp.sin(relative_azimuth)) ** 2
    mean_secant = 0.5 * (out + into) * secants
    overlap = _overlap_function(safe_sqrt(distance) / mean_secant) * 2 * mean_secant / np.pi
    geometric = overlap - 2 * mean_secant + 0.5 * (1 + cos_angle) * secants
    return volume, geometric


@jax.custom_jvp
def _ross_function(c: Array) -> Array:
    """(pi/2 - xi) cos xi + sin xi at c = cos xi: smooth at xi = 0 although arccos is not."""
    return c * _arcsine(c) + sine_of(c)


@_ross_function.defjvp
def _ross_function_jvp(primals, tangents):
    (c,), (tangent,) = primals, tangents
    return _ross_function(c), _arcsine(c) * tangent


def _arcsine(c: Array) -> Array:
    """Arc sine, with rounding above 1 or below -1 allowed; its derivative there is 0."""
    return jnp.arctan2(c, sine_of(c))


@jax.custom_jvp
def _overlap_function(x: Array) -> Array:
    """T - sin t cos t at x = cos t >= 0; 0 from 1 on, which it meets with slope 0."""
    return jnp.where(x < 1, jnp.arctan2(sine_of(x), x) - x * sine_of(x), 0)


@_overlap_function.defjvp
def _overlap_function_jvp(primals, tangents):
    (x,), (tangent,) = primals, tangents
    return _overlap_function(x), -2 * sine_of(x) * tangent


@jax.custom_jvp
def _zenith_squared(mu: Array) -> Array:
    """Square of the zenith angle, whose derivative in the cosine is -2 at the zenith. [rad2]"""
    return jnp.arctan2(sine_of(mu), mu) ** 2


@_zenith_squared.defjvp
def _zenith_squared_jvp(primals, tangents):
    (mu,), (tangent,) = primals, tangents
    sine = sine_of(mu)
    upright = sine == 0
    ratio = jnp.where(upright, 1, jnp.arctan2(sine, mu) / jnp.where(upright, 1, sine))
    return _zenith_squared(mu), -2 * ratio * tangent
