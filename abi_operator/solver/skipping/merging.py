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
    def add(layer, sums):
        t = read(tau, layer)
        x = t * read(rows, layer)
        label = read(groups.labels, layer)

        def put(k, sums):
            mine = label == k.astype(label.dtype)
            depth, weighted = sums
            return (
                added_to(depth, k, jnp.where(mine, t, 0)),
                added_to(weighted, k, jnp.where(mine, x, 0)),
            )

        return _for_groups_of(groups, layer, put, sums)

    # Where a column has fewer groups than others, or nothing in one, the group is like the top.
    little = jnp.full_like(tau, _EMPTY), jnp.broadcast_to(_EMPTY * rows[:1], rows.shape)
    depth, weighted = jax.lax.fori_loop(0, tau.shape[0], add, little)

    def mean(k, weighted):
        own = read(weighted, k) / read(depth, k)
        return jax.lax.dynamic_update_index_in_dim(weighted, own, k, 0)

    return depth, jax.lax.fori_loop(0, groups.number.astype(jnp.int32), mean, weighted)


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
    def give(layer, state):
        above, before, of_tau, of_rows = state
        t, x, label = (read(stack, layer) for stack in (tau, rows, groups.labels))
        above = jnp.where(label == before, above, 0)

        def take(k, found):
            share = jnp.where(label == k.astype(label.dtype), 1, 0)
            return found + share * _inside(solved, k, above, t)

        inside = _for_groups_of(groups, layer, take, jnp.zeros_like(read(solved.faces, layer)))
        own = t * inside[1:]
        slope = inside[0]
        for j in range(x.shape[0]):
            slope = slope + x[j] * inside[1 + j]
        return (
            above + t,
            label,
            jax.lax.dynamic_update_index_in_dim(of_tau, slope, layer, 0),
            jax.lax.dynamic_update_index_in_dim(of_rows, own, layer, 0),
        )

    nothing = jnp.zeros_like(tau[0]), jnp.zeros_like(tau[0])
    start = *nothing, jnp.zeros_like(tau), jnp.zeros_like(rows)
    return jax.lax.fori_loop(0, tau.shape[0], give, start)[2:]


def _inside(solved: Solved, k, above, t):
    """Slopes in a thickness and in rows times it, where `above` of group k is above it."""
    depth, means, upper, lower = (
        read(solved.tau, k),
        read(solved.rows, k),
        read(solved.faces, k),
        read(solved.faces, k + 1),
    )
    of_rows = read(solved.row_slopes, k) / depth
    of_tau = read(solved.tau_slopes, k)
    for j in range(means.shape[0]):
        of_tau = of_tau - means[j] * of_rows[j]
    mean = jnp.concatenate([of_tau[None], of_rows])
    a, b = above / depth, (above + t) / depth
    middle, curved = (a + b) / 2, (a + b) / 2 - (a * a + a * b + b * b) / 3
    return (1 - middle - 3 * curved) * upper + (middle - 3 * curved) * lower + 6 * curved * mean


def _for_groups_of(groups: Groups, layer, body, carry) -> Any:
    """Repeat for every group that the layer belongs to in some column of the tile."""
    first, last = (read(x, layer).astype(jnp.int32) for x in (groups.first, groups.last))
    return jax.lax.fori_loop(first, last + 1, body, carry)
