"""What the beams see of the quotients of a layer: formed again on the way down.

Their own entries of a layer's matrices are a few numbers for each beam, which takes less time to
form again than to keep.
"""

from typing import NamedTuple

from jaxtyping import Array, Float

from ...machine.rows import in_rows
from ..method.bordered import combined, reciprocal
from .fields import Feed


class Beams(NamedTuple):
    """Beams' own entries of the start's quotients: of right over middle, and 1 over the middle.

    And those of Y and Z that the start leaves.
    """

    ratio_v: Float[Array, "beam *batch"]
    ratio_u: Float[Array, "beam *batch"]
    ratio_w: Float[Array, "beam *batch"]
    over_v: Float[Array, "beam *batch"]
    over_u: Float[Array, "beam *batch"]
    y: Float[Array, "beam *batch"]
    z: Float[Array, "beam *batch"]


def own_beams(a, p, h, d) -> Beams:
    """As on the way up."""
    square = h * h
    over_v = reciprocal(_inner_middle(d * square, p, a))
    fraction, ratio_v = _fraction(square / 9, a, over_v)
    z = _sum(square, p, fraction)
    over_u = reciprocal(z)
    ratio_u, ratio_w = _times((), over_u, a, fraction)
    y = _less((h, h * square), a, a, ratio_w)
    return Beams(ratio_v, ratio_u, ratio_w, over_v, over_u, y, z)


class Step(NamedTuple):
    """What beams see of Y and Z between two doublings."""

    y: Float[Array, "beam *batch"]
    z: Float[Array, "beam *batch"]
    z_feed: Feed
    h: Float[Array, "*batch"]


def next_step(step: Step, y_feed: Feed) -> tuple[Step, Array, Array]:
    """After a doubling; and the ratio, and 1 over the middle, of its quotient."""
    y, z, z_feed, h = step
    z_feed = combined([1.0, h], [z_feed, y_feed])
    z = _sum(h, z, y)
    over = reciprocal(z)
    (ratio,) = _times((), over, y)
    return Step(_less((2.0, 2 * h), y, y, ratio), z, z_feed, 2 * h), ratio, over


@in_rows
def _inner_middle(weight, p, a):
    return 5.0 * p + weight * a


@in_rows
def _fraction(ninth, a, over):
    ratio = a * over
    return a / 3 - ninth * (a * ratio), ratio


@in_rows
def _sum(weight, x, y):
    return x + weight * y


@in_rows
def _times(_, over, *rights):
    return tuple(x * over for x in rights)


@in_rows
def _less(weights, x, y, ratio):
    of_x, of_y = weights
    return of_x * x - of_y * (y * ratio)
