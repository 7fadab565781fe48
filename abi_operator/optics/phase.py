r"""Phase functions in closed form.

All are normalised to a mean of 1 over the sphere and expand as
:math:`P(\Theta) = \sum_l (2l + 1)\, \chi_l\, P_l(\cos\Theta)`, with :math:`\chi_0 = 1`.
"""

from typing import final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..machine.algebra import trailing
from ..optical_properties import PhaseFunction
from .pointwise import choose, pointwise

_BLOCK = 16  # powers that are products of x^1, x^2, x^4 and x^8


@pointwise
def _powers(x: Float[Array, "layer 1 *batch"], start: int, stop: int, step: int) -> Array:
    """Powers of numbers, products of x^1, x^2, x^4 ...: few operations to compile, and no loop."""
    left, square = np.arange(start, stop, step), x
    product = jnp.ones((x.shape[0], left.size, *x.shape[2:]), x.dtype)
    while np.any(left):
        odd = jnp.asarray(trailing(left % 2 == 1, x.ndim - 1))
        product = product * choose(odd, square, 1.0)
        left, square = left // 2, square * square
    return product


def _all_powers(g: Array, num_moments: int) -> Array:
    if num_moments <= _BLOCK:
        return _powers(g[:, None], 0, num_moments, 1)
    # Long series are short ones times powers: one product a moment.
    low, blocks = _powers(g[:, None], 0, _BLOCK, 1), -(-num_moments // _BLOCK)
    high = _powers(g[:, None], 0, blocks * _BLOCK, _BLOCK)
    moments = high[:, :, None] * low[:, None]
    return moments.reshape(g.shape[0], -1, *g.shape[1:])[:, :num_moments]


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

    asymmetry: Float[Array, ""] | Float[Array, "#layer *batch"]

    def moments(self, num_moments: int) -> Float[Array, "#layer moment *#batch"]:
        r"""Legendre moments g\ :sup:`l`, as products: the derivative at g = 0 is exact."""
        return _all_powers(jnp.atleast_1d(self.asymmetry), num_moments)

    def __call__(self, cos_scattering: Float[Array, "*batch"]) -> Float[Array, "#layer *batch"]:
        """Phase function; `cos_scattering` is 1 straight ahead. [-]"""
        return _henyey_greenstein(jnp.atleast_1d(self.asymmetry), cos_scattering)


@pointwise
def _henyey_greenstein(g: Array, cos_scattering: Array) -> Array:
    return _lobe(g, cos_scattering)


def _lobe(g: Array, cos_scattering: Array) -> Array:
    # A peak straight back is one straight ahead with both signs changed.
    back = g < 0
    share, along = choose(back, -g, g), choose(back, -cos_scattering, cos_scattering)
    # 1 + g^2 - 2 g cos, written so that float32 keeps its digits in a strong peak; and divided by
    # in two steps, as a slope has the square of what is divided by.
    distance = (1 - share) ** 2 + 2 * share * (1 - along)
    return (1 - g) * (1 + g) / distance / jnp.sqrt(distance)


@final
class TwoTermHenyeyGreenstein(PhaseFunction):
    r"""Two lobes, each of Henyey and Greenstein.

    .. math:: P = D\,P_{g_1} + (1 - D)\,P_{g_2}, \qquad \chi_l = D\,g_1^l + (1 - D)\,g_2^l

    `hydrometeor` takes it for crystals: what is diffracted, and the rest (`diffraction`).

    Parameters
    ----------
    first, second
        Asymmetry factors of the lobes, of each layer; between -1 and 1. [-]
    share
        Share D of the first lobe, of each layer. [-]
    """

    first: Float[Array, "layer *batch"]
    second: Float[Array, "layer *batch"]
    share: Float[Array, "layer *batch"]

    def moments(self, num_moments: int) -> Float[Array, "layer moment *batch"]:
        """Legendre moments. [-]"""
        one, other = (_all_powers(g, num_moments) for g in (self.first, self.second))
        return self.share[:, None] * one + (1 - self.share)[:, None] * other

    def __call__(self, cos_scattering: Float[Array, "*batch"]) -> Float[Array, "layer *batch"]:
        """Phase function; `cos_scattering` is 1 straight ahead. [-]"""
        return _two_lobes(self.first, self.second, self.share, cos_scattering)


@pointwise
def _two_lobes(first: Array, second: Array, share: Array, cos_scattering: Array) -> Array:
    one, other = (_lobe(g, cos_scattering) for g in (first, second))
    return share * one + (1 - share) * other


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

    beta2: Float[Array, ""] | Float[Array, "#layer *batch"]

    def moments(self, num_moments: int) -> Float[Array, "#layer moment *#batch"]:
        """Legendre moments 1, 0, beta2 / 5, 0, ... [-]"""
        beta2 = jnp.atleast_1d(self.beta2)[:, None]
        isotropic, second = (
            jnp.asarray(trailing(np.eye(1, num_moments, k=k), beta2.ndim), beta2.dtype)
            for k in (0, 2)
        )
        return isotropic + beta2 / 5 * second

    def __call__(self, cos_scattering: Float[Array, "*batch"]) -> Float[Array, "#layer *batch"]:
        """Phase function; `cos_scattering` is 1 straight ahead. [-]"""
        beta2 = trailing(jnp.atleast_1d(self.beta2), 1 + jnp.ndim(cos_scattering))
        return 1 + beta2 * (3 * cos_scattering**2 - 1) / 2
