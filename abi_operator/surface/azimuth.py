r"""Azimuth modes of a reflectance, and what else of angles the grounds share.

A reflectance is even and periodic in the relative azimuth, so that

.. math:: \rho(\Delta\phi) = \sum_m (2 - \delta_{m0})\, \rho_m \cos m\Delta\phi, \qquad
   \rho_m = \frac1\pi \int_0^\pi \rho \cos(m\Delta\phi)\, d\Delta\phi .

Nodes and weights have the axis of azimuths first and may differ between pairs of directions.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .._numerics import safe_sqrt


def sine_of(mu: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Sine of a zenith angle by its cosine; 0, with derivative 0, where that is 1. [-]"""
    return safe_sqrt((1 - mu) * (1 + mu))


def gauss_azimuths(count: int, like: Float[Array, "*n"]) -> tuple[Array, Array]:
    """Gauss-Legendre nodes in [0, pi] and weights of sum 1, ``azimuth`` and as many 1s as `like`.

    They take a cusp at exact backscatter, an end of the interval, without loss.
    """
    x, weight = np.polynomial.legendre.leggauss(count)
    shape = (count,) + (1,) * like.ndim
    azimuth = jnp.asarray(np.pi * (1 + x) / 2, like.dtype)
    return azimuth.reshape(shape), jnp.asarray(weight / 2, like.dtype).reshape(shape)


def glint_azimuths(count: int, narrowness: Float[Array, "*n"]) -> tuple[Array, Array]:
    r"""Nodes in [0, pi] that crowd towards the glint at pi, and their weights, of sum about 1.

    The midpoint rule in u of

    .. math:: \tan\frac{\pi - \Delta\phi}2 = b \tan\frac u2, \qquad
       \frac{d(\pi - \Delta\phi)}{du} = \frac{b}{\cos^2(u/2) + b^2\sin^2(u/2)},

    which is smooth and keeps the period, so that the rule still converges exponentially: where
    b = 1 it is the plain one, and else a peak of width b is spread over the whole circle.

    Parameters
    ----------
    count
        Nodes.
    narrowness
        Width b of the peak at pi, in (0, 1]. [rad]
    """
    dtype = narrowness.dtype
    u = np.pi * (np.arange(count) + 0.5) / count
    shape = (count,) + (1,) * narrowness.ndim
    sine, cosine = (jnp.asarray(f(u / 2), dtype).reshape(shape) for f in (np.sin, np.cos))
    from_glint = 2 * jnp.arctan2(narrowness * sine, cosine)
    weight = narrowness / (cosine**2 + (narrowness * sine) ** 2) / count
    return np.pi - from_glint, weight


def azimuth_mode(
    m: int | Int[Array, ""],
    reflectance: Float[Array, "azimuth *n"],
    azimuth: Float[Array, "azimuth *#n"],
    weight: Float[Array, "azimuth *#n"],
) -> Float[Array, "*n"]:
    """Mode m of a reflectance that is known at the nodes of a quadrature."""
    order = jnp.asarray(m).astype(azimuth.dtype)
    return jnp.sum(weight * jnp.cos(order * azimuth) * reflectance, axis=0)
