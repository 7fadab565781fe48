r"""Phase functions in closed form.

All are normalised to a mean of 1 over the sphere and expand as
:math:`P(\Theta) = \sum_l (2l + 1)\, \chi_l\, P_l(\cos\Theta)`, with :math:`\chi_0 = 1`.
"""

from typing import final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..optical_properties import PhaseFunction

_BLOCK = 20  # moments written out at a time


def _powers(x: Float[Array, " layer"], num: int) -> list[Float[Array, " layer"]]:
    """x^0 to x^(num - 1)."""
    powers = [jnp.ones_like(x)]
    for _ in range(num - 1):
        powers.append(powers[-1] * x)
    return powers


@final
class HenyeyGreenstein(PhaseFunction):
    r"""Phase function of Henyey and Greenstein (1941) [1]_.

    .. math:: P(\Theta) = \frac{1 - g^2}{(1 + g^2 - 2 g \cos\Theta)^{3/2}}, \qquad \chi_l = g^l

    Parameters
    ----------
    asymmetry
        Mean cosine of the scattering angle, g, of all layers or of each; -1 < g < 1. [-]

    References
    ----------
    .. [1] L. G. Henyey and J. L. Greenstein, "Diffuse radiation in the galaxy", Astrophys. J., 93,
       70-83, 1941, doi:10.1086/144246
    """

    asymmetry: Float[Array, ""] | Float[Array, " layer"]

    def moments(self, num_moments: int) -> Float[Array, "#layer moment"]:
        r"""Legendre moments g\ :sup:`l`, as products: the derivative at g = 0 is exact."""
        g = jnp.atleast_1d(self.asymmetry)
        # Written out, as products of short series and powers: several times faster than
        # `jnp.cumprod`, backwards above all, with few operations to compile.
        block = min(_BLOCK, num_moments)
        low = _powers(g, block)
        high = _powers(low[-1] * g, -(-num_moments // block))
        moments = jnp.stack(high, axis=1)[:, :, None] * jnp.stack(low, axis=1)[:, None, :]
        return moments.reshape(g.shape[0], -1)[:, :num_moments]

    def __call__(self, cos_scattering: Float[Array, ""]) -> Float[Array, " #layer"]:
        """Phase function; `cos_scattering` is 1 straight ahead. [-]"""
        g = jnp.atleast_1d(self.asymmetry)
        # 1 + g^2 - 2 g cos, written so that float32 keeps its digits in a strong forward peak.
        distance = (1 - g) ** 2 + 2 * g * (1 - cos_scattering)
        return (1 - g) * (1 + g) / (distance * jnp.sqrt(distance))


@final
class RayleighPhase(PhaseFunction):
    r"""Phase function of air for unpolarised light (Hansen and Travis [1]_).

    .. math:: P(\Theta) = 1 + \beta_2 P_2(\cos\Theta), \qquad \chi_2 = \beta_2 / 5

    Parameters
    ----------
    beta2
        Coefficient of the second Legendre polynomial, of all layers or of each: 1/2 for isotropic
        molecules, less by their depolarisation. [-]

    References
    ----------
    .. [1] J. E. Hansen and L. D. Travis, "Light scattering in planetary atmospheres", Space Sci.
       Rev., 16, 527-610, 1974, doi:10.1007/BF00168069
    """

    beta2: Float[Array, ""] | Float[Array, " layer"]

    def moments(self, num_moments: int) -> Float[Array, "#layer moment"]:
        """Legendre moments 1, 0, beta2 / 5, 0, ... [-]"""
        beta2 = jnp.atleast_1d(self.beta2)[:, None]
        isotropic = jnp.asarray(np.eye(1, num_moments), beta2.dtype)
        second = jnp.asarray(np.eye(1, num_moments, k=2), beta2.dtype)
        return isotropic + beta2 / 5 * second

    def __call__(self, cos_scattering: Float[Array, ""]) -> Float[Array, " #layer"]:
        """Phase function; `cos_scattering` is 1 straight ahead. [-]"""
        return 1 + jnp.atleast_1d(self.beta2) * (3 * cos_scattering**2 - 1) / 2
