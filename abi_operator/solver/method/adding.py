r"""The stack of layers, from the ground up.

A stack is summarised by its admittance Y = (1 - R)(1 + R)^{-1}, R its reflection, at its upper
face: t = -Y s. Adding a layer is the addition theorem of tanh; no reflection or transmission of a
layer is ever formed. The answer of a mode is the sun -> view entry of the final R.

Light that layers and ground emit adds a column e, :math:`t = -Y(s - 2B) + e`, with B the Planck
function at the upper face. Inside a layer whose B is linear in tau, s = 2B, t = dB/dtau 2 B^{-1} 1
solves the equations with their thermal source exactly, whatever scatters, so that only the jump of
t at the faces is left to carry: an isothermal column over an equally warm ground has e = 0 to the
last digit, and the source costs one vector a layer.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.algebra import matmul, total
from ...machine.elimination import inverse, solve
from .absorption import Absorbed, absorbing, emitted, of_ground, of_stack
from .bordered import Bordered, Vector, combined
from .quotient import Quotient, minus_and_quotient, minus_quotient


class Emission(eqx.Module):
    """Light from within a stack at its upper face.

    Parameters
    ----------
    column
        The vector e of ``t = -Y (s - 2 B) + e``.
    returned
        What a black ground that emits radiance 1 under cold air gets back with s = 0 at the upper
        face: the downward irradiance over pi. Without meaning for other grounds; None where nobody
        asks for it.
    absorbed
        What the stack absorbs of isotropic light, where that is kept (`absorption`).
    """

    column: Vector
    returned: Float[Array, "*batch"] | None
    absorbed: Vector | None = None


def emitting_ground(
    ground: Bordered,
    one: Vector,
    radiance: Float[Array, "*batch"],
    planck: Float[Array, "*batch"],
    absorbed: Float[Array, "*batch"] | None = None,
) -> Emission:
    r"""Ground that emits `radiance` isotropically under air of Planck function `planck`.

    :math:`e = E(1+Y)1 - 2BY1`; 0 for :math:`E = (1-a)B` over Lambertian ground. `returned` starts
    as -1, the irradiance that keeps s = 0 over a black ground of radiance 1. `absorbed` is what
    is known of a Lambertian one (`absorption.of_ground`).
    """
    reflected = ground @ one
    column = radiance * one + (radiance - 2 * planck) * reflected
    return Emission(column, -jnp.ones_like(radiance), of_ground(ground, absorbed))


def add_layer(
    stack: Bordered, admittance: Bordered, impedance: Bordered, tau: Float[Array, "*batch"]
) -> Bordered:
    r"""Put a layer on a stack.

    With the layer's half-layer admittance Y_e, impedance Z (times h), h = tau / 2 and
    :math:`S = hY + (Z + hY_e)/2`,
    :math:`Y \leftarrow Y + 2Y_e - h(Y + Y_e)S^{-1}(Y + Y_e)`.
    The beams' own entries of Y are 1 whatever lies below, and are set so.
    """
    h, both, middle = _sums(stack, admittance, impedance, tau)
    base = [(1.0, both), (1.0, admittance)]
    return _with_own_beams(minus_quotient(base, h, both, middle, both))


def add_absorbing_layer(
    stack: Bordered,
    below: Vector,
    admittance: Bordered,
    impedance: Bordered,
    tau: Float[Array, "*batch"],
    layer: Absorbed,
) -> tuple[Bordered, Vector]:
    """`add_layer` in the mean where what is absorbed is kept (`absorption`), and y of the stack."""
    stack, quotient = add_layer_and_quotient(stack, admittance, impedance, tau)
    ones = of_stack(below, layer.ones, 0.5 * tau, quotient)
    return absorbing(stack, ones), ones


def add_layer_and_quotient(
    stack: Bordered, admittance: Bordered, impedance: Bordered, tau: Float[Array, "*batch"]
) -> tuple[Bordered, Quotient]:
    """`add_layer`, and the quotient :math:`S^{-1}(Y + Y_e)` of light that goes down."""
    h, both, middle = _sums(stack, admittance, impedance, tau)
    base = [(1.0, both), (1.0, admittance)]
    added, quotient = minus_and_quotient(base, h, both, middle, both)
    return _with_own_beams(added), quotient


def add_emitting_layer(
    stack: Bordered,
    emission: Emission,
    admittance: Bordered,
    impedance: Bordered,
    tau: Float[Array, "*batch"],
    planck_jump: Float[Array, "*batch"] | None,
    b_inverse_one: Vector,
    absorbed: Absorbed | None,
) -> tuple[Bordered, Emission]:
    r"""Put a layer on a stack that emits.

    As `add_layer`, and :math:`e \leftarrow e - (Y + Y_e)S^{-1}(he - j)` with the layer's own
    :math:`j = (B_{bottom} - B_{top}) B^{-1} 1`, `planck_jump` being None for air that does not
    emit; where `absorbed` is kept, as stands in `absorption`.
    """
    h, both, middle = _sums(stack, admittance, impedance, tau)
    base = [(1.0, both), (1.0, admittance)]
    added, quotient = minus_and_quotient(base, h, both, middle, both)
    added, kept, below = _with_own_beams(added), None, emission.absorbed
    if absorbed is not None:
        assert below is not None
        kept = of_stack(below, absorbed.ones, h, quotient)
        added = absorbing(added, kept)
    if planck_jump is not None and absorbed is not None:
        assert below is not None
        column = emitted(emission.column, planck_jump, below, absorbed, h, quotient)
    else:
        driving = h * emission.column
        if planck_jump is not None:
            driving = driving - planck_jump * b_inverse_one
        column = emission.column - quotient.transposed_action(driving)
    if emission.returned is None:
        return added, Emission(column, None, kept)
    solved = solve(middle.core, [emission.column.nodes[:, None]])[0].joined()[:, 0]
    returned = emission.returned + h * total(emission.column.nodes * solved)
    return added, Emission(column, returned, kept)


def _sums(stack, admittance, impedance, tau):
    """h, Y + Y_e and S."""
    h = 0.5 * tau
    both = combined([1.0, 1.0], [stack, admittance])
    return h, both, combined([h, 0.5, 0.5 * h], [stack, impedance, admittance])


def _with_own_beams(stack: Bordered) -> Bordered:
    return Bordered(stack.core, stack.border, jnp.ones_like(stack.diagonal), stack.corner)


class Top(eqx.Module):
    """A finished stack under free space: (1 + Y)^-1 and Y."""

    stack: Bordered
    inverse: Float[Array, "node node *batch"]

    def reflection(self) -> Float[Array, "view *batch"]:
        r"""Sun -> view entries of (1 + Y)^{-1}: twice the reflectance factor of the mode."""
        border = self.stack.border
        sun = matmul(self.inverse, border[:, :1])
        return 0.5 * (jnp.sum(border[:, 1:] * sun, axis=0) - self.stack.corner)

    def emerging(
        self,
        emission: Emission,
        one: Vector,
        incident: Float[Array, "*batch"],
        planck: Float[Array, "*batch"],
    ) -> Float[Array, "beam *batch"]:
        """Radiance towards each beam under isotropic light `incident`, air at `planck` on top."""
        driving = 2 * (incident - planck) * one.nodes + emission.column.nodes
        s = matmul(self.inverse, driving[:, None])
        emerging = emission.column.beams - jnp.sum(self.stack.border * s, axis=0)
        return planck + 0.5 * emerging

    def spherical_albedo(self, emission: Emission) -> Float[Array, "*batch"]:
        """What comes back to the ground of its isotropic radiance 1, seen from below."""
        nodes = emission.column.nodes
        s = matmul(self.inverse, nodes[:, None])[:, 0]
        assert emission.returned is not None
        return emission.returned + jnp.sum(nodes * s, axis=0)


def top(stack: Bordered) -> Top:
    """Close a stack under free space."""
    num_nodes = stack.core.shape[0]
    ndim = stack.core.ndim - 2
    identity = jnp.eye(num_nodes, dtype=stack.core.dtype)
    identity = identity.reshape(num_nodes, num_nodes, *(1,) * ndim)
    return Top(stack, inverse(stack.core + identity))
