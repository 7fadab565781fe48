"""What all pixels of an image measure, linearised, and the joint sum with its derivative."""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from abi_operator import State
from abi_operator.machine.speed import Kept

from ..chunks import map_chunks
from ..forward import ForwardModel
from ..inverse import value_and_jacobian
from ..observation import Observation
from ..prior import Prior
from .precision import Smoothness


class Linearised(NamedTuple):
    """Whitened residuals of the measurements and their Jacobians in z, block by block."""

    residual: Float[Array | np.ndarray, "pixel band"]
    jacobian: Float[Array | np.ndarray, "pixel band x"]


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
    found = map_chunks(partial(_linearise_chunk, forward), prior, observations, states, z)
    fine = np.isfinite(found.residual).all(axis=1) & np.isfinite(found.jacobian).all(axis=(1, 2))
    return Linearised(
        np.where(fine[:, None], found.residual, 0),
        np.where(fine[:, None, None], found.jacobian, 0),
    )


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

        return Linearised(*value_and_jacobian(residual, z))

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
