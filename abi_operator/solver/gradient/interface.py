r"""What a little more of each property would do at a face between two layers.

A thin layer of thickness dtau between layers changes the stack's admittance by
:math:`dY = (A - YBY)\,d\tau`, so that with the fields F above it and G = YF the reflection's
derivative, layer by infinitesimal layer, is

.. math:: \frac{dR}{d\tau} = \langle pair(F), A \rangle - \langle pair(G), B \rangle .

A and B are linear in the co-albedo, the sun's secant and the moments of the layer, whatever it is:
the slopes of these at faces, and that of what is left of a layer without any, tell how slopes vary
inside layers that are solved as one (`skipping.merging`).
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.algebra import fenced, product, total
from ..method.bordered import Bordered
from ..method.layer import ModeKernels
from ..method.mode_layers import Order
from .fields import Fields, pair, swapped
from .pull_back import undo_matrix


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
    nothing = jnp.zeros_like(kernels[0].beams[0])
    secants = jnp.stack([jnp.zeros_like(view_secant), view_secant])
    bars = pair(1.0, [fields]), pair(-1.0, [_acted_on(stack, fields)])
    of_mean = order.mean, jnp.zeros_like(order.mean)
    (a, coalbedo), (b, _) = (
        undo_matrix(k, nothing, secants, bar, single_scattering, jnp.zeros_like(view_secant), mean)
        for k, bar, mean in zip(kernels, bars, of_mean, strict=True)
    )
    return _rows(a.h, b.h, coalbedo, a.secants, b.secants, a.moments, b.moments, order.odd)


def _acted_on(stack: Bordered, fields: Fields) -> Fields:
    nodes, other = _through(stack.core, stack.border, stack.corner, *fields)
    return Fields(nodes, fields.own, other)


@fenced
def _through(core, border, corner, nodes, own, other):
    """Nodes and the other beam of each field behind a matrix whose diagonal is 1."""
    sent = total(swapped(border) * nodes) + corner * own + other
    return product(core, nodes) + border * own, sent


@fenced
def _rows(a_h, b_h, coalbedo, a_secants, b_secants, a_moments, b_moments, odd):
    even = jnp.where(odd > 0, b_moments, a_moments)
    others = jnp.where(odd > 0, a_moments, b_moments)
    single = jnp.stack([a_h + b_h, coalbedo, a_secants[0] + b_secants[0]])
    return jnp.concatenate([single, even, others])
