"""One layer on the way up, which keeps what the way down needs, and on the way down."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.algebra import fenced
from ...machine.kernels import one_kernel, small_enough
from ..method.bordered import Bordered, combined, reciprocal
from ..method.doublings import Doublings, repeated
from ..method.quotient import Quotient, minus_and_quotient
from .fields import Action, Feed, Fields, act, advance, cotangents, feed
from .pull_back import undo_start, undouble

# Doublings undone by fields, and with so few nodes; the rest by matrices. Measured.
_BY_FIELDS, _BY_FIELDS_OF_FEW, _FEW_NODES = 2, 1, 2


class Part(NamedTuple):
    """A quotient's core and border: in blocks of rows on the way up, as arrays on the way down."""

    core: Any
    border: Any


class Kept(NamedTuple):
    """What the way down needs of a layer but for its doublings; diagonals are formed again."""

    b_inverse: Bordered
    a: Feed
    fraction: Feed
    inner: Part
    by_a: Part
    adding: Action


class Doubled(NamedTuple):
    """What the way down needs of a doubling, of Y before it; the rest is formed again."""

    quotient: Part
    right: Feed


def climb(
    stack: Bordered,
    a: Bordered,
    p: Bordered,
    tau: Float[Array, "*batch"],
    doublings: Doublings,
    room: Any,
    keep: Callable[[Any, Doubled, Any], Any],
) -> tuple[Bordered, Kept, Any]:
    """Put a layer of A and p = B^-1 on a stack: `method.layer.half_layer` and `adding.add_layer`.

    `keep` gives a room with a doubling in it, the number of which it is told.
    """
    number, step, start = doublings.of_layer()
    h = tau * step
    square = h * h
    inner = combined([5.0, start * square], [p, a])
    fraction, inner = minus_and_quotient([(1 / 3, a)], square / 9, a, inner, a)
    z = combined([1.0, square], [p, fraction])
    # A Z^-1 C from the other side, whose quotient gives that by C by another (`undo_start`).
    y, by_a = minus_and_quotient([(h, a)], h * square, fraction, z, a)

    def double(k, carry):
        y, z, h, room = carry
        z = combined([1.0, h], [z, y])
        right = feed(y)
        y, quotient = minus_and_quotient([(2.0, y)], 2 * h, y, z, y)
        return y, z, 2 * h, keep(room, Doubled(_part(quotient), right), k)

    if doublings.most:
        y, z, _, room = repeated(double, number, (y, z, h, room))
    h = 0.5 * tau
    total = combined([1.0, 1.0], [stack, y])
    middle = combined([h, 0.5, 0.5 * h], [stack, z, y])
    stack, quotient = minus_and_quotient([(1.0, total), (1.0, y)], h, total, middle, total)
    stack = Bordered(stack.core, stack.border, jnp.ones_like(stack.diagonal), stack.corner)
    part = _part(quotient)
    adding = Action(*part, quotient.ratio, quotient.over, feed(total), feed(middle))
    kept = Kept(p, feed(a), feed(fraction), _part(inner), _part(by_a), adding)
    return stack, kept, room


def _part(quotient: Quotient) -> Part:
    return Part(quotient.core, quotient.border)


class _Beams(NamedTuple):
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


def _own_beams(a, p, h, d) -> _Beams:
    """As on the way up."""
    square = h * h
    over_v = reciprocal(_inner_middle(p, a, d * square))
    fraction, ratio_v = _fraction(a, over_v, square / 9)
    z = _sum(p, square, fraction)
    over_u = reciprocal(z)
    ratio_u, ratio_w = _times(over_u, a, fraction)
    y = _less(h, a, h * square, a, ratio_w)
    return _Beams(ratio_v, ratio_u, ratio_w, over_v, over_u, y, z)


class _Step(NamedTuple):
    """What beams see of Y and Z between two doublings."""

    y: Float[Array, "beam *batch"]
    z: Float[Array, "beam *batch"]
    z_feed: Feed
    h: Float[Array, "*batch"]


def _next_step(step: _Step, y_feed: Feed) -> tuple[_Step, Array, Array]:
    """After a doubling; and the ratio, and 1 over the middle, of its quotient."""
    y, z, z_feed, h = step
    z_feed = combined([1.0, h], [z_feed, y_feed])
    z = _sum(z, h, y)
    over = reciprocal(z)
    (ratio,) = _times(over, y)
    return _Step(_less(2.0, y, 2 * h, y, ratio), z, z_feed, 2 * h), ratio, over


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


def descend(
    fields: Fields,
    tau: Float[Array, "*batch"],
    secants: Float[Array, "2 *batch"],
    kept: Kept,
    doublings: Doublings,
    doubled: Callable[[Any], Doubled],
) -> tuple[Fields, Bordered, Bordered]:
    """Fields below a layer from those above; cotangents of A and B^-1 over h (`mode`).

    `doubled` gives what `climb` kept of a doubling.
    """
    h = 0.5 * tau
    drop = act(kept.adding, fields)
    mean = advance(fields, drop, 0.5 * h)
    below = advance(mean, drop, 0.5 * h)  # last of `fields`, so that XLA can write over them

    number, step, d = doublings.of_layer()
    start = tau * step
    square = start * start
    own_beams, next_step = _own_beams, _next_step
    if not small_enough(fields.nodes.shape[0], tau.dtype):
        own_beams, next_step = (one_kernel(f, 1) for f in (own_beams, next_step))
    own = own_beams(secants, kept.b_inverse.diagonal, start, jnp.asarray(d, tau.dtype))
    p = feed(kept.b_inverse)
    z = combined([1.0, square], [p, kept.fraction])
    inner = combined([5.0, d * square], [p, kept.a])
    doubling = _Doublings(_Step(own.y, own.z, z, start), doubled, next_step)
    y_bar, z_bar = _undoubled(mean, drop, tau, number, doublings.most, doubling)
    return below, *undo_start(
        Action(*kept.inner, own.ratio_v, own.over_v, kept.a, inner),
        Action(*kept.by_a, own.ratio_u, own.over_u, kept.a, z),
        own.ratio_w,
        kept.fraction,
        square,
        d,
        y_bar,
        z_bar,
    )


class _Doublings(NamedTuple):
    """The quotients of a layer's doublings.

    What beams see of them is formed again from the start each time, which for the few doublings
    that there are takes less than to keep it.
    """

    start: _Step
    kept: Callable[[Any], Doubled]
    next_step: Callable[[_Step, Feed], tuple[_Step, Array, Array]]

    def some(self, first: Any, count: int) -> list[Action]:
        """So many in a row."""

        def go(k, step):
            return self.next_step(step, self.kept(k).right)[0]

        step, found = repeated(go, first, self.start), []
        for k in range(count):
            part, right = self.kept(first + k)
            step, ratio, over = self.next_step(step, right)
            found.append(Action(*part, ratio, over, right, step.z_feed))
        return found


def _undoubled(
    mean: Fields,
    drop: Fields,
    tau: Float[Array, "*batch"],
    number: Any,
    most: int | None,
    doublings: _Doublings,
) -> tuple[Bordered, Bordered]:
    """P and Q of a layer's start: the last doublings undone by fields, the others by matrices."""
    nodes = mean.nodes.shape[0]
    assert most is not None
    by_fields = min(most, _BY_FIELDS_OF_FEW if nodes <= _FEW_NODES else _BY_FIELDS)

    def last_undone(count):
        def undone(mean, drop):
            quotients = doublings.some(number - count, count)[::-1] if count else []
            heights = (tau * 0.5 ** (k + 2) for k in range(count))
            return cotangents(mean, drop, list(zip(quotients, heights, strict=True)))

        return undone

    if isinstance(number, int):
        pair = last_undone(min(number, by_fields))(mean, drop)
    else:
        choices = [last_undone(count) for count in range(by_fields + 1)]
        pair = jax.lax.switch(jnp.minimum(number, by_fields), choices, mean, drop)
    if most <= by_fields:
        return pair

    def undo(k, carry):
        y_bar, z_bar, h = carry
        (quotient,) = doublings.some(number - by_fields - 1 - k, 1)
        return *undouble(quotient, h, y_bar, z_bar), 0.5 * h

    h = tau * 0.5 ** (by_fields + 2)
    y_bar, z_bar, _ = repeated(undo, number - by_fields, (*pair, h))
    return y_bar, z_bar
