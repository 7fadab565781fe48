"""Pull-backs of the inverse of B and of what A and B are made of.

Cotangents are `Bordered`, and over h (`mode`): nothing is ever divided by h.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...machine.algebra import fenced, kernel_of_product, matmul, product, total
from ..method.bordered import Bordered
from ..method.layer import ModeKernels
from ..method.quadrature import half_range, node_scales
from .fields import Edge, edge, swapped


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
    pairs, nodes = _on_pairs(kernels.nodes, core), on_nodes(kernels.nodes, bar.border)
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
    sent, nodes = on_nodes(kernels.nodes, p.border), on_nodes(kernels.nodes, border)
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
    mu = half_range(2 * core.shape[0])[0]
    expand = (-1,) + (1,) * (core.ndim - 2)
    inverse_mu = np.asarray(1 / mu, core.dtype).reshape(expand)
    s = node_scales(2 * core.shape[0])
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
def on_nodes(nodes, border):
    """Of each degree, the sum over the nodes of its functions times a border or fields."""
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
