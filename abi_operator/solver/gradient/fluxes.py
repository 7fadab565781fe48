r"""The derivative of the spherical albedo: of what isotropic light from above sends back.

With the admittance Y of a stack at its upper face and 1 the vector of isotropic light, isotropic
radiance 1 from above makes :math:`s = 2(1+Y)^{-1} 1`, and the share of its irradiance that leaves
again is

.. math:: S = 2\,1^T s - 1 = 4\,1^T (1+Y)^{-1} 1 - 1, \qquad
   dS = -4 F^T\, dY\, F, \qquad F = (1+Y)^{-1} 1 .

No beam takes part: source and adjoint are one field of nodes, which goes down the layers like any
other (`emitting_mode`).
"""

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from ...machine.algebra import matmul
from ..method.absorption import of_ground
from ..method.adding import top
from ..method.azimuth import mode_kernels
from ..method.bordered import Bordered
from ..method.doublings import Doublings
from ..method.ground import black
from ..method.layer import ModeKernels, node_functions
from ..method.mode_layers import Order
from .emitting_mode import Air, slopes_of_mode
from .fields import Fields
from .room import Keeper
from .thermal import isotropic_nodes


@jax.custom_jvp
def spherical_albedo(air: Air, doublings: Doublings) -> Float[Array, "*batch"]:
    """Of layers over a black ground, seen from above. [-]

    Made for its derivative, beside which it is found.
    """
    return spherical_albedo_and_gradient(air, doublings)[0]


@partial(spherical_albedo.defjvp, symbolic_zeros=True)
def _spherical_albedo_jvp(primals, tangents):
    value, gradient = spherical_albedo_and_gradient(*primals)
    change = jnp.zeros_like(value)
    for slope, tangent in zip(jax.tree.leaves(gradient), jax.tree.leaves(tangents[0]), strict=True):
        if not isinstance(tangent, SymbolicZero):
            change = change + jnp.sum(slope * tangent, axis=tuple(range(slope.ndim - value.ndim)))
    return value, change


@jax.custom_jvp
def spherical_albedo_and_gradient(
    air: Air, doublings: Doublings
) -> tuple[Float[Array, "*batch"], Air]:
    """The same, and its slopes, of each column its own. `Doublings.most` must be given."""
    if doublings.most is None:
        raise TypeError("slopes need a largest number of doublings.")
    tau, num_nodes = air.layers.tau, air.layers.moments.shape[1]
    one = jnp.ones((), tau.dtype)
    ground = black(jnp.ones_like(tau, shape=(2, *tau.shape[1:])), 2 * num_nodes)
    answer, _, _, found = slopes_of_mode(
        air,
        None,
        doublings,
        False,
        Order(0 * one, one),
        _kernels_of_the_mean(num_nodes, tau[0]),
        (ground, of_ground(ground, jnp.ones_like(tau[0]))),
        None,
        _at_the_top,
        jax.tree.map(jnp.zeros_like, air),
        Keeper(tau, num_nodes, doublings.most).empty(),
    )
    return answer, found.air


@spherical_albedo_and_gradient.defjvp
def _second_derivative(primals, tangents):
    air, doublings = primals

    def written_out(air):
        return spherical_albedo_and_gradient.fun(air, doublings.written_out())

    return jax.jvp(written_out, (air,), tangents[:1])


def _kernels_of_the_mean(
    num_nodes: int, like: Float[Array, "*batch"]
) -> tuple[ModeKernels, ModeKernels]:
    """For A and for B, with beams that neither feed nor are fed."""
    functions = node_functions(2 * num_nodes, 1)[0]
    beams = jnp.zeros((2, num_nodes, *like.shape), like.dtype)
    a, b = (mode_kernels(jnp.asarray(functions[k::2].T, like.dtype), beams) for k in (0, 1))
    return a, b


def _at_the_top(stack: Bordered, _: None) -> tuple[Any, Fields]:
    root = isotropic_nodes(stack.core)
    light = matmul(top(stack).inverse, root)
    nothing = jnp.zeros_like(stack.diagonal)
    answer = 4 * jnp.sum(root * light, axis=(0, 1)) - 1
    return answer, Fields(jnp.concatenate([light, -4 * light], axis=1), nothing, nothing)
