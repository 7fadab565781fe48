r"""The two fields of a derivative, and cotangents of bordered matrices.

The answer's derivative in a bordered matrix M is, with the light F_s that the sun makes and the
light F_v that a view would make (its adjoint),

.. math:: \langle \bar M, dM \rangle = F_v^T\, dM\, F_s, \qquad \bar M = pair(F),

stored like M itself (`Bordered`), its core symmetric. What is known of M enters through quotients
R = S^{-1} Y, which act on either field alike; on cotangents they act from both sides,

.. math:: (R \otimes R)\, pair(F) = pair(RF), \qquad
   (R \oplus R)\, pair(F) = F_v^T \cdot RF_s + RF_v^T \cdot F_s .

Quotients of one layer commute, so that only symmetric parts matter. Of a product
:math:`E = Y S^{-1} Y` the derivative is
:math:`\langle X, dE \rangle = \langle (R\oplus R)X, dY\rangle - \langle (R\otimes R)X, dS\rangle`.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from .._numerics import fenced, product, total, transpose
from .bordered import Bordered


class Fields(NamedTuple):
    """Sun's and view's field on the axis `beam`; several pairs on the axis `pair`.

    Parameters
    ----------
    nodes
        At the nodes.
    own
        At the field's own beam.
    other
        At the other beam.
    """

    nodes: Float[Array, "node beam pair *batch"]
    own: Float[Array, "beam pair *batch"]
    other: Float[Array, "beam pair *batch"]


class Edge(NamedTuple):
    """A bordered matrix without its core."""

    border: Float[Array, "node beam *batch"]
    diagonal: Float[Array, "beam *batch"]
    corner: Float[Array, "1 *batch"]


class Feed(NamedTuple):
    """What beams feed in a bordered matrix: nodes and each other."""

    border: Float[Array, "node beam *batch"]
    corner: Float[Array, "1 *batch"]


def edge(matrix: Bordered) -> Edge:
    """All but the core."""
    return Edge(matrix.border, matrix.diagonal, matrix.corner)


def feed(matrix: Bordered) -> Feed:
    """Border and corner."""
    return Feed(matrix.border, matrix.corner)


class Action(NamedTuple):
    """A quotient ``S^-1 Y`` as it acts on fields.

    Parameters
    ----------
    core, border, ratio, over
        See `Quotient`.
    right, middle
        What beams feed in Y and in S.
    """

    core: Float[Array, "node node *batch"]
    border: Float[Array, "node beam *batch"]
    ratio: Float[Array, "beam *batch"]
    over: Float[Array, "beam *batch"]
    right: Feed
    middle: Feed


def act(quotient: Action, fields: Fields) -> Fields:
    """Apply a quotient to fields."""
    nodes = _act_on_nodes(quotient.core, quotient.border, fields.nodes, fields.own)
    return Fields(nodes, *_act_on_beams(*quotient[2:], fields, nodes))


@fenced
def _act_on_nodes(core, border, nodes, own):
    flat = nodes.reshape(nodes.shape[0], -1, *nodes.shape[3:])
    return product(core, flat).reshape(nodes.shape) + border[:, :, None] * own


@fenced
def _act_on_beams(ratio, over, right, middle, fields, nodes):
    own = ratio[:, None] * fields.own
    from_nodes = swapped(right.border)[:, :, None] * fields.nodes
    from_nodes = from_nodes - swapped(middle.border)[:, :, None] * nodes
    driven = total(from_nodes) + right.corner * fields.own - middle.corner * own
    return own, driven * over[::-1, None] + ratio[::-1, None] * fields.other


def swapped(border):
    """The other beam's column in place of each."""
    return border[:, ::-1]


@fenced
def advance(fields: Fields, drop: Fields, h: Float[Array, "*batch"]) -> Fields:
    """``fields - h drop``."""
    return Fields(*(x - h * y for x, y in zip(fields, drop, strict=True)))


@fenced
def split(
    mean: Fields, drop: Fields, change: Fields, h: Float[Array, "*batch"]
) -> tuple[Fields, Fields]:
    """Means ``mean - h change +- h drop / 2`` and drops ``drop +- 2 change`` of two halves."""
    means, drops = [], []
    for x, fallen, changed, axis in zip(mean, drop, change, (2, 1, 1), strict=True):
        middle, apart = x - h * changed, 0.5 * h * fallen
        means.append(jnp.concatenate([middle + apart, middle - apart], axis))
        drops.append(jnp.concatenate([fallen + 2 * changed, fallen - 2 * changed], axis))
    return Fields(*means), Fields(*drops)


def pair(factor: float, fields: Fields) -> Bordered:
    """Cotangent ``factor pair(F)``, summed over the pairs of fields."""
    core = _pair_of_nodes(factor, fields.nodes)
    return Bordered(core, *_pair_with_beams(factor, fields))


@fenced
def _pair_of_nodes(factor, nodes):
    sun, view = nodes[:, 0], nodes[:, 1]
    terms = [
        view[:, None, k] * sun[None, :, k] + sun[:, None, k] * view[None, :, k]
        for k in range(nodes.shape[2])
    ]
    return 0.5 * factor * total(terms)


@fenced
def _pair_with_beams(factor, fields):
    nodes, own, other = fields
    pairs = range(own.shape[1])
    border = total([swapped(nodes)[:, :, k] * own[:, k] for k in pairs])
    diagonal = total([other[::-1, k] * own[:, k] for k in pairs])
    corner = total([own[:1, k] * own[1:, k] for k in pairs])
    return factor * border, factor * diagonal, factor * corner


class Side(NamedTuple):
    """A quotient on one side of a cotangent: core ``V X.c``, border and diagonal with the rest.

    The symmetric part of ``V X.c + X.b g^T / 2`` is the core of half the sum of both sides.
    """

    core: Float[Array, "node node *batch"]
    border: Float[Array, "node beam *batch"]
    diagonal: Float[Array, "beam *batch"]


def side(quotient: Action, x: Bordered) -> Side:
    """Apply a quotient to one side of a cotangent."""
    core, border = side_of_nodes(quotient.core, quotient.border, x.core, x.border, x.corner)
    return Side(core, border, side_of_beams(*quotient[2:], edge(x), border))


@fenced
def side_of_nodes(left, sent, core, border, corner):
    """Core and border of a cotangent with a matrix on one side."""
    return product(left, core), product(left, border) + swapped(sent) * corner


@fenced
def side_of_beams(ratio, over, right, middle, x, driven):
    """Diagonal of the same, from the border."""
    beams = total(right.border * x.border - middle.border * driven)
    beams = beams + (right.corner - middle.corner * ratio[::-1]) * x.corner
    return beams * over + ratio * x.diagonal


def both_sides(core, border, sent, corner, left):
    """Core with a quotient on both sides, inside a kernel, from that with it on one."""
    nodes = product(core, transpose(left))
    border = border - 0.5 * corner * swapped(sent)
    return nodes + 0.5 * (product(border, transpose(sent)) + product(sent, transpose(border)))


def symmetric(x):
    """Symmetric part, inside a kernel."""
    return 0.5 * (x + transpose(x))
