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

from ..._numerics import safe_sqrt


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
    in_numpy = isinstance(mu, np.ndarray)
    xp = np if in_numpy else jnp
    # (1 - mu)(1 + mu) loses no digits near the vertical, 1 - mu^2 half of them.
    square = (1 - mu) * (1 + mu)
    sine = np.sqrt(square) if isinstance(square, np.ndarray) else safe_sqrt(square)

    def step(carry, row):
        before, here, diagonal = carry
        is_first, up, down, next_on_diagonal = row
        here = xp.where(is_first, diagonal, here)
        following = up * mu * here - down * before
        return (here, following, diagonal * sine * next_on_diagonal), here

    degree, mode = np.arange(float(num_degrees))[:, None], np.arange(float(num_modes))
    below = np.sqrt(np.where(mode <= degree, (degree + 1) ** 2 - mode**2, 1))
    down = np.sqrt(np.where(mode <= degree, degree**2 - mode**2, 0)) / below
    ratio = np.sqrt((2 * degree + 1) / (2 * degree + 2))

    def rows(x: np.ndarray):
        return x.reshape(*x.shape, *(1,) * mu.ndim)

    numbers = [rows(x).astype(mu.dtype) for x in ((2 * degree + 1) / below, down, ratio)]
    all_rows = rows(mode == degree), *numbers
    nothing = xp.zeros((num_modes, *mu.shape), mu.dtype)
    carry = nothing, nothing, xp.ones_like(mu[None])
    if in_numpy:
        found = []
        for k in range(num_degrees):
            carry, here = step(carry, [x[k] for x in all_rows])
            found.append(here)
        return np.stack(found, axis=1)
    # A loop: written out, each degree's functions would be computed anew for those above it.
    found = jax.lax.scan(step, carry, jax.tree.map(jnp.asarray, all_rows))[1]
    return jnp.swapaxes(found, 0, 1)


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
