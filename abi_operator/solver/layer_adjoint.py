"""One layer on the way up, which keeps what the way down needs, and on the way down."""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._kernels import one_kernel, small_enough
from .._numerics import fenced
from .bordered import Bordered, combined, reciprocal
from .fields import Action, Feed, Fields, act, advance, cotangents, feed
from .layer import ModeKernels, conservative, layer_matrix, start_coefficient
from .pull_back import undo_start, undouble
from .quotient import Quotient, minus_and_quotient

# Doublings undone by fields, and with so few nodes; the rest by matrices. Measured.
_BY_FIELDS, _BY_FIELDS_OF_FEW, _FEW_NODES = 2, 1, 2


class Order(NamedTuple):
    """What tells one mode's layers from another's: 1 or 0, and not integers, which have no tangents
    in a kernel.

    Parameters
    ----------
    odd
        Whether the order is odd.
    mean
        Whether this is the azimuthal mean, the only mode in which energy is kept.
    """

    odd: Float[Array, "*mode"]
    mean: Float[Array, "*mode"]


class Layer(NamedTuple):
    """What one mode sees of a layer; moments of even and of odd l + m."""

    tau: Float[Array, "*batch"]
    coalbedo: Float[Array, "*batch"]
    sun_secant: Float[Array, "*batch"]
    even: Float[Array, "degree *batch"]
    odd: Float[Array, "degree *batch"]

    def secants(self, view: Float[Array, "*batch"]) -> Float[Array, "2 *batch"]:
        """Of both beams."""
        return jnp.stack([self.sun_secant, view])

    def matrices(
        self,
        mean: Float[Array, ""] | bool,
        kernels: tuple[ModeKernels, ModeKernels],
        view_secant: Float[Array, "*batch"],
        single_scattering: bool,
    ) -> tuple[Bordered, Bordered]:
        """A and the inverse of B; whether the mode is the mean may be known or a number."""
        secants = self.secants(view_secant)
        a = layer_matrix(kernels[0], self.even, secants, single_scattering)
        if isinstance(mean, bool):
            a = conservative(a, self.coalbedo) if mean else a
        else:
            a = jax.lax.cond(mean > 0, conservative, lambda a, _: a, a, self.coalbedo)
        return a, layer_matrix(kernels[1], self.odd, secants, single_scattering).inverse()


class Layers(NamedTuple):
    """All layers, top first, as every mode sees them.

    Moments of even degrees come first, then those of odd ones: a mode of odd m has them the other
    way round, and finds them by their place.
    """

    tau: Float[Array, "layer *batch"]
    coalbedo: Float[Array, "layer *batch"]
    sun_secant: Float[Array, "layer *batch"]
    moments: Float[Array, "parity_and_layer degree *batch"]

    def layer(self, number: Array, odd: Array) -> Layer:
        """One of them; neither argument is an integer (see `Order`)."""
        even_place, odd_place = self._places(number, odd)
        return Layer(
            read(self.tau, number),
            read(self.coalbedo, number),
            read(self.sun_secant, number),
            read(self.moments, even_place),
            read(self.moments, odd_place),
        )

    def plus(self, number: Array, odd: Array, new: Layer) -> "Layers":
        """The same with `new` added to one of them."""
        moments = self.moments
        for place, added in zip(self._places(number, odd), (new.even, new.odd), strict=True):
            moments = _add(moments, place, added)
        return Layers(
            _add(self.tau, number, new.tau),
            _add(self.coalbedo, number, new.coalbedo),
            _add(self.sun_secant, number, new.sun_secant),
            moments,
        )

    def _places(self, number, odd):
        count = self.tau.shape[0]
        return number + count * odd, number + count * (1 - odd)


def read(stack: Float[Array, "layer *own"], place: Array) -> Float[Array, "*own"]:
    """One entry of an array."""
    # Not `jax.lax.dynamic_index_in_dim`, which as a `jax.jit` would be a kernel and a copy: what
    # is read is part of the kernel that uses it, what `_add` writes must be a kernel.
    start = place.astype(jnp.int32), *(jnp.int32(0) for _ in stack.shape[1:])
    return jax.lax.dynamic_slice(stack, start, (1, *stack.shape[1:]))[0]


def _add(stack, place, new):
    new = read(stack, place) + new
    return jax.lax.dynamic_update_index_in_dim(stack, new, place.astype(jnp.int32), 0)


class _Part(NamedTuple):
    """A quotient's core and border: in blocks of rows on the way up, as arrays on the way down."""

    core: Any
    border: Any


class Kept(NamedTuple):
    """What the way down needs of a layer; diagonals inside it are formed again."""

    b_inverse: Bordered
    a: Feed
    fraction: Feed
    inner: _Part
    by_a: _Part
    admittances: list[Feed]
    doublings: list[_Part]
    adding: Action


def _part(quotient: Quotient) -> _Part:
    return _Part(quotient.core, quotient.border)


def climb(
    stack: Bordered, a: Bordered, p: Bordered, tau: Float[Array, "*batch"], num_doublings: int
) -> tuple[Bordered, Kept]:
    """Put a layer of A and p = B^-1 on a stack: `layer.half_layer` and `adding.add_layer`."""
    h = tau * (0.5 / 2**num_doublings)
    square = h * h
    inner = combined([5.0, start_coefficient(num_doublings) * square], [p, a])
    fraction, inner = minus_and_quotient([(1 / 3, a)], square / 9, a, inner, a)
    z = combined([1.0, square], [p, fraction])
    # A Z^-1 C from the other side, whose quotient gives that by C by another (`undo_start`).
    y, by_a = minus_and_quotient([(h, a)], h * square, fraction, z, a)
    admittances, doublings = [], []
    for _ in range(num_doublings):
        z = combined([1.0, h], [z, y])
        admittances.append(feed(y))
        y, quotient = minus_and_quotient([(2.0, y)], 2 * h, y, z, y)
        doublings.append(_part(quotient))
        h = 2 * h
    total = combined([1.0, 1.0], [stack, y])
    middle = combined([h, 0.5, 0.5 * h], [stack, z, y])
    stack, quotient = minus_and_quotient([(1.0, total), (1.0, y)], h, total, middle, total)
    stack = Bordered(stack.core, stack.border, jnp.ones_like(stack.diagonal), stack.corner)
    part = _part(quotient)
    adding = Action(
        part.core, part.border, quotient.ratio, quotient.over, feed(total), feed(middle)
    )
    kept = Kept(
        p,
        feed(a),
        feed(fraction),
        _part(inner),
        _part(by_a),
        admittances,
        doublings,
        adding,
    )
    return stack, kept


class _Beams(NamedTuple):
    """Beams' own entries of a layer's quotients: of right over middle, and 1 over the middle.

    Of V, U and W of the start, then of each doubling.
    """

    ratios: list[Float[Array, "beam *batch"]]
    overs: list[Float[Array, "beam *batch"]]


def _own_beams(a, p, h, num_doublings: int) -> _Beams:
    """As on the way up; the doublings are those of numbers."""
    square = h * h
    over = reciprocal(_inner_middle(p, a, start_coefficient(num_doublings) * square))
    fraction, ratio = _fraction(a, over, square / 9)
    z = _sum(p, square, fraction)
    overs = [over, reciprocal(z)]
    ratios = [ratio, *_times(overs[1], a, fraction)]
    y = _less(h, a, h * square, a, ratios[2])
    for k in range(num_doublings):
        step = h * 2.0**k
        z = _sum(z, step, y)
        overs.append(reciprocal(z))
        ratios += _times(overs[-1], y)
        y = _less(2.0, y, 2 * step, y, ratios[-1])
    return _Beams(ratios, [over, overs[1], *overs[1:]])


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
    num_doublings: int,
) -> tuple[Fields, Bordered, Bordered]:
    """Fields below a layer from those above; cotangents of A and B^-1 over h (`mode_slopes`)."""
    h = 0.5 * tau
    drop = act(kept.adding, fields)
    mean = advance(fields, drop, 0.5 * h)
    below = advance(mean, drop, 0.5 * h)  # last of `fields`, so that XLA can write over them

    start = tau * (0.5 / 2**num_doublings)
    square = start * start
    own_beams = partial(_own_beams, num_doublings=num_doublings)
    if not small_enough(fields.nodes.shape[0], tau.dtype):
        own_beams = one_kernel(own_beams, 1)
    own = own_beams(secants, kept.b_inverse.diagonal, start)
    p = feed(kept.b_inverse)
    z = [combined([1.0, square], [p, kept.fraction])]
    for k, y in enumerate(kept.admittances):
        z.append(combined([1.0, start * 2.0**k], [z[-1], y]))
    inner = combined([5.0, start_coefficient(num_doublings) * square], [p, kept.a])
    quotients = [
        Action(part.core, part.border, ratio, over, y, middle)
        for part, ratio, over, y, middle in zip(
            kept.doublings, own.ratios[3:], own.overs[3:], kept.admittances, z[1:], strict=True
        )
    ]

    nodes = fields.nodes.shape[0]
    by_fields = min(num_doublings, _BY_FIELDS_OF_FEW if nodes <= _FEW_NODES else _BY_FIELDS)
    left = num_doublings - by_fields
    steps = [(quotients[k], start * 2.0**k) for k in reversed(range(left, num_doublings))]
    y_bar, z_bar = cotangents(mean, drop, steps)
    for k in reversed(range(left)):
        y_bar, z_bar = undouble(quotients[k], start * 2.0**k, y_bar, z_bar)
    return below, *undo_start(
        Action(*kept.inner, own.ratios[0], own.overs[0], kept.a, inner),
        Action(*kept.by_a, own.ratios[1], own.overs[1], kept.a, z[0]),
        own.ratios[2],
        kept.fraction,
        square,
        start_coefficient(num_doublings),
        y_bar,
        z_bar,
    )
