r"""Which neighbouring layers are solved as one.

Two neighbours of optical depths T and t, in one homogeneous layer of their mean, send back as much
as apart but for the order in which light meets them. Of light that goes down and up along secants s
that is

.. math:: \frac{|\Delta|}{2}\,\frac{sT}{1+sT}\,\frac{st}{1+s(T+t)}, \qquad
   |\Delta| = (1 + \tfrac34 d) |\Delta\omega|
   + \max(|\Delta(\omega g)|, |\Delta(\omega\chi_2)|) + |\Delta(\omega\chi_k)|
   + \frac{|\Delta s_\odot|}{s_\odot},

with rational functions in place of exponentials: the first moments of what differs and one of half
the streams' degree k, since layers with different phase functions may have one g (delta-M brings
those of droplets of other sizes together), and the secants of a low sun, which differ over a
spherical Earth, and by which more or less of its light is left for the layers below. (All of it is
a share of the light of a sun that stands where flat layers would have such a secant:
`plan.planned`.) In thick layers light is scattered many times, and absorbed as often as that: d is
the larger (1 - omega g) tau of the two, as a thin black layer counts for little under a thick white
one, and for much if it is spread through it. From the top, each layer joins the group above it
while the sum of this over the group's members, seen through what lies above (1 / (1 + `ATTENUATION`
times its backward depth)), stays below what the error budget allows; else it starts a new group.

A group emits as if its Planck function were linear in optical depth (`heat`). Its light is off by
less than a quarter of the range D of the Planck function in it, of which that part counts that any
layer scatters, those of all the column having the scattering depth S:

.. math:: \frac{D}{4}\,\frac{sT}{1+sT}\,\frac{sS}{1+sS},

which each group may do once.
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
_DIFFUSED = 0.75  # times tau (1 - g): how often light is scattered in a layer, and may be absorbed
_OFF = 0.25  # largest distance of a curve from its chord, over its range, of what bends evenly


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


class Alike(NamedTuple):
    """By what layers are alike.

    Parameters
    ----------
    tau, scattered, forward
        Optical depth, omega and omega g of each layer as it is solved. [-]
    further
        Omega times the moment of half the streams' degree, where it is looked at. [-]
    planck, light
        Of columns that emit, the Planck function at the upper face of each layer and at the ground,
        and what comes upon the layers from above and from below (`heat.Warm`); else None. [radiance
        unit]
    second
        Omega times the second moment, where `further` is of a higher degree. [-]
    sun_secants
        Of the sun's beam, where they may differ. [-]
    """

    tau: Float[Array, "layer *batch"]
    scattered: Float[Array, "layer *batch"]
    forward: Float[Array, "layer *batch"]
    further: Float[Array, "layer *batch"] | None = None
    planck: Float[Array, "level *batch"] | None = None
    light: Float[Array, "*batch"] | None = None
    second: Float[Array, "layer *batch"] | None = None
    sun_secants: Float[Array, "layer *batch"] | None = None


class Limits(NamedTuple):
    """What a group may be.

    Parameters
    ----------
    secant
        Mean secant of sun and view. [-]
    allowed
        What it may lose, of the reflectance or the radiance.
    thickest
        Optical depth on the way down and up that it does not exceed, but a layer alone. [-]
    """

    secant: Float[Array, "*batch"]
    allowed: Float[Array, "*batch"]
    thickest: float


def grouped(alike: Alike, limits: Limits) -> Groups:
    """Groups of a tile's layers, as above."""
    labels = group_labels(alike, limits)
    axes = tuple(range(1, labels.ndim))
    first, last = jnp.min(labels, axis=axes), jnp.max(labels, axis=axes)
    return Groups(labels, first, last, last[-1] + 1)


def group_labels(alike: Alike, limits: Limits) -> Float[Array, "layer *batch"]:
    """Number of each layer's group."""
    if alike.tau.shape[0] == 1:  # nothing to look at, of which no kernel can be made
        return jnp.zeros_like(alike.tau)
    return one_kernel(_labels, 1)(*_without_slopes(alike, limits))


def _without_slopes(alike: Alike, limits: Limits):
    slant = 2 * jnp.maximum(limits.secant, LEAST_SECANT / 2)
    thickest = jnp.full_like(slant, limits.thickest)
    depth = slant * jnp.sum(alike.scattered * alike.tau, axis=0)
    turned = depth / (1 + depth)  # share of light on its way that is scattered
    cosine = None if alike.sun_secants is None else 1 / alike.sun_secants[0]
    return jax.lax.stop_gradient((alike, slant, limits.allowed, thickest, turned, cosine))


class _Group(NamedTuple):
    """The group that layers join: sums over its members, `others` those of the moments and secants
    that are looked at; what it has lost, what lies above; and of those that emit the Planck
    function at its upper face, and how far from it that is anywhere."""

    tau: Array
    scattered: Array
    forward: Array
    others: tuple[Array | None, ...]
    lost: Array
    above: Array
    label: Array
    planck: Array | None
    span: Array | None


def _labels(alike: Alike, slant, allowed, thickest, turned, cosine):
    def step(group: _Group, layer):
        t, w, f, (q, p, sun), faces = layer
        depth, total = group.tau, group.tau + t
        # Differences of omega and so on, times T: one quotient in all, as they take long.
        sent_back = jnp.maximum(depth - group.forward, 0), jnp.maximum(t - f * t, 0)
        often = 1 + _DIFFUSED * jnp.maximum(*sent_back)
        absorbing = often * jnp.abs(group.scattered - w * depth)
        turning = jnp.abs(group.forward - f * depth)
        further, second, slant_of_sun = group.others
        if second is not None:
            turning = jnp.maximum(turning, jnp.abs(second - p * depth))
        difference = absorbing + turning
        if further is not None:
            difference = difference + jnp.abs(further - q * depth)
        if slant_of_sun is not None:
            difference = difference + cosine * jnp.abs(slant_of_sun - sun * depth)
        hidden = (1 + slant * depth) * (1 + slant * total) * (1 + ATTENUATION * group.above)
        loss = 0.5 * difference * slant * slant * t / hidden
        if alike.light is not None:
            loss = alike.light * loss
        lost = group.lost + loss
        new = (lost > allowed) | ((slant * total > thickest) & (depth > 0))
        span, start, own_span = None, None, None
        if faces is not None:
            assert group.planck is not None and group.span is not None
            upper, lower = faces
            span = jnp.maximum(group.span, jnp.abs(lower - group.planck))
            new = new | (_OFF * span * turned * slant * total / (1 + slant * total) > allowed)
            start, own_span = upper, jnp.abs(lower - upper)
        joined = _Group(
            total,
            group.scattered + w * t,
            group.forward + f * t,
            jax.tree.map(lambda x, y: x + y * t, group.others, (q, p, sun)),
            lost,
            group.above,
            group.label,
            group.planck,
            span,
        )
        above = group.above + sent_back[0]
        own = jax.tree.map(lambda x: x * t, (q, p, sun))
        fresh = _Group(t, w * t, f * t, own, 0 * t, above, group.label + 1, start, own_span)
        group = jax.tree.map(lambda x, y: jnp.where(new, x, y), fresh, joined)
        return group, group.label

    tau, planck = alike.tau, alike.planck
    t, w, f = tau[0], alike.scattered[0], alike.forward[0]
    faces = None if planck is None else (planck[1:-1], planck[2:])
    warmth = (None, None) if planck is None else (planck[0], jnp.abs(planck[1] - planck[0]))
    # Numbers of groups are those of a tile: a column that is no number has them, too.
    some = alike.further, alike.second, alike.sun_secants
    own = jax.tree.map(lambda x: x[0] * t, some)
    start = _Group(t, w * t, f * t, own, 0 * t, 0 * t, jnp.zeros_like(t), *warmth)
    rest = jax.tree.map(lambda x: x[1:], some)
    layers = tau[1:], alike.scattered[1:], alike.forward[1:], rest, faces
    _, labels = jax.lax.scan(step, start, layers)
    return jnp.concatenate([start.label[None], labels])
