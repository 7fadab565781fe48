r"""Pull-backs of the parts of one layer: doublings, start, inverse, and what A and B are made of.

Cotangents are `Bordered`, with a symmetric core where the next step asks for one. Of the admittance
Y_e they are P, of the impedance hQ with the half thickness h of that stage, of A and B they are
`mode`'s over h: nothing is ever divided by h.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...machine.algebra import fenced, kernel_of_product, matmul, product, total, transpose
from ..method.bordered import Bordered
from ..method.layer import ModeKernels
from ..method.quadrature import double_gauss
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
    quotient: Action, h: Float[Array, "*batch"], y_bar: Bordered, z_bar: Bordered
) -> tuple[Bordered, Bordered]:
    """Cotangents P and Q before a doubling of the layer's half h from those after it."""
    once = side(quotient, y_bar)
    z_core = _z_core(z_bar.core, once.core, once.border, quotient.border, quotient.core)
    y_core = _y_core(h, y_bar.core, once.core, z_core)
    z_edge, y_edge = _undouble_edges(
        h, quotient.ratio, once.border, once.diagonal, edge(y_bar), edge(z_bar)
    )
    return Bordered(y_core, *y_edge), Bordered(z_core, *z_edge)


@fenced
def _z_core(z_core, core, border, sent, left):
    return 2 * z_core + 2 * both_sides(core, border, sent, left)


@fenced
def _y_core(h, y_core, once, z_core):
    return 2 * y_core - 4 * h * symmetric(once) + h * h * z_core


def _twice(ratio, border, diagonal, x: Edge):
    """Edge with a quotient on both sides."""
    return Edge(ratio * border, ratio * diagonal, ratio[:1] * ratio[1:] * x.corner)


def _each(ratio, border, diagonal, x: Edge):
    """Sum of the edges with a quotient on either side."""
    return Edge(
        ratio * x.border + border, ratio * x.diagonal + diagonal, (ratio[:1] + ratio[1:]) * x.corner
    )


@fenced
def _undouble_edges(h, ratio, border, diagonal, y_bar, z_bar):
    twice, each = (f(ratio, border, diagonal, y_bar) for f in (_twice, _each))
    z = Edge(*(2 * q + 2 * t for q, t in zip(z_bar, twice, strict=True)))
    y = Edge(*(2 * p - 2 * h * e + h * h * q for p, e, q in zip(y_bar, each, z, strict=True)))
    return z, y


def undo_start(
    inner: Action,
    by_a: Action,
    ratio_w: Float[Array, "2 *batch"],
    fraction: Feed,
    square: Float[Array, "*batch"],
    d: float,
    y_bar: Bordered,
    z_bar: Bordered,
) -> tuple[Bordered, Bordered]:
    """Cotangents of A and of B^-1 over h from P and Q, by V, U, W and the start's d.

    W = U (1/3 - h^2 V / 9), and the two commute: W's products follow from U's by one with V.
    """
    u = side(by_a, y_bar)
    w_core, w_border = _chained(
        square / 9, inner.core, inner.border, by_a.ratio, u[:2], y_bar.border, y_bar.corner
    )
    w_diagonal = side_of_beams(ratio_w, by_a.over, fraction, by_a.middle, edge(y_bar), w_border)
    w = Side(w_core, w_border, w_diagonal)
    mixed = _both_sides(w.core, w.border, by_a.border, by_a.core)
    z_core = _start_z_core(square, z_bar.core, u.core, mixed)
    z_edge, p_edge = _start_z_edge(
        square, u[1:], w[1:], by_a.ratio, ratio_w, edge(y_bar), edge(z_bar)
    )
    z = Bordered(z_core, *z_edge)
    v = side(inner, z)
    twice = _both_sides(v.core, v.border, inner.border, inner.core)
    a_core, p_core = _start_cores(
        square, d, y_bar.core, w.core, z.core, v.core, twice, z_bar.core, mixed
    )
    a_edge, p_edge = _start_edges(
        square, d, edge(y_bar), w[1:], ratio_w, edge(z), v[1:], inner.ratio, p_edge
    )
    return Bordered(a_core, *a_edge), Bordered(p_core, *p_edge)


_both_sides = fenced(both_sides)


@fenced
def _chained(ninth, v, sent_v, ratio_u, with_u, x_border, corner):
    """Core and border with W on one side from those with U."""
    core, border = with_u
    sent = sent_v * ratio_u
    both = product(v, core) + 0.5 * product(sent, transpose(x_border))
    driven = product(v, border) + swapped(sent) * corner
    return core / 3 - ninth * both, border / 3 - ninth * driven


@fenced
def _start_z_core(square, z_core, u, mixed):
    return z_core + symmetric(square * mixed - u)


@fenced
def _start_z_edge(square, u, w, ratio_u, ratio_w, y_bar, z_bar):
    border, diagonal = (0.5 * (x * ratio_w + y * ratio_u) for x, y in zip(u, w, strict=True))
    mixed = Edge(
        border,
        diagonal,
        0.5 * (ratio_u[1:] * ratio_w[:1] + ratio_w[1:] * ratio_u[:1]) * y_bar.corner,
    )
    each = _each(ratio_u, u[0], u[1], y_bar)
    p = Edge(*(q + square * m for q, m in zip(z_bar, mixed, strict=True)))
    return Edge(*(x - 0.5 * e for x, e in zip(p, each, strict=True))), p


@fenced
def _start_cores(square, d, y, w, z, v, twice, z_bar, mixed):
    quartic = square * square
    a = y + square * (z / 3 - w) - quartic / 9 * (2 * v - d * square * twice)
    return a, z_bar + square * mixed + (5 / 9) * quartic * twice


@fenced
def _start_edges(square, d, y_bar, w, ratio_w, z, v, ratio_v, p_edge):
    each_w, each_v = _each(ratio_w, w[0], w[1], y_bar), _each(ratio_v, v[0], v[1], z)
    twice = _twice(ratio_v, v[0], v[1], z)
    quartic = square * square
    a = (
        y + square * (x / 3 - 0.5 * ew) - quartic / 9 * (ev - d * square * t)
        for y, x, ew, ev, t in zip(y_bar, z, each_w, each_v, twice, strict=True)
    )
    return Edge(*a), Edge(*(p + (5 / 9) * quartic * t for p, t in zip(p_edge, twice, strict=True)))


class MatrixSlopes(NamedTuple):
    """Slopes over h in what one matrix is made of, and its part of the slope in h."""

    moments: Float[Array, "degree *batch"]
    beams: Float[Array, "2 degree *batch"]
    secants: Float[Array, "2 *batch"]
    h: Float[Array, "*batch"]


def undo_matrix(
    kernels: ModeKernels,
    moments: Float[Array, "degree *batch"],
    secants: Float[Array, "2 *batch"],
    bar: Bordered,
    single_scattering: bool,
    coalbedo: Float[Array, "*batch"],
    mean: Float[Array, ""],
) -> tuple[MatrixSlopes, Float[Array, "*batch"]]:
    """Pull-back of `layer_matrix`, and in the azimuthal mean of `conservative`.

    The matrix is linear in moments, secants and the constant or co-albedo on its diagonal: the
    products of these with their own slopes add up to its product with its cotangent.
    """
    core, own, rest = _undo_diagonal(bar.core, coalbedo, mean)
    pairs, nodes = _on_pairs(kernels.nodes, core), _on_nodes(kernels.nodes, bar.border)
    corner = bar.corner if single_scattering else None
    slopes = _undo_products(
        pairs, nodes, kernels.beams, moments, secants, bar.diagonal, corner, rest
    )
    return slopes, own


def undo_inverse(
    kernels: ModeKernels,
    moments: Float[Array, "degree *batch"],
    p: Bordered,
    p_bar: Bordered,
    single_scattering: bool,
) -> MatrixSlopes:
    r"""Pull-back of the inverse p of `layer_matrix`.

    :math:`\bar B = -p\bar p p` is seen by the functions of each degree alone, so that p is applied
    to these, and not to the cotangent on both sides. As dp = -p where dB = B, the products of all
    that B is made of with its own slopes add up to :math:`-\langle\bar p, p\rangle`.
    """
    border = _border_of_side(p.core, p.border, p_bar.border, p_bar.corner)
    solved = kernel_of_product(_by_degrees, moments.shape[0])(kernels.nodes, p.core)
    driven = matmul(p_bar.core, solved)
    sent, nodes = _on_nodes(kernels.nodes, p.border), _on_nodes(kernels.nodes, border)
    pairs = _between_degrees(solved, driven, sent, nodes, p_bar.corner)
    corner = p_bar.corner if single_scattering else None
    cores = _columns_of_products(p.core, p_bar.core)
    return _undo_inverse(pairs, nodes, kernels.beams, moments, edge(p), edge(p_bar), cores, corner)


@fenced
def _border_of_side(left, sent, border, corner):
    return product(left, border) + swapped(sent) * corner


@fenced
def _between_degrees(solved, driven, sent, nodes, corner):
    return total(solved * driven) + total(sent * nodes) - corner * sent[0] * sent[1]


@fenced
def _columns_of_products(x, y):
    return total(x * y)


@fenced
def _undo_inverse(pairs, nodes, beams, moments, p: Edge, p_bar: Edge, cores, corner):
    own = total(p.border * p_bar.border) + p.diagonal * p_bar.diagonal
    passed = p.corner * p_bar.corner
    if corner is not None:
        corner = -p.diagonal[0] * p.diagonal[1] * corner
    slope, to_beams = _of_products(-pairs, -p.diagonal[:, None] * nodes, beams, corner)
    diagonal, h = -p.diagonal * (own + passed), -(total(cores) + own[0] + own[1] + passed[0])
    return MatrixSlopes(-slope, -moments * to_beams, diagonal, h)


def _undo_diagonal(core, coalbedo, mean):
    """The core's cotangent, the co-albedo's slope, and the constants' own part of the product."""
    mu, weight = double_gauss(2 * core.shape[0])
    expand = (-1,) + (1,) * (core.ndim - 2)
    inverse_mu = np.asarray(1 / mu, core.dtype).reshape(expand)
    s = np.sqrt(weight * mu)
    ratio = np.asarray(s[None] / s[:, None], core.dtype).reshape(mu.size, *expand)
    eye = np.eye(mu.size, dtype=bool).reshape(mu.size, *expand)

    @fenced
    def own_part(core):
        return total([inverse_mu[i] * core[i, i] for i in range(core.shape[0])])

    @fenced
    def without(core):
        diagonal = jnp.stack([core[i, i] for i in range(core.shape[0])])
        return jnp.where(eye, 0, core - diagonal[:, None] * ratio)

    own = own_part(core)
    rest = jax.lax.cond(mean > 0, without, lambda core: core, core)
    return rest, mean * own, own * jnp.where(mean > 0, coalbedo, 1)


def _on_pairs(nodes, core):
    """Of each degree, the core between its functions: two short sums, for one over all pairs."""
    half = kernel_of_product(_by_degrees, nodes.shape[0])(nodes, core)
    return _on_same_degree(nodes, half)


def _by_degrees(nodes, core):
    return product(core, nodes[(...,) + (None,) * (core.ndim - 2)])


@fenced
def _on_same_degree(nodes, half):
    expand = (slice(None),) + (None,) * (half.ndim - 2)
    return total([nodes[i][expand] * half[i] for i in range(nodes.shape[0])])


@fenced
def _on_nodes(nodes, border):
    expand = (None, slice(None)) + (None,) * (border.ndim - 2)
    return total([nodes[i][expand] * border[i][:, None] for i in range(nodes.shape[0])])


@fenced
def _undo_products(core, nodes, beams, moments, secants, diagonal, corner, rest):
    slope, to_beams = _of_products(core, nodes, beams, corner)
    h = rest + total(secants * diagonal) - total(moments * slope)
    return MatrixSlopes(-slope, -moments * to_beams, diagonal, h)


def _of_products(pairs, nodes, beams, corner):
    """Slopes in minus the moments, and in their products with what the beams are."""
    if corner is None:
        return pairs + total(beams * nodes), nodes
    slope = pairs + total(beams * nodes) + corner * beams[0] * beams[1]
    return slope, nodes + corner * beams[::-1]
