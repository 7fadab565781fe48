"""What the beams see of the quotients of a layer: formed again on the way down.

Their own entries of a layer's matrices are a few numbers for each beam, which takes less time to
form again than to keep.
"""

from typing import NamedTuple

from jaxtyping import Array, Float

from ...machine.algebra import fenced
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
    over_v = reciprocal(_inner_middle(p, a, d * square))
    fraction, ratio_v = _fraction(a, over_v, square / 9)
    z = _sum(p, square, fraction)
    over_u = reciprocal(z)
    ratio_u, ratio_w = _times(over_u, a, fraction)
    y = _less(h, a, h * square, a, ratio_w)
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
    z = _sum(z, h, y)
    over = reciprocal(z)
    (ratio,) = _times(over, y)
    return Step(_less(2.0, y, 2 * h, y, ratio), z, z_feed, 2 * h), ratio, over


@fenced
def _inner_middle(p, a, weight):
    return 5.0 * p + weight * a


@fenced
def _fraction(a, over, ninth):
    ratio = a * over
    return a / 3 - ninth * (a * ratio), ratio


@fenced
def _sum(x, weight, y):
    return x + weight * y


@fenced
def _times(over, *rights):
    return [x * over for x in rights]


@fenced
def _less(weight, x, factor, y, ratio):
    return weight * x - factor * (y * ratio)
