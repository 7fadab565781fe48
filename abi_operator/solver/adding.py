r"""The stack of layers, from the ground up.

A stack is summarised by its admittance Y = (1 - R)(1 + R)^{-1}, R its reflection, at its upper
face: t = -Y s. Adding a layer is the addition theorem of tanh; no reflection or transmission of a
layer is ever formed. The answer of a mode is the sun -> view entry of the final R.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._numerics import inverse, matmul
from .bordered import Bordered, between


def add_layer(
    stack: Bordered, admittance: Bordered, impedance: Bordered, tau: Float[Array, "*batch"]
) -> Bordered:
    r"""Put a layer on a stack.

    With the layer's half-layer admittance Y_e, impedance Z (times h) and h = tau / 2,
    :math:`Y \leftarrow Y + 2Y_e - h(Y + Y_e)[hY + (Z + hY_e)/2]^{-1}(Y + Y_e)`.
    The beams' own entries of Y are 1 whatever lies below, and are set so.
    """
    h = 0.5 * tau
    total = stack + admittance
    middle = h * stack + 0.5 * (impedance + h * admittance)
    added = total + admittance - h * between(total, middle, total)
    return eqx.tree_at(lambda m: m.diagonal, added, jnp.ones_like(added.diagonal))


def reflection_corner(stack: Bordered, mu: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
    r"""Sun -> view entry of R = 2(1 + Y)^{-1} - 1 at the top of a stack."""
    num_nodes = stack.core.shape[0]
    identity = jnp.eye(num_nodes, dtype=mu.dtype).reshape(num_nodes, num_nodes, *(1,) * mu.ndim)
    sun = matmul(inverse(stack.core + identity), stack.border[:, :1])[:, 0]
    return (jnp.sum(stack.border[:, 1] * sun, axis=0) - stack.corner) / (2 * mu)
