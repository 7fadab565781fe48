r"""Layers merged into groups, and slopes of groups handed back to their members.

A group has the sum of its members' optical depths, and of all else (`rows`: what A and B of a layer
are linear in) the mean weighted by these. How much a little more of a row q times a thickness
counts at a depth x of the group, 0 to 1, is a smooth function :math:`d_q(x)`, of which the mean is
known from the slope in the group's q, and the values at both faces from the fields there
(`gradient.interface`). Between them it is taken as the parabola with that mean,

.. math:: d(x) = (1-x)\,d(0) + x\,d(1) + 6x(1-x)\left[\bar d - \tfrac12(d(0)+d(1))\right],

of which a member sees the mean over its own depths: its slope in q is tau times that, and that in
tau the sum of :math:`q\,d_q` and of what a thickness without any of the rows counts. What the
parabola misses grows with the group's depth, which is limited where slopes are wanted
(`budget.THICKEST`).
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.kernels import one_kernel
from ..method.mode_layers import added_to, read
from .grouping import Groups

_EMPTY = 1e-30  # optical depth that every group has, so that it has means


def merged(
    groups: Groups, tau: Float[Array, "layer *batch"], rows: Float[Array, "layer row *batch"]
) -> tuple[Float[Array, "layer *batch"], Float[Array, "layer row *batch"]]:
    """Optical depth and mean rows of each group, in the places of the first layers."""
    return one_kernel(_merged, 1)(groups, tau, rows)


def _merged(groups: Groups, tau, rows):
    def mean(k, found):
        def add(mine, layer, sums):
            t = jnp.where(mine, read(tau, layer), 0)
            return sums[0] + t, sums[1] + t * read(rows, layer)

        depth, weighted = _over_members(groups, k, add, tuple(read(x, k) for x in found))
        return _put(found[0], k, depth), _put(found[1], k, weighted / depth)

    # Where a column has fewer groups than others, or nothing in one, the group is like the top.
    little = jnp.full_like(tau, _EMPTY), jnp.broadcast_to(_EMPTY * rows[:1], rows.shape)
    return jax.lax.fori_loop(0, groups.number.astype(jnp.int32), mean, little)


def summed(groups: Groups, x: Float[Array, "layer *batch"]) -> Float[Array, "layer *batch"]:
    """Sum over the members of each group, in the places of the first layers."""
    return one_kernel(_summed, 1)(groups, x)


def _summed(groups: Groups, x):
    def total(k, found):
        def add(mine, layer, own):
            return own + jnp.where(mine, read(x, layer), 0)

        return _put(found, k, _over_members(groups, k, add, read(found, k)))

    return jax.lax.fori_loop(0, groups.number.astype(jnp.int32), total, jnp.zeros_like(x))


class Solved(NamedTuple):
    """Groups as they were solved, and slopes in them.

    Parameters
    ----------
    tau, rows
        Optical depth and means of the groups.
    tau_slopes, row_slopes
        Slopes in these.
    faces
        Slopes at the upper faces of the groups and at the ground, in a thickness without any of the
        rows, and in each row times a thickness (`gradient.interface`).
    """

    tau: Float[Array, "layer *batch"]
    rows: Float[Array, "layer row *batch"]
    tau_slopes: Float[Array, "layer *batch"]
    row_slopes: Float[Array, "layer row *batch"]
    faces: Float[Array, "level row_and_one *batch"]


def handed_back(
    groups: Groups,
    tau: Float[Array, "layer *batch"],
    rows: Float[Array, "layer row *batch"],
    solved: Solved,
) -> tuple[Float[Array, "layer *batch"], Float[Array, "layer row *batch"]]:
    """Slopes in the members' depths and rows."""
    return one_kernel(_handed_back, 1)(groups, tau, rows, solved)


def _handed_back(groups: Groups, tau, rows, solved: Solved):
    number = groups.number.astype(jnp.int32)
    nothing = jnp.zeros_like(solved.faces)
    means = jax.lax.fori_loop(
        0, number, lambda k, means: added_to(means, k, _mean_slopes(solved, k)), nothing
    )

    def give(layer, state):
        above, before, of_tau, of_rows = state
        t, x, label = (read(stack, layer) for stack in (tau, rows, groups.labels))
        above = jnp.where(label == before, above, 0)

        def take(k, own):
            share = jnp.where(label == k.astype(label.dtype), 1, 0).astype(t.dtype)
            group = read(solved.tau, k), read(solved.faces, k), read(solved.faces, k + 1)
            return jax.tree.map(lambda x, y: x + share * y, own, (*group, read(means, k)))

        slopes = jnp.zeros_like(read(solved.faces, layer))
        of_its_group = jnp.zeros_like(t), slopes, slopes, slopes
        inside = _inside(above, t, *_for_groups_of(groups, layer, take, of_its_group))
        slope = inside[0]
        for j in range(x.shape[0]):
            slope = slope + x[j] * inside[1 + j]
        return (
            above + t,
            label,
            jax.lax.dynamic_update_index_in_dim(of_tau, slope, layer, 0),
            jax.lax.dynamic_update_index_in_dim(of_rows, t * inside[1:], layer, 0),
        )

    first = jnp.zeros_like(tau[0])
    start = first, first, jnp.zeros_like(tau), jnp.zeros_like(rows)
    return jax.lax.fori_loop(0, tau.shape[0], give, start)[2:]


def _mean_slopes(solved: Solved, k):
    """What faces have the slopes of, in the mean over a group."""
    of_rows = read(solved.row_slopes, k) / read(solved.tau, k)
    of_tau, means = read(solved.tau_slopes, k), read(solved.rows, k)
    for j in range(means.shape[0]):
        of_tau = of_tau - means[j] * of_rows[j]
    return jnp.concatenate([of_tau[None], of_rows])


def _inside(above, t, depth, upper, lower, mean):
    """Mean of the parabola over a member with so much of its group above it."""
    over = 1 / depth
    a, b = above * over, (above + t) * over
    middle = (a + b) / 2
    curved = middle - (a * a + a * b + b * b) / 3
    return (1 - middle - 3 * curved) * upper + (middle - 3 * curved) * lower + 6 * curved * mean


def _over_members(groups: Groups, k, body, carry) -> Any:
    """``carry = body(mine, layer, carry)`` for the layers that belong to a group in some column of
    the tile; `mine` tells in which. What is summed stays in few numbers, where to add to one of
    many in memory takes twice as long."""
    own = k.astype(groups.labels.dtype)
    first = jnp.sum(groups.last < own, dtype=jnp.int32)
    end = jnp.sum(groups.first <= own, dtype=jnp.int32)

    def add(layer, carry):
        return body(read(groups.labels, layer) == own, layer, carry)

    return jax.lax.fori_loop(first, end, add, carry)


def _put(stack, k, own):
    return jax.lax.dynamic_update_index_in_dim(stack, own, k, 0)


def _for_groups_of(groups: Groups, layer, body, carry) -> Any:
    """Repeat for every group that the layer belongs to in some column of the tile."""
    first, last = (read(x, layer).astype(jnp.int32) for x in (groups.first, groups.last))
    return jax.lax.fori_loop(first, last + 1, body, carry)
