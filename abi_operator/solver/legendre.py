r"""Legendre functions of the azimuth modes.

Throughout the solver :math:`\Lambda_l^m(\mu) = \sqrt{(l-m)!/(l+m)!}\, P_l^m(\mu)`, without the
Condon-Shortley phase, which drops out of every product used here. With this normalisation the
addition theorem reads
:math:`P_l(\cos\Theta) = \sum_m (2-\delta_{m0}) \Lambda_l^m(\mu) \Lambda_l^m(\mu') \cos m\phi`.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .._numerics import safe_sqrt


def associated_legendre(
    num_modes: int, num_degrees: int, mu: Float[Array, "*batch"] | np.ndarray
) -> Float[Array, "mode degree *batch"] | np.ndarray:
    r"""Evaluate ``p[m, l] = Λ_l^m(mu)`` for all m below `num_modes` and l below `num_degrees`.

    Upward recursion in the degree, stable for \|mu\| <= 1:
    :math:`\sqrt{(l+1)^2-m^2}\,\Lambda_{l+1}^m = (2l+1)\mu\Lambda_l^m - \sqrt{l^2-m^2}\,
    \Lambda_{l-1}^m`, from :math:`\Lambda_m^m = \sqrt{(2m-1)!!/(2m)!!}\,(1-\mu^2)^{m/2}`. Entries
    with l < m are 0. At mu = 1 the derivative of odd modes is infinite; there, that of
    :math:`\sqrt{1-\mu^2}` is taken as 0.

    Parameters
    ----------
    num_modes, num_degrees
        Number of azimuth modes and of degrees.
    mu
        Cosines; NumPy arrays are evaluated by NumPy, in their own precision. [-]
    """
    xp = np if isinstance(mu, np.ndarray) else jnp
    # (1 - mu)(1 + mu) loses no digits near the vertical, 1 - mu^2 half of them.
    square = (1 - mu) * (1 + mu)
    sine = np.sqrt(square) if isinstance(square, np.ndarray) else safe_sqrt(square)
    diagonal = [xp.ones_like(mu)]
    for m in range(1, num_modes):
        diagonal.append(diagonal[-1] * sine * np.sqrt((2 * m - 1) / (2 * m)).item())
    start = xp.stack(diagonal)

    modes = np.arange(float(num_modes))

    def by_mode(values: np.ndarray):
        return xp.asarray(values.reshape(-1, *(1,) * mu.ndim), mu.dtype)

    degrees = []
    before, here = xp.zeros_like(start), xp.zeros_like(start)
    for degree in range(num_degrees):
        here = xp.where(by_mode(modes) == degree, start, here)
        degrees.append(here)
        above = modes <= degree
        up = np.sqrt(np.where(above, (degree + 1) ** 2 - modes**2, 1))
        down = np.sqrt(np.where(above, degree**2 - modes**2, 0))
        following = by_mode((2 * degree + 1) / up) * mu * here - by_mode(down / up) * before
        before, here = here, following
    return xp.stack(degrees, axis=1)


def legendre_series(
    moments: Float[Array, "layer moment *batch"], cosine: Float[Array, "view *batch"]
) -> Float[Array, "layer view *batch"]:
    r"""Sum a phase function from its moments, :math:`\sum_l (2l+1)\chi_l P_l(\cos\Theta)`."""

    def step(carry, x):
        total, before, here = carry
        degree, chi = x
        total = total + (2 * degree + 1) * chi[:, None] * here
        following = ((2 * degree + 1) * cosine * here - degree * before) / (degree + 1)
        return (total, here, following), None

    degrees = jnp.arange(1, moments.shape[1], dtype=cosine.dtype)
    start = jnp.ones_like(moments[:, :1] * cosine), jnp.ones_like(cosine), cosine
    (total, *_), _ = jax.lax.scan(step, start, (degrees, jnp.moveaxis(moments[:, 1:], 1, 0)))
    return total
