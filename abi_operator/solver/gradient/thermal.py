r"""Thermal light in one layer, on the way up and down: what it adds to the derivative of sunlight.

A stack that emits obeys :math:`t = -Y(s - 2B) + e` (`method.adding`). With 1 the vector of
isotropic light, D = B_bottom - B_top across a layer and J = D 1, the layer's
:math:`j = D B^{-1} 1` changes e to

.. math::
   e' = e - Y_1 S^{-1}(he - j), \qquad Y_1 = Y + Y_e, \qquad S = hY + (Z + hY_e)/2 .

As :math:`Z - B^{-1} = h z` with a finite z, :math:`S^{-1}j = 2J - hS^{-1}(2Y + Y_e + z)J`: so

.. math::
   e' = e + 2Y_1 J - hY_1 u, \qquad u = S^{-1}v, \qquad v = e + (2Y + Y_e + z)J,

where v and u stay finite in an empty layer across which B jumps, and z 1 is collected on the way:
hC 1 at the start, :math:`z \leftarrow (z + Y)/2` with every doubling.

The radiance towards the view is :math:`F_v^T` times what drives light at the top, so that the
cotangent of e is -F_v at every level: it is the field that sunlight has, too (`mode`). The source
field is F = s - 2B, thermal light added to the sun's. From the derivative of e' and Y',

.. math::
   N = S^{-1}Y_1F - u, \qquad \sigma = F - hN/2 - J, \qquad F' = F - hN - 2J,

of the source; of the view, as without thermal light, :math:`N_v = S^{-1}Y_1F_v`. Then the
cotangent of Y_e is 2 pair(sigma) as before, that of Z is

.. math:: \tfrac12 pair(hN + 2J, N_v) = hQ + E, \qquad Q = pair(N)/2, \quad E = pair(J, N_v),

and j gives -E to that of :math:`B^{-1}`. So E is a cotangent of :math:`hz = Z - B^{-1}` alone,
which passes the doublings unchanged (`pull_back`): :math:`B^{-1}` has a cotangent that is over h,
A gets hE and more. The slope in D is :math:`-N_v^T B^{-1} 1`. A layer depends on hA, hB and D
alone, so that the slope in h is found as without thermal light.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.algebra import fenced, kernel_of_product, matmul, product, total
from ..method.bordered import Bordered, Vector
from ..method.quadrature import node_scales
from ..method.quotient import Quotient
from .fields import Fields, Heat, pair

_VIEW = slice(1, None)  # beams but the sun, which thermal light does not reach


class Warmth(NamedTuple):
    """Thermal light of a stack, and the Planck function across the layer that is put on it.

    Parameters
    ----------
    column
        e of the stack, at the nodes and at the view.
    jump
        D.
    """

    column: Vector
    jump: Float[Array, "*batch"]


class Load(NamedTuple):
    """What thermal light asks of a layer before its quotient is known, on the way up.

    Parameters
    ----------
    v
        See the head of this file.
    gained
        e + 2 Y_1 J.
    """

    v: Vector
    gained: Vector


def load(warmth: Warmth, both: Bordered, layer: Bordered, lag: Vector) -> Load:
    """From Y + Y_e, Y_e and z 1."""
    ones = on_isotropic(both), on_isotropic(layer)
    return _load(warmth.column, warmth.jump, *ones, lag)


@fenced
def _load(column, jump, both, layer, lag):
    v = column + jump * (2.0 * both - layer + lag)
    return Load(v, column + 2 * jump * both)


def respond(
    loaded: Load, both: Bordered, middle: Bordered, h: Float[Array, "*batch"], quotient: Quotient
) -> tuple[Vector, Vector]:
    """e of the stack with the layer on it, and u; `quotient` was found with the nodes of v."""
    nodes = quotient.responses[0].joined()
    driven = matmul(both.core, nodes)[:, 0]
    return _respond(
        loaded, both.border, both.diagonal, middle.border, quotient.over, h, nodes, driven
    )


@fenced
def _respond(loaded, border, diagonal, middle, over, h, nodes, driven):
    beams = (loaded.v.beams - total(middle[:, _VIEW] * nodes)) * over[_VIEW]
    to_view = total(border[:, _VIEW] * nodes) + diagonal[_VIEW] * beams
    column = loaded.gained - h * Vector(driven, to_view)
    return column, Vector(nodes[:, 0], beams)


def on_isotropic(matrix: Bordered) -> Vector:
    """``matrix 1`` at the nodes and at the view."""
    root = isotropic_nodes(matrix.core)
    nodes = matmul(matrix.core, root)[:, 0]
    return Vector(nodes, _on_isotropic(matrix.border, matrix.diagonal, root))


@fenced
def _on_isotropic(border, diagonal, root):
    return total(border[:, _VIEW] * root) + diagonal[_VIEW]


def isotropic_nodes(like: Float[Array, "node _ *batch"]) -> Float[Array, "node 1 *#batch"]:
    """Nodes of the vector 1."""
    scales = node_scales(2 * like.shape[0])
    return jnp.asarray(scales.reshape(-1, *(1,) * (like.ndim - 1)), like.dtype)


def start_of_lag(h: Float[Array, "*batch"], fraction: Bordered) -> Vector:
    """z 1 at the start, from C."""
    return fenced(lambda h, x: h * x)(h, on_isotropic(fraction))


def doubled_lag(lag: Vector, admittance: Bordered) -> Vector:
    """z 1 after a doubling, from Y before it."""
    return fenced(lambda x, y: 0.5 * (x + y))(lag, on_isotropic(admittance))


def heat(jump: Float[Array, "*batch"], drop: Fields) -> Heat:
    """J and E of a layer, from D and the view's N."""
    above, both = _heat(jump, drop, isotropic_nodes(drop.nodes))
    return Heat(above, pair(1.0, [both]))


@fenced
def _heat(jump, drop, root):
    nothing = jnp.zeros_like(jump)
    of_source = jnp.stack([jump, nothing])
    nodes = root * of_source
    # The sun's place among the source's beams stays empty; at the view 1 is 1.
    above = Fields(nodes, jnp.zeros_like(drop.own), of_source)
    seen = jnp.concatenate([nodes[:, :1], drop.nodes[:, 1:]], axis=1)
    own = jnp.concatenate([0 * drop.own[:1], drop.own[1:]])
    return above, Fields(seen, own, of_source)


@fenced
def less_response(drop: Fields, response: Vector) -> Fields:
    """N of both fields, from what it is without thermal light, by u."""
    nodes = drop.nodes - _of_source(response.nodes[:, None], 1)
    return Fields(nodes, drop.own, drop.other - _of_source(response.beams, 0))


def _of_source(x, axis):
    return jnp.concatenate([x, jnp.zeros_like(x)], axis=axis)


def slope_of_jump(drop: Fields, b_inverse: Bordered) -> Float[Array, "*batch"]:
    """Slope in D, from the view's N."""
    root = isotropic_nodes(drop.nodes)
    solved = kernel_of_product(product, len(root))(b_inverse.core, root)  # an entry of a room
    return _slope_of_jump(drop, solved, b_inverse.border, b_inverse.diagonal, root)


@fenced
def _slope_of_jump(drop, solved, border, diagonal, root):
    to_view = total(border[:, 1] * root[:, 0]) + diagonal[1]
    return -(total(drop.nodes[:, 1] * solved[:, 0]) + drop.own[1] * to_view)
