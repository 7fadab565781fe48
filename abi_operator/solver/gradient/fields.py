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

from collections.abc import Sequence
from typing import NamedTuple

from jaxtyping import Array, Float

from ...machine.algebra import comes_in_parts, fenced, product, product_alone, total, transpose
from ...machine.rows import in_rows
from ..method.bordered import Bordered, combined


class Fields(NamedTuple):
    """Sun's and view's field on the axis `beam`.

    Parameters
    ----------
    nodes
        At the nodes.
    own
        At the field's own beam.
    other
        At the other beam.
    """

    nodes: Float[Array, "node beam *batch"]
    own: Float[Array, "beam *batch"]
    other: Float[Array, "beam *batch"]


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
    return product(core, nodes) + border * own


@fenced
def _act_on_beams(ratio, over, right, middle, fields, nodes):
    own = ratio * fields.own
    from_nodes = swapped(right.border) * fields.nodes - swapped(middle.border) * nodes
    driven = total(from_nodes) + right.corner * fields.own - middle.corner * own
    return own, driven * over[::-1] + ratio[::-1] * fields.other


def swapped(border):
    """The other beam's column in place of each."""
    return border[:, ::-1]


def advance(
    fields: Fields, drop: Fields, h: float | Float[Array, "*batch"], jump: Fields | None = None
) -> Fields:
    """``fields - h drop - jump``."""
    if jump is None:
        return _less_times(h, fields, drop)
    return _less_times_and(h, fields, drop, jump)


@in_rows
def _less_times(h, x, y):
    return x - h * y


@in_rows
def _less_times_and(h, x, y, z):
    return x - h * y - z


@in_rows
def scaled(factor, x):
    """``factor x``, of fields."""
    return factor * x


def pair(
    factor: float,
    fields: Sequence[Fields],
    weight: float | Float[Array, "*batch"] = 0.0,
    more: Bordered | None = None,
) -> Bordered:
    """Cotangent ``factor (pair(F) + ... + weight more)`` of all `fields`."""
    core = _pairs_of_nodes(factor, [x.nodes for x in fields], weight, more and more.core)
    return Bordered(core, *_pairs_with_beams(factor, fields, weight, more and edge(more)))


@fenced
def _pairs_of_nodes(factor, nodes, weight, more):
    *others, last = nodes
    plus = fenced(_plus_twice_pair) if comes_in_parts(last) else _plus_twice_pair
    twice = None
    for x in others:
        twice = plus(twice, x)
    half = 0.5 * _plus_twice_pair(twice, last)
    return factor * (half if more is None else half + weight * more)


def _plus_twice_pair(before, x):
    terms = _outer(x[:, 1], x[:, 0]), _outer(x[:, 0], x[:, 1])
    return total(terms if before is None else [before, *terms])


def _outer(x, y):
    return x[:, None] * y[None]


@fenced
def _pairs_with_beams(factor, fields, weight, more):
    border = total([swapped(x.nodes) * x.own for x in fields])
    diagonal = total([x.other[::-1] * x.own for x in fields])
    corner = total([x.own[:1] * x.own[1:] for x in fields])
    sums = border, diagonal, corner
    if more is not None:
        sums = (x + weight * y for x, y in zip(sums, more, strict=True))
    return tuple(factor * x for x in sums)


def cotangents(
    mean: Fields,
    drop: Fields,
    steps: Sequence[tuple[Action, Float[Array, "*batch"]]],
    heat: "Heat | None" = None,
) -> tuple[Bordered, Bordered]:
    r"""P and Q of a part of a layer from mean and drop across the layer (`mode`).

    Parameters
    ----------
    mean, drop
        :math:`\sigma` and N.
    steps
        Quotient R and half thickness h before each doubling that is undone, the last one first.
    heat
        Of a layer across which the Planck function changes.

    The halves of a doubling see the fields :math:`\sigma - hR\sigma \pm hN/2` and
    :math:`N \pm 2R\sigma`. As pair(x + y) + pair(x - y) = 2 pair(x) + 2 pair(y) under everything
    linear, neither is formed: their two terms take their place and count twice. So the last of n
    doublings leaves

    .. math::
       P &= 2^{n+1}\sum [pair(\sigma - hR\sigma) + \tfrac{h^2}{4} pair(N)], \\
       Q &= 2^{n-1}\sum [pair(N) + 4\, pair(R\sigma)].

    A jump J of the Planck function (`thermal`) is shared by the halves: where the fields change by
    hN/2 they change by half of J more, by a quarter at the next doubling, and so on. In all this
    adds :math:`hE` to P in the last one.
    """
    means, drops, factor = [mean], [drop], 1.0
    for n, (quotient, h) in enumerate(steps, start=1):
        factor *= 2
        changes = [act(quotient, x) for x in means]
        means = [advance(x, c, h) for x, c in zip(means, changes, strict=True)]
        if n == len(steps):
            both = pair(1.0, drops)
            y_bar = pair(2 * factor, means, 0.25 * h * h, both)
            if heat is not None:
                y_bar = combined([1.0, h], [y_bar, heat.bar])
            return y_bar, pair(2 * factor, changes, 0.25, both)
        halves = [scaled(0.5 * h, x) for x in drops]
        if heat is not None:
            halves[0] = advance(halves[0], heat.jump, -1 / factor)
        means += halves
        drops += [scaled(2.0, c) for c in changes]
    return pair(2.0, means), pair(0.5, drops)


class Heat(NamedTuple):
    """Jump of the Planck function across a layer, and what it leaves of cotangents (`thermal`).

    Parameters
    ----------
    jump
        J, among the fields: of the sun's, since there thermal light is added to the sun's.
    bar
        :math:`E = pair(J, N_v)`, the cotangent of Z - B^-1 but for that over h.
    """

    jump: Fields
    bar: Bordered


class Side(NamedTuple):
    """A quotient on one side of a cotangent X.

    With the quotient's core V and border g the core is ``V X.c + g X.b^T / 2``; its symmetric part
    is half the sum of both sides. Border and diagonal are twice that.
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
    one_side = product_alone(left, core) + 0.5 * product(sent, transpose(border))
    return one_side, product(left, border) + swapped(sent) * corner


@fenced
def side_of_beams(ratio, over, right, middle, x, driven):
    """Diagonal of the same, from the border."""
    beams = total(right.border * x.border - middle.border * driven)
    beams = beams + (right.corner - middle.corner * ratio[::-1]) * x.corner
    return beams * over + ratio * x.diagonal


def both_sides(core, border, sent, left):
    """Core with a quotient on the other side, too, inside a kernel."""
    return product_alone(core, transpose(left)) + 0.5 * product(border, transpose(sent))


def symmetric(x):
    """Symmetric part, inside a kernel."""
    return 0.5 * (x + transpose(x))
