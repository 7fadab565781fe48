r"""Which neighbouring layers are solved as one.

Two neighbours of optical depths T and t, in one homogeneous layer of their mean, send back as much
as apart but for the order in which light meets them. Of light that goes down and up along secants s
that is

.. math:: \frac{|\Delta|}{2}\,\frac{sT}{1+sT}\,\frac{st}{1+s(T+t)}, \qquad
   |\Delta| = |\Delta\omega| + |\Delta(\omega g)|,

the first moment of what differs, with rational functions in place of exponentials. From the top,
each layer joins the group above it while the sum of this over the group's members, seen through
what lies above (1 / (1 + `ATTENUATION` times its backward depth)), stays below what the error
budget allows; else it starts a new group.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.kernels import one_kernel

ATTENUATION = 0.25
"""How the depth above, times 1 - g, hides what is below. [-]"""
LEAST_SECANT = 2.0
"""Of light that has been scattered more than once, at least. [-]"""


class Groups(NamedTuple):
    """Groups of layers of a tile of columns; numbers are floating, as they go into kernels.

    Parameters
    ----------
    labels
        Number of each layer's group in its column, from 0 at the top.
    first, last
        The smallest and the largest of these numbers over the columns of the tile.
    number
        Groups of the column that has most.
    """

    labels: Float[Array, "layer *batch"]
    first: Float[Array, " layer"]
    last: Float[Array, " layer"]
    number: Float[Array, ""]


def grouped(
    tau: Float[Array, "layer *batch"],
    scattered: Float[Array, "layer *batch"],
    forward: Float[Array, "layer *batch"],
    secant: Float[Array, "*batch"],
    allowed: Float[Array, "*batch"],
    thickest: float,
) -> Groups:
    """Groups of a tile's layers, as above.

    Parameters
    ----------
    tau, scattered, forward
        Optical depth, omega and omega g of each layer as it is solved. [-]
    secant
        Mean secant of sun and view. [-]
    allowed
        What a group may lose, of the reflectance. [-]
    thickest
        Optical depth on the way down and up that no group exceeds, but a layer alone. [-]
    """
    arguments = _without_slopes(tau, scattered, forward, secant, allowed, thickest)
    labels = one_kernel(_labels, 1)(*arguments)
    axes = tuple(range(1, labels.ndim))
    first, last = jnp.min(labels, axis=axes), jnp.max(labels, axis=axes)
    return Groups(labels, first, last, last[-1] + 1)


def group_labels(
    tau: Float[Array, "layer *batch"],
    scattered: Float[Array, "layer *batch"],
    forward: Float[Array, "layer *batch"],
    secant: Float[Array, "*batch"],
    allowed: Float[Array, "*batch"],
    thickest: float,
) -> Float[Array, "layer *batch"]:
    """Number of each layer's group, of any number of columns; arguments as in `grouped`."""
    return _labels(*_without_slopes(tau, scattered, forward, secant, allowed, thickest))


def _without_slopes(tau, scattered, forward, secant, allowed, thickest):
    slant = 2 * jnp.maximum(secant, LEAST_SECANT / 2)
    return jax.lax.stop_gradient(
        (tau, scattered, forward, slant, allowed, jnp.full_like(slant, thickest))
    )


class _Group(NamedTuple):
    """The group that layers join: sums over its members, what it has lost, what lies above."""

    tau: Array
    scattered: Array
    forward: Array
    lost: Array
    above: Array
    label: Array


def _labels(tau, scattered, forward, slant, allowed, thickest):
    def step(group: _Group, layer):
        t, w, f = layer
        own = jnp.where(group.tau > 0, group.tau, 1)
        depth, total = group.tau, group.tau + t
        difference = jnp.abs(group.scattered / own - w) + jnp.abs(group.forward / own - f)
        loss = 0.5 * difference * slant * depth / (1 + slant * depth)
        loss = loss * slant * t / (1 + slant * total) / (1 + ATTENUATION * group.above)
        lost = group.lost + loss
        new = (lost > allowed) | ((slant * total > thickest) & (depth > 0))
        joined = _Group(
            total,
            group.scattered + w * t,
            group.forward + f * t,
            lost,
            group.above,
            group.label,
        )
        backward = jnp.maximum(depth - group.forward, 0)
        fresh = _Group(t, w * t, f * t, 0 * t, group.above + backward, group.label + 1)
        group = jax.tree.map(lambda x, y: jnp.where(new, x, y), fresh, joined)
        return group, group.label

    t, w, f = tau[0], scattered[0], forward[0]
    start = _Group(t, w * t, f * t, 0 * t, 0 * t, 0 * t)
    _, labels = jax.lax.scan(step, start, (tau[1:], scattered[1:], forward[1:]))
    return jnp.concatenate([start.label[None], labels])
