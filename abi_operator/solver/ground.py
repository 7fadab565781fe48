"""The ground under the stack."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .bordered import Bordered
from .quadrature import double_gauss


def lambertian(
    albedo: Float[Array, "*batch"],
    mu0: Float[Array, "*batch"],
    mu: Float[Array, "*batch"],
    num_streams: int,
) -> Bordered:
    r"""Admittance of a Lambertian ground in azimuth mode 0; that of every other has albedo 0.

    The reflection is R = 2a v r^T with v = 1 on nodes and view and r = (w mu, mu0, 0), so that
    :math:`Y = 1 - 4a/(1+a)\, rr^T` in the symmetric scaling, :math:`r = (\sqrt{w\mu}, \mu_0,
    \mu)`: regular at albedo 1.
    """
    nodes, weights = double_gauss(num_streams)
    shape = (nodes.size,) + (1,) * albedo.ndim
    r = jnp.asarray(np.sqrt(weights * nodes), albedo.dtype).reshape(shape)
    identity = jnp.eye(nodes.size, dtype=albedo.dtype).reshape(shape[:1] + shape)
    factor = 4 * albedo / (1 + albedo)
    core = identity - factor * r[:, None] * r[None]
    border = -factor * r[:, None] * jnp.stack([mu0, mu])
    ones = jnp.ones_like(mu0)
    return Bordered(core, border, jnp.stack([ones, ones]), -factor * mu0 * mu)
