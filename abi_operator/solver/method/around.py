r"""Layers that stay, above and below others: what they are to whatever lies between.

What lies below is a stack, of admittance Y at its upper face (`adding`), as any ground is. What
lies above is known by its own admittance Y_a seen from below, that of a stack of its layers in
reverse order under which is free space; by the light F that each beam makes at its lower face over
a black ground; and by what it reflects then, R_a. Over a stack Y, with :math:`\Delta = Y - 1`,
light there and reflection are

.. math:: F' = F - (Y_a + Y)^{-1}\Delta F, \qquad
   R = R_a - \tfrac12 F_v^T\,\Delta\,F'_s,

of which the derivative in Y is :math:`-\tfrac12\,pair(F')`, as at the top of a stack without any
(`gradient.mode`): then F is 1 at its own beam and 0 elsewhere, Y_a = 1 and R_a = 0.

On the way down F follows from the quotients of the adding steps, layer by layer, as in
`gradient.mode`: :math:`F \leftarrow F - h S^{-1}(Y + Y_e) F`.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.algebra import matmul, total
from ...machine.elimination import inverse
from ...machine.kernels import one_kernel
from .adding import add_layer, add_layer_and_quotient, top
from .bordered import Bordered

HalfLayer = Callable[[Any, Array], tuple[Bordered, Bordered, Array]]
"""Half-layer admittance, impedance and thickness of one of some layers by its floating number."""


class Above(NamedTuple):
    """Layers above others, in one mode.

    Parameters
    ----------
    core
        Y_a, nodes to nodes.
    nodes
        F of each beam at the nodes; of the views, that of their adjoint.
    own
        F at the beam itself: how much of it passes. [-]
    reflected
        Twice the reflectance towards each view over a black ground.
    """

    core: Float[Array, "node node *batch"]
    nodes: Float[Array, "node beam *batch"]
    own: Float[Array, "beam *batch"]
    reflected: Float[Array, "view *batch"]

    def over(
        self, stack: Bordered
    ) -> tuple[Float[Array, "view *batch"], Float[Array, "node beam *batch"]]:
        """Twice the reflectance towards each view over a stack, and F' at the nodes."""
        core, own = self.core, self.own
        delta = stack.core - _identity(core)
        driven = matmul(delta, self.nodes) + stack.border * own
        nodes = self.nodes - matmul(inverse(stack.core + core), driven)
        sun = nodes[:, :1]
        changed = matmul(delta, sun) + stack.border[:, :1] * own[:1]
        to_views = total(stack.border[:, 1:] * sun) + stack.corner * own[:1]
        seen = total(self.nodes[:, 1:] * changed) + own[1:] * to_views
        return self.reflected - 0.5 * seen, nodes


def put_on(
    stack: Bordered, half_layer: HalfLayer, layers: Any, numbers: Float[Array, " layer"]
) -> Bordered:
    """A stack with layers of these numbers on it, one after the other."""

    def one(stack, layers, number):
        return add_layer(stack, *half_layer(layers, number))

    one = _compiled(one, stack, numbers)
    return jax.lax.scan(lambda x, number: (one(x, layers, number), None), stack, numbers)[0]


def above(
    black: Bordered, half_layer: HalfLayer, layers: Any, numbers: Float[Array, " layer"]
) -> Above:
    """Layers of these numbers, top first, above others; `black` is the admittance of free space."""

    def one(stack, layers, number):
        admittance, impedance, tau = half_layer(layers, number)
        stack, quotient = add_layer_and_quotient(stack, admittance, impedance, tau)
        return stack, (quotient.core.joined(), quotient.border.joined(), quotient.ratio, 0.5 * tau)

    def down(light, step):
        nodes, own = light
        core, border, ratio, h = step
        nodes = nodes - h * (matmul(core, nodes) + border * own)
        return (nodes, own - h * ratio * own), None

    one = _compiled(one, black, numbers)
    up = lambda x, number: one(x, layers, number)  # noqa: E731
    stack, steps = jax.lax.scan(up, black, numbers, reverse=True)
    closed = top(stack)
    light = -matmul(closed.inverse, stack.border), jnp.ones_like(stack.diagonal)
    (nodes, own), _ = jax.lax.scan(down, light, steps)
    from_below = put_on(black, half_layer, layers, numbers)
    return Above(from_below.core, nodes, own, closed.reflection())


def _compiled(
    function: Callable[..., Any], stack: Bordered, numbers: Float[Array, " layer"]
) -> Callable[..., Any]:
    """As one kernel, but of the only layer, whose number would be of no use (`machine.kernels`)."""
    if len(numbers) < 2:
        return function
    num_nodes, num_beams = stack.border.shape[:2]
    return one_kernel(function, num_nodes, in_parts=True, num_beams=num_beams)


def _identity(core: Float[Array, "node node *batch"]) -> Float[Array, "node node *#batch"]:
    num_nodes = core.shape[0]
    identity = jnp.eye(num_nodes, dtype=core.dtype)
    return identity.reshape(num_nodes, num_nodes, *(1,) * (core.ndim - 2))
