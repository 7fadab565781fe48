"""What all pixels of an image measure, linearised, and the joint sum with its derivative."""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from abi_operator import State
from abi_operator.machine.speed import Kept

from ..chunks import map_chunks
from ..forward import ForwardModel
from ..inverse import value_and_jacobian
from ..observation import Observation
from ..prior import Prior
from .precision import Smoothness


class Linearised(NamedTuple):
    """Whitened residuals of the measurements and their Jacobians in z, block by block.

    Both are 0 of pixels that are not `fine`, of which something was not finite, or so large that
    its square is not: in a sum over the image it would leave no other pixel a number.
    """

    residual: Float[Array | np.ndarray, "pixel band"]
    jacobian: Float[Array | np.ndarray, "pixel band x"]
    fine: Bool[Array | np.ndarray, " pixel"]


def linearised(
    forward: ForwardModel,
    observations: Observation,
    states: State,
    prior: Prior,
    z: Float[np.ndarray, "pixel x"],
) -> Linearised:
    """Linearise the measurements of all pixels; one that is not finite tells nothing.

    Parameters
    ----------
    forward, observations, states
        As of `retrieve_pixels`, with measurements that can be used.
    prior
        One of each pixel.
    z
        Where. [-]
    """
    return map_chunks(partial(_linearise_chunk, forward), prior, observations, states, z)


@Kept
def _linearise_chunk(
    forward: ForwardModel,
    priors: Prior,
    observations: Observation,
    states: State,
    z: jax.Array,
) -> Linearised:
    def of_one(prior: Prior, observation: Observation, state: State, z: Array) -> Linearised:
        def residual(z: Array) -> Array:
            x = jnp.asarray(prior.x_prior) + prior.root @ z
            return observation.departure(forward, x, state)

        value, jacobian = value_and_jacobian(residual, z)
        # As large as the square of a gradient becomes, which conjugate gradients need.
        fine = jnp.isfinite(jnp.sum(value**2) * jnp.sum(jacobian**2))
        fine &= jnp.isfinite(jnp.sum(value**2)) & jnp.isfinite(jnp.sum(jacobian**2))
        return Linearised(jnp.where(fine, value, 0), jnp.where(fine, jacobian, 0), fine)

    return jax.vmap(of_one)(priors, observations, states, z)


def joint_cost(
    here: Linearised, smooth: Smoothness, z: Float[Array | np.ndarray, "pixel x"]
) -> float:
    """The sum that is minimised. [-]"""
    return float(jnp.sum(here.residual**2) + jnp.sum(smooth.root(jnp.asarray(z)) ** 2))


def joint_gradient(
    here: Linearised, smooth: Smoothness, z: Float[Array, "pixel x"]
) -> Float[Array, "pixel x"]:
    """Half of the derivative of the sum: J^T r + Q z. [-]"""
    return jnp.einsum("pbx,pb->px", here.jacobian, here.residual) + smooth(z)
