r"""Pull-backs of the stages of half a layer: its doublings, and its start.

Cotangents are `Bordered`, with a symmetric core where the next step asks for one. Of the admittance
Y_e they are P, of the impedance hQ with the half thickness h of that stage, and E more where there
is thermal light (`thermal`); of A and B^-1 they are `mode`'s over h. Nothing is ever divided by h.
"""

from collections.abc import Callable

from jaxtyping import Array, Float

from ...machine.algebra import fenced, product, product_alone, transpose
from ...machine.rows import are_few, in_rows
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


def _edgewise(
    of_beams: Callable[..., tuple[Array, Array]], of_corner: Callable[..., tuple[Array, Array]]
) -> Callable[..., tuple[Edge, Edge]]:
    """A function of edges from what it does with entries of beams, and with the corner.

    Parameters
    ----------
    of_beams
        Maps numbers, ratios, and entries of a border or of a diagonal, of sides and of edges, to
        such entries of two edges (`machine.rows.in_rows`).
    of_corner
        Maps numbers, ratios, and corners of edges.

    Returns
    -------
    The function of numbers, ratios ``beam *batch``, sides (border and diagonal alone) and edges,
    None among which stays None.
    """
    rows, corner_alone = in_rows(of_beams), fenced(of_corner)

    def parted(x):
        return None if x is None else tuple(x[:2])

    def corners(edges):
        return (None if x is None else x.corner for x in edges)

    @fenced
    def together(numbers, ratios, sides, edges):
        own = [[x and x[k] for x in (*sides, *edges)] for k in range(2)]
        beams = [of_beams(numbers, *ratios, *x) for x in own]
        return _two_edges(beams, of_corner(numbers, *ratios, *corners(edges)))

    def call(numbers, ratios, sides, edges):
        if not are_few(ratios[0]):
            return together(numbers, ratios, sides, edges)
        twice = [(x, x) for x in ratios]
        beams = rows(numbers, *twice, *map(tuple, sides), *map(parted, edges))
        return _two_edges(beams, corner_alone(numbers, *ratios, *corners(edges)))

    return call


def _two_edges(beams, corner):
    first, second = zip(*beams, corner, strict=True)
    return Edge(*first), Edge(*second)


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
    edges = edge(y_bar), edge(z_bar), more and edge(more)
    z_edge, y_edge = _undouble_edges(h, [quotient.ratio], [once[1:]], edges)
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


def _undouble_beams(h, ratio, once, y, z, more):
    z = 2 * z + 2 * ratio * once
    return z, 2 * y - 2 * h * (ratio * y + once) + h * _times_h(h, z, more)


def _undouble_corner(h, ratio, y, z, more):
    sun, view = ratio[:1], ratio[1:]
    z = 2 * z + 2 * sun * view * y
    return z, 2 * y - 2 * h * (sun + view) * y + h * _times_h(h, z, more)


_undouble_edges = _edgewise(_undouble_beams, _undouble_corner)


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
    edges = edge(y_bar), edge(z_bar), more and edge(more)
    z_edge, p_edge = _start_z_edges(h, [by_a.ratio, ratio_w], [u[1:], w[1:]], edges)
    z = Bordered(z_core, *z_edge)
    v = side(inner, z)
    twice = _both_sides(v.core, v.border, inner.border, inner.core)
    a_core, p_core = _start_cores(
        h, d, y_bar.core, w.core, z.core, v.core, twice, z_bar.core, mixed
    )
    edges = edge(y_bar), edge(z), p_edge
    a_edge, p_edge = _start_edges((h, d), [ratio_w, inner.ratio], [w[1:], v[1:]], edges)
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


def _start_z_beams(h, ratio_u, ratio_w, u, w, y, z, more):
    p = z + 0.5 * h * h * (u * ratio_w + w * ratio_u)
    return _times_h(h, p - 0.5 * (ratio_u * y + u), more), p


def _start_z_corner(h, u, w, y, z, more):
    p = z + 0.5 * h * h * (u[1:] * w[:1] + w[1:] * u[:1]) * y
    return _times_h(h, p - 0.5 * (u[:1] + u[1:]) * y, more), p


_start_z_edges = _edgewise(_start_z_beams, _start_z_corner)


@fenced
def _start_cores(h, d, y, w, z, v, twice, z_bar, mixed):
    square = h * h
    cubic = square * h
    a = y + h * (z / 3 - h * w) - cubic / 9 * (2 * v - d * square * twice)
    return a, z_bar + square * mixed + (5 / 9) * cubic * twice


def _start_beams(numbers, ratio_w, ratio_v, w, v, y, z, p):
    h, d = numbers
    square = h * h
    cubic = square * h
    twice = ratio_v * v
    of_v = ratio_v * z + v - d * square * twice
    a = y + h * (z / 3 - 0.5 * h * (ratio_w * y + w)) - cubic / 9 * of_v
    return a, p + (5 / 9) * cubic * twice


def _start_corner(numbers, ratio_w, ratio_v, y, z, p):
    h, d = numbers
    square = h * h
    cubic = square * h
    twice = ratio_v[:1] * ratio_v[1:] * z
    of_v = (ratio_v[:1] + ratio_v[1:]) * z - d * square * twice
    a = y + h * (z / 3 - 0.5 * h * (ratio_w[:1] + ratio_w[1:]) * y) - cubic / 9 * of_v
    return a, p + (5 / 9) * cubic * twice


_start_edges = _edgewise(_start_beams, _start_corner)
