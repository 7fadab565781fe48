r"""What a little more of each property would do at a face between two layers.

A thin layer of thickness dtau between layers changes the stack's admittance by
:math:`dY = (A - YBY)\,d\tau`, so that with the fields F above it and G = YF the reflection's
derivative, layer by infinitesimal layer, is

.. math:: \frac{dR}{d\tau} = \langle pair(F), A \rangle - \langle pair(G), B \rangle .

A and B are linear in the co-albedo, the sun's secant and the moments of the layer, whatever it is:
the slopes of these at faces, and that of what is left of a layer without any, tell how slopes vary
inside layers that are solved as one (`skipping.merging`).

Either cotangent is that of two fields alone, so that the functions of a degree are seen by each
field by itself: with the degree's sum over nodes and own beam :math:`p = \phi\cdot F + \psi F_0`
the slope in minus its moment is :math:`p_s p_v`, and no matrix is formed. The azimuthal mean's
diagonal, which is rebuilt from the co-albedo (`method.layer.conservative`), takes
:math:`(\sum_i \phi_i F_{s,i} F_{v,i}/s_i)(\sum_j \phi_j s_j)` from that.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.algebra import fenced, product, total
from ..method.bordered import Bordered
from ..method.layer import ModeKernels
from ..method.mode_layers import Order
from ..method.quadrature import half_range, node_scales
from .fields import Fields, swapped
from .pull_back import on_nodes


def slopes_at_face(
    fields: Fields,
    stack: Bordered,
    kernels: tuple[ModeKernels, ModeKernels],
    view_secant: Float[Array, "*batch"],
    single_scattering: bool,
    order: Order,
) -> Float[Array, "row *batch"]:
    """Slopes at the upper face of a stack, of one mode.

    Returns
    -------
    The slope in a thickness that neither scatters nor attenuates the sun, and then those in
    co-albedo, sun's secant and moments of even and of odd degrees, each times a thickness.
    """
    behind = _acted_on(stack, fields)
    a, b = (
        _in_minus_moments(k, x, single_scattering)
        for k, x in zip(kernels, (fields, behind), strict=True)
    )
    a = jax.lax.cond(order.mean > 0, _without_diagonal, _same, a, kernels[0].nodes, fields.nodes)
    return _rows(fields, behind, view_secant, a, b, order)


def _acted_on(stack: Bordered, fields: Fields) -> Fields:
    nodes, other = _through(stack.core, stack.border, stack.corner, *fields)
    return Fields(nodes, fields.own, other)


@fenced
def _through(core, border, corner, nodes, own, other):
    """Nodes and the other beam of each field behind a matrix whose diagonal is 1."""
    sent = total(swapped(border) * nodes) + corner * own + other
    return product(core, nodes) + border * own, sent


def _in_minus_moments(kernels: ModeKernels, fields: Fields, single_scattering: bool):
    """What of pair(F) each degree sees."""
    seen = on_nodes(kernels.nodes, fields.nodes)
    return (_of_all if single_scattering else _of_diffuse)(seen, kernels.beams, fields.own)


@fenced
def _of_all(seen, beams, own):
    lit = seen + own[:, None] * beams
    return lit[0] * lit[1]


@fenced
def _of_diffuse(seen, beams, own):
    """The same but for the product of both beams, which nothing is taken from to leave it out."""
    of_beams = own[:, None] * beams
    return (seen[0] + of_beams[0]) * seen[1] + seen[0] * of_beams[1]


def _without_diagonal(slopes, nodes, fields):
    """The mean's slopes: its diagonal is formed from the other entries of its row."""
    s = node_scales(2 * nodes.shape[0]).tolist()

    @fenced
    def without(slopes, nodes, fields):
        expand = (slice(None),) + (None,) * (fields.ndim - 2)
        own = fields[:, 0] * fields[:, 1]
        row = total([(nodes[i] / s[i])[expand] * own[i] for i in range(len(s))])
        return slopes - row * total([s[j] * nodes[j] for j in range(len(s))])[expand]

    return without(slopes, nodes, fields)


def _same(slopes, nodes, fields):
    return slopes


def _rows(fields: Fields, behind: Fields, view_secant, a, b, order: Order):
    mu, _ = half_range(2 * fields.nodes.shape[0])
    inverse_mu = (1 / mu).tolist()

    @fenced
    def rows(fields, behind, view_secant, a, b, order):
        a_own, b_own = (
            total([x * f.nodes[i, 0] * f.nodes[i, 1] for i, x in enumerate(inverse_mu)])
            for f in (fields, behind)
        )
        to_sun, to_view = (fields.other - behind.other)[::-1] * fields.own
        bare = jnp.where(order.mean > 0, 0, a_own) - b_own + view_secant * to_view
        even, odd = jnp.where(order.odd > 0, b, -a), jnp.where(order.odd > 0, -a, b)
        single = jnp.stack([bare, order.mean * a_own, to_sun])
        return jnp.concatenate([single, even, odd])

    return rows(fields, behind, view_secant, a, b, order)
