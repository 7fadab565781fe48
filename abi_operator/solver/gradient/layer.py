"""One layer on the way up, which keeps what the way down needs, and on the way down."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.kernels import one_kernel, small_enough
from ..method.bordered import Bordered, Vector, combined
from ..method.doublings import Doublings, repeated
from ..method.quotient import Quotient, minus_and_quotient
from . import isotropic
from .beams import Step, next_step, own_beams
from .fields import Action, Feed, Fields, Heat, act, advance, cotangents, feed
from .isotropic import Absorption
from .stages import undo_start, undouble
from .thermal import (
    Warmth,
    doubled_lag,
    heat,
    less_response,
    load,
    respond,
    slope_of_jump,
    start_of_lag,
)

# Doublings undone by fields, and with so few nodes; the rest by matrices. Measured.
_BY_FIELDS, _BY_FIELDS_OF_FEW, _FEW_NODES = 2, 1, 2


class Part(NamedTuple):
    """A quotient's core and border: in blocks of rows on the way up, as arrays on the way down."""

    core: Any
    border: Any


class Kept(NamedTuple):
    """What the way down needs of a layer but for its doublings; diagonals are formed again.

    `response` is u of `thermal`, None where there is no thermal light.
    """

    b_inverse: Bordered
    a: Feed
    fraction: Feed
    inner: Part
    by_a: Part
    adding: Action
    response: Vector | None = None


class Doubled(NamedTuple):
    """What the way down needs of a doubling, of Y before it; the rest is formed again."""

    quotient: Part
    right: Feed


def climb(
    stack: Bordered,
    warmth: Warmth | None,
    absorption: Absorption | None,
    a: Bordered,
    p: Bordered,
    tau: Float[Array, "*batch"],
    doublings: Doublings,
    room: Any,
    keep: Callable[[Any, Doubled, Any], Any],
) -> tuple[Bordered, tuple[Vector | None, Vector | None], Kept, Any]:
    """Put a layer of A and p = B^-1 on a stack: `method.layer.half_layer` and `adding.add_layer`.

    `keep` gives a room with a doubling in it, the number of which it is told. Beside the stack
    stand e of its thermal light (`thermal`), and what it absorbs of isotropic light, where that is
    kept (`method.absorption`).
    """
    number, step, start = doublings.of_layer()
    h = tau * step
    square = h * h
    inner = combined([5.0, start * square], [p, a])
    fraction, inner = minus_and_quotient([(1 / 3, a)], square / 9, a, inner, a)
    z = combined([1.0, square], [p, fraction])
    # A Z^-1 C from the other side, whose quotient gives that by C by another (`undo_start`).
    of_ones = () if absorption is None else (absorption.layer.nodes[:, None],)
    y, by_a = minus_and_quotient([(h, a)], h * square, fraction, z, a, of_ones)
    y, half = isotropic.started(absorption, y, h, p, fraction, z, by_a)
    lag = None if warmth is None else start_of_lag(h, fraction)

    def double(k, carry):
        y, z, lag, half, h, room = carry
        z = combined([1.0, h], [z, y])
        lag = None if lag is None else doubled_lag(lag, y)
        right = feed(y)
        y, quotient = minus_and_quotient([(2.0, y)], 2 * h, y, z, y)
        y, half, quotient = isotropic.doubled(absorption, y, half, quotient, h)
        return y, z, lag, half, 2 * h, keep(room, Doubled(_part(quotient), right), k)

    if doublings.most:
        y, z, lag, half, _, room = repeated(double, number, (y, z, lag, half, h, room))
    h = 0.5 * tau
    total = combined([1.0, 1.0], [stack, y])
    middle = combined([h, 0.5, 0.5 * h], [stack, z, y])
    loaded = None if warmth is None or lag is None else load(warmth, total, y, lag)
    loads = () if loaded is None else (loaded.v.nodes[:, None],)
    base = [(1.0, total), (1.0, y)]
    stack, quotient = minus_and_quotient(base, h, total, middle, total, loads)
    stack = Bordered(stack.core, stack.border, jnp.ones_like(stack.diagonal), stack.corner)
    stack, ones, quotient = isotropic.stacked(absorption, stack, half, quotient, h)
    column, response = None, None
    if loaded is not None:
        column, response = respond(loaded, total, middle, h, quotient)
    part = _part(quotient)
    adding = Action(*part, quotient.ratio, quotient.over, feed(total), feed(middle))
    kept = Kept(p, feed(a), feed(fraction), _part(inner), _part(by_a), adding, response)
    return stack, (column, ones), kept, room


def _part(quotient: Quotient) -> Part:
    return Part(quotient.core, quotient.border)


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
    below, a_bar, p_bar, _ = descend_warm(fields, None, tau, secants, kept, doublings, doubled)
    return below, a_bar, p_bar


def descend_warm(
    fields: Fields,
    jump: Float[Array, "*batch"] | None,
    tau: Float[Array, "*batch"],
    secants: Float[Array, "2 *batch"],
    kept: Kept,
    doublings: Doublings,
    doubled: Callable[[Any], Doubled],
) -> tuple[Fields, Bordered, Bordered, Float[Array, "*batch"] | None]:
    """`descend` with thermal light (`thermal`), and the slope in its jump."""
    h = 0.5 * tau
    drop = act(kept.adding, fields)
    warm, of_jump = None, None
    if jump is not None:
        drop = less_response(drop, kept.response)
        warm, of_jump = heat(jump, drop), slope_of_jump(drop, kept.b_inverse)
    mean = advance(fields, drop, 0.5 * h, warm and warm.jump)
    # The last use of `fields`, so that XLA can write over them.
    below = advance(mean, drop, 0.5 * h, warm and warm.jump)

    number, step, d = doublings.of_layer()
    start = tau * step
    square = start * start
    of_start, of_doubling = own_beams, next_step
    if not small_enough(fields.nodes.shape[0], tau.dtype, in_parts=True):
        of_start, of_doubling = (one_kernel(f, 1) for f in (own_beams, next_step))
    own = of_start(secants, kept.b_inverse.diagonal, start, jnp.asarray(d, tau.dtype))
    p = feed(kept.b_inverse)
    z = combined([1.0, square], [p, kept.fraction])
    inner = combined([5.0, d * square], [p, kept.a])
    doubling = _Doublings(Step(own.y, own.z, z, start), doubled, of_doubling)
    y_bar, z_bar = _undoubled(mean, drop, warm, tau, number, doublings.most, doubling)
    a_bar, p_bar = undo_start(
        Action(*kept.inner, own.ratio_v, own.over_v, kept.a, inner),
        Action(*kept.by_a, own.ratio_u, own.over_u, kept.a, z),
        own.ratio_w,
        kept.fraction,
        start,
        d,
        y_bar,
        z_bar,
        warm and warm.bar,
    )
    return below, a_bar, p_bar, of_jump


class _Doublings(NamedTuple):
    """The quotients of a layer's doublings.

    What beams see of them is formed again from the start each time, which for the few doublings
    that there are takes less than to keep it.
    """

    start: Step
    kept: Callable[[Any], Doubled]
    next_step: Callable[[Step, Feed], tuple[Step, Array, Array]]

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
    warm: Heat | None,
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
        def undone(mean, drop, warm):
            quotients = doublings.some(number - count, count)[::-1] if count else []
            heights = (tau * 0.5 ** (k + 2) for k in range(count))
            return cotangents(mean, drop, list(zip(quotients, heights, strict=True)), warm)

        return undone

    if isinstance(number, int):
        pair = last_undone(min(number, by_fields))(mean, drop, warm)
    else:
        choices = [last_undone(count) for count in range(by_fields + 1)]
        pair = jax.lax.switch(jnp.minimum(number, by_fields), choices, mean, drop, warm)
    if most <= by_fields:
        return pair

    def undo(k, carry):
        y_bar, z_bar, h = carry
        (quotient,) = doublings.some(number - by_fields - 1 - k, 1)
        return *undouble(quotient, h, y_bar, z_bar, warm and warm.bar), 0.5 * h

    h = tau * 0.5 ** (by_fields + 2)
    y_bar, z_bar, _ = repeated(undo, number - by_fields, (*pair, h))
    return y_bar, z_bar
