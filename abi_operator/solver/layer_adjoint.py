"""One layer on the way up, which keeps what the way down needs, and on the way down."""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._numerics import fenced, product, weighted
from .bordered import Bordered, Quotient, minus_and_quotient
from .fields import Action, Edge, Fields, act, advance, edge, pair, split
from .layer import ModeKernels, conservative, layer_matrix, start_coefficient
from .pull_back import undo_inverse, undo_start, undouble

# Doublings undone by fields: matrices are as fast with few nodes, and faster than many fields.
_BY_FIELDS, _BY_FIELDS_OF_FEW, _FEW_NODES = 2, 1, 3


class Layer(NamedTuple):
    """What one mode sees of a layer; moments of even and of odd l + m."""

    tau: Float[Array, "*batch"]
    coalbedo: Float[Array, "*batch"] | None
    sun_secant: Float[Array, "*batch"]
    even: Float[Array, "degree *batch"]
    odd: Float[Array, "degree *batch"]

    def secants(self, view: Float[Array, "*batch"]) -> Float[Array, "2 *batch"]:
        """Of both beams."""
        return jnp.stack([self.sun_secant, view])

    def matrices(
        self,
        kernels: tuple[ModeKernels, ModeKernels],
        view_secant: Float[Array, "*batch"],
        single_scattering: bool,
    ) -> tuple[Bordered, Bordered]:
        """A and the inverse of B."""
        secants = self.secants(view_secant)
        a = layer_matrix(kernels[0], self.even, secants, single_scattering)
        if self.coalbedo is not None:
            a = conservative(a, self.coalbedo)
        return a, layer_matrix(kernels[1], self.odd, secants, single_scattering).inverse()


class _Part(NamedTuple):
    """A quotient's nodes, and what nodes and corner of its right do to beams."""

    core: Float[Array, "node node *batch"]
    border: Float[Array, "node beam *batch"]


class Kept(NamedTuple):
    """What the way down needs of a layer; diagonals inside it are formed again."""

    b_inverse: Bordered
    a: Edge
    fraction: Edge
    inner: _Part
    by_a: _Part
    admittances: list[Edge]
    doublings: list[_Part]
    adding: Action


def _part(quotient: Quotient) -> _Part:
    return _Part(quotient.core, quotient.border)


def _open_edge(matrix: Bordered) -> Edge:
    return Edge(matrix.border, None, matrix.corner)


def climb(
    stack: Bordered, a: Bordered, p: Bordered, tau: Float[Array, "*batch"], num_doublings: int
) -> tuple[Bordered, Kept]:
    """Put a layer of A and p = B^-1 on a stack: `layer.half_layer` and `adding.add_layer`."""
    h = tau * (0.5 / 2**num_doublings)
    square = h * h
    inner = _combined([5.0, start_coefficient(num_doublings) * square], [p, a])
    fraction, inner = minus_and_quotient([(1 / 3, a)], square / 9, a, inner, a)
    z = _combined([1.0, square], [p, fraction])
    # A Z^-1 C from the other side, whose quotient gives that by C with one product (`_chained`).
    y, by_a = minus_and_quotient([(h, a)], h * square, fraction, z, a)
    admittances, doublings = [], []
    for _ in range(num_doublings):
        z = _combined([1.0, h], [z, y])
        admittances.append(_open_edge(y))
        y, quotient = minus_and_quotient([(2.0, y)], 2 * h, y, z, y)
        doublings.append(_part(quotient))
        h = 2 * h
    total = _combined([1.0, 1.0], [stack, y])
    middle = _combined([h, 0.5, 0.5 * h], [stack, z, y])
    stack, quotient = minus_and_quotient([(1.0, total), (1.0, y)], h, total, middle, total)
    stack = Bordered(stack.core, stack.border, jnp.ones_like(stack.diagonal), stack.corner)
    adding = Action(quotient.core, quotient.border, quotient.ratio, edge(total), edge(middle))
    kept = Kept(
        p,
        _open_edge(a),
        _open_edge(fraction),
        _part(inner),
        _part(by_a),
        admittances,
        doublings,
        adding,
    )
    return stack, kept


@fenced
def _combined(weights, matrices):
    """Weighted sum, in one kernel."""
    sums = [
        weighted(list(zip(weights, x, strict=True)))
        for x in zip(*map(jax.tree.leaves, matrices), strict=True)
    ]
    return jax.tree.unflatten(jax.tree.structure(matrices[0]), sums)


@fenced
def _chained(square, by_a, inner, ratio):
    """Z^-1 C from U = Z^-1 A and V, with C = A (1/3 - (h^2 / 9) V)."""
    ninth = square / 9
    core = by_a.core / 3 - ninth * product(by_a.core, inner.core)
    passed = product(by_a.core, inner.border) + by_a.border * ratio
    return core, by_a.border / 3 - ninth * passed


class _Diagonals(NamedTuple):
    a: Array
    fraction: Array
    inner: Array
    z: list[Array]
    admittances: list[Array]


def _diagonals(secants, h, num_doublings: int) -> _Diagonals:
    """Beams' own entries of a layer's matrices, as on the way up."""
    a, p, square = secants, 1 / secants, h * h
    inner = 5.0 * p + start_coefficient(num_doublings) * square * a
    fraction = a / 3 - square / 9 * (a * (a / inner))
    zs, ys = [p + square * fraction], []
    y = h * a - h * square * (a * (fraction / zs[0]))
    for _ in range(num_doublings):
        ys.append(y)
        zs.append(zs[-1] + h * y)
        y = 2.0 * y - 2 * h * (y * (y / zs[-1]))
        h = 2 * h
    return _Diagonals(a, fraction, inner, zs, ys)


def _quotient(part: _Part, right: Edge, middle: Edge) -> Action:
    return Action(*part, _ratio(right.diagonal, middle.diagonal), right, middle)


@fenced
def _ratio(right, middle):
    return right / middle


def descend(
    fields: Fields,
    tau: Float[Array, "*batch"],
    secants: Float[Array, "2 *batch"],
    kept: Kept,
    num_doublings: int,
) -> tuple[Fields, Bordered, Bordered]:
    """Fields below a layer from those above; cotangents of A and B over h (`mode_slopes`)."""
    h = 0.5 * tau
    drop = act(kept.adding, fields)
    mean, below = advance(fields, drop, 0.5 * h), advance(fields, drop, h)

    start = tau * (0.5 / 2**num_doublings)
    square = start * start
    own = fenced(partial(_diagonals, num_doublings=num_doublings))(secants, start)
    p = kept.b_inverse.border, kept.b_inverse.corner
    a, fraction = kept.a._replace(diagonal=own.a), kept.fraction._replace(diagonal=own.fraction)
    admittances = [
        y._replace(diagonal=d) for y, d in zip(kept.admittances, own.admittances, strict=True)
    ]
    without = [_combined([1.0, square], [p, (fraction.border, fraction.corner)])]
    for k, y in enumerate(admittances):
        without.append(_combined([1.0, start * 2.0**k], [without[-1], (y.border, y.corner)]))
    z = [Edge(x, d, c) for (x, c), d in zip(without, own.z, strict=True)]
    border, corner = _combined(
        [5.0, start_coefficient(num_doublings) * square], [p, (a.border, a.corner)]
    )
    inner = Edge(border, own.inner, corner)
    quotients = [
        _quotient(r, y, s) for r, y, s in zip(kept.doublings, admittances, z[1:], strict=True)
    ]

    nodes = fields.nodes.shape[0]
    by_fields = min(num_doublings, _BY_FIELDS_OF_FEW if nodes <= _FEW_NODES else _BY_FIELDS)
    for k in reversed(range(num_doublings - by_fields, num_doublings)):
        mean, drop = split(mean, drop, act(quotients[k], mean), start * 2.0**k)
    y_bar, z_bar = pair(2.0, mean), pair(0.5, drop)
    for k in reversed(range(num_doublings - by_fields)):
        y_bar, z_bar = undouble(quotients[k], start * 2.0**k, y_bar, z_bar)
    by_inner = _quotient(kept.inner, a, inner)
    by_a = _quotient(kept.by_a, a, z[0])
    by_fraction = _Part(*_chained(square, kept.by_a, kept.inner, by_inner.ratio))
    a_bar, p_bar = undo_start(
        by_inner,
        by_a,
        _quotient(by_fraction, fraction, z[0]),
        square,
        start_coefficient(num_doublings),
        y_bar,
        z_bar,
    )
    return below, a_bar, undo_inverse(kept.b_inverse, p_bar)
