r"""Pull-backs of the stages of half a layer: its doublings, and its start.

Cotangents are `Bordered`, with a symmetric core where the next step asks for one. Of the admittance
Y_e they are P, of the impedance hQ with the half thickness h of that stage, and E more where there
is thermal light (`thermal`); of A and B^-1 they are `mode`'s over h. Nothing is ever divided by h.
"""

from jaxtyping import Array, Float

from ...machine.algebra import fenced, product, product_alone, transpose
from ..method.bordered import Bordered
from .fields import (
    Action,
    Edge,
    Feed,
    Side,
    both_sides,
    edge,
    side,
    side_of_beams,
    swapped,
    symmetric,
)


def undouble(
    quotient: Action,
    h: Float[Array, "*batch"],
    y_bar: Bordered,
    z_bar: Bordered,
    more: Bordered | None = None,
) -> tuple[Bordered, Bordered]:
    """Cotangents P and Q before a doubling of the layer's half h from those after it.

    `more` is what thermal light adds to the cotangent of Z, E of `thermal`; it stays as it is.
    """
    once = side(quotient, y_bar)
    z_core = _z_core(z_bar.core, once.core, once.border, quotient.border, quotient.core)
    y_core = _y_core(h, y_bar.core, once.core, z_core, more and more.core)
    z_edge, y_edge = _undouble_edges(
        h, quotient.ratio, once.border, once.diagonal, edge(y_bar), edge(z_bar), more and edge(more)
    )
    return Bordered(y_core, *y_edge), Bordered(z_core, *z_edge)


@fenced
def _z_core(z_core, core, border, sent, left):
    return 2 * z_core + 2 * both_sides(core, border, sent, left)


@fenced
def _y_core(h, y_core, once, z_core, more):
    # All of it, since what rounding leaves that is not symmetric would double each time.
    return symmetric(2 * y_core - 4 * h * once + h * _times_h(h, z_core, more))


def _times_h(h, over_h, more):
    """A cotangent from what it is over h, and the part of it that is not."""
    return h * over_h if more is None else h * over_h + more


def _twice(ratio, border, diagonal, x: Edge):
    """Edge with a quotient on both sides."""
    return Edge(ratio * border, ratio * diagonal, ratio[:1] * ratio[1:] * x.corner)


def _each(ratio, border, diagonal, x: Edge):
    """Sum of the edges with a quotient on either side."""
    return Edge(
        ratio * x.border + border, ratio * x.diagonal + diagonal, (ratio[:1] + ratio[1:]) * x.corner
    )


@fenced
def _undouble_edges(h, ratio, border, diagonal, y_bar, z_bar, more):
    twice, each = (f(ratio, border, diagonal, y_bar) for f in (_twice, _each))
    z = Edge(*(2 * q + 2 * t for q, t in zip(z_bar, twice, strict=True)))
    whole = _edge_times_h(h, z, more)
    y = Edge(*(2 * p - 2 * h * e + h * q for p, e, q in zip(y_bar, each, whole, strict=True)))
    return z, y


def _edge_times_h(h, over_h, more):
    parts = zip(over_h, (None,) * 3 if more is None else more, strict=True)
    return Edge(*(_times_h(h, x, y) for x, y in parts))


def undo_start(
    inner: Action,
    by_a: Action,
    ratio_w: Float[Array, "2 *batch"],
    fraction: Feed,
    h: Float[Array, "*batch"],
    d: float,
    y_bar: Bordered,
    z_bar: Bordered,
    more: Bordered | None = None,
) -> tuple[Bordered, Bordered]:
    """Cotangents of A and of B^-1 over h from P and Q, by V, U, W and the start's d.

    W = U (1/3 - h^2 V / 9), and the two commute: W's products follow from U's by one with V.
    `more` as in `undouble`; of B^-1 it is no part.
    """
    square = h * h
    u = side(by_a, y_bar)
    w_core, w_border = _chained(
        square / 9, inner.core, inner.border, by_a.ratio, u[:2], y_bar.border, y_bar.corner
    )
    w_diagonal = side_of_beams(ratio_w, by_a.over, fraction, by_a.middle, edge(y_bar), w_border)
    w = Side(w_core, w_border, w_diagonal)
    mixed = _both_sides(w.core, w.border, by_a.border, by_a.core)
    z_core = _start_z_core(h, z_bar.core, u.core, mixed, more and more.core)
    z_edge, p_edge = _start_z_edge(
        h, u[1:], w[1:], by_a.ratio, ratio_w, edge(y_bar), edge(z_bar), more and edge(more)
    )
    z = Bordered(z_core, *z_edge)
    v = side(inner, z)
    twice = _both_sides(v.core, v.border, inner.border, inner.core)
    a_core, p_core = _start_cores(
        h, d, y_bar.core, w.core, z.core, v.core, twice, z_bar.core, mixed
    )
    a_edge, p_edge = _start_edges(
        h, d, edge(y_bar), w[1:], ratio_w, edge(z), v[1:], inner.ratio, p_edge
    )
    return Bordered(a_core, *a_edge), Bordered(p_core, *p_edge)


_both_sides = fenced(both_sides)


@fenced
def _chained(ninth, v, sent_v, ratio_u, with_u, x_border, corner):
    """Core and border with W on one side from those with U."""
    core, border = with_u
    sent = sent_v * ratio_u
    both = product_alone(v, core) + 0.5 * product(sent, transpose(x_border))
    driven = product(v, border) + swapped(sent) * corner
    return core / 3 - ninth * both, border / 3 - ninth * driven


# From here to the end of the start z is h times the cotangent of Z over h, so that it can take in
# what is not over h.
@fenced
def _start_z_core(h, z_core, u, mixed, more):
    return _times_h(h, z_core + symmetric(h * h * mixed - u), more)


@fenced
def _start_z_edge(h, u, w, ratio_u, ratio_w, y_bar, z_bar, more):
    border, diagonal = (0.5 * (x * ratio_w + y * ratio_u) for x, y in zip(u, w, strict=True))
    mixed = Edge(
        border,
        diagonal,
        0.5 * (ratio_u[1:] * ratio_w[:1] + ratio_w[1:] * ratio_u[:1]) * y_bar.corner,
    )
    each = _each(ratio_u, u[0], u[1], y_bar)
    p = Edge(*(q + h * h * m for q, m in zip(z_bar, mixed, strict=True)))
    z = Edge(*(x - 0.5 * e for x, e in zip(p, each, strict=True)))
    return _edge_times_h(h, z, more), p


@fenced
def _start_cores(h, d, y, w, z, v, twice, z_bar, mixed):
    square = h * h
    cubic = square * h
    a = y + h * (z / 3 - h * w) - cubic / 9 * (2 * v - d * square * twice)
    return a, z_bar + square * mixed + (5 / 9) * cubic * twice


@fenced
def _start_edges(h, d, y_bar, w, ratio_w, z, v, ratio_v, p_edge):
    each_w, each_v = _each(ratio_w, w[0], w[1], y_bar), _each(ratio_v, v[0], v[1], z)
    twice = _twice(ratio_v, v[0], v[1], z)
    square = h * h
    cubic = square * h
    a = (
        y + h * (x / 3 - 0.5 * h * ew) - cubic / 9 * (ev - d * square * t)
        for y, x, ew, ev, t in zip(y_bar, z, each_w, each_v, twice, strict=True)
    )
    return Edge(*a), Edge(*(p + (5 / 9) * cubic * t for p, t in zip(p_edge, twice, strict=True)))
