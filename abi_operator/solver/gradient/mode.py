r"""One mode's reflection and its slopes: one pass up the layers, one down.

At the top :math:`F_i = (1+Y)^{-1} e_i` for sun and view, and the reflection's derivative is
-pair(F)/2 in Y. Going down through a layer of half thickness h, with the quotient of its adding
step (`adding`) :math:`N = S^{-1}(Y + Y_e)F`,

.. math:: \sigma = F - hN/2, \qquad F' = F - hN,

the cotangent of Y_e is P = 2 pair(sigma), that of Z is hQ with Q = pair(N)/2, and F' are the fields
below. A doubling with quotient R is undone by

.. math::
   Q \leftarrow 2Q + 2(R\otimes R)P, \qquad P \leftarrow 2P - 2h(R\oplus R)P + h^2Q,

or, as long as fields are fewer than nodes, by those of its halves,
:math:`\sigma - hR\sigma \pm hN/2` and :math:`N \pm 2R\sigma` (`fields.cotangents`). At the start
(`method.layer.half_layer`), with :math:`U = Z^{-1}A`, :math:`W = Z^{-1}C`,
:math:`V = (5B^{-1} + dh^2A)^{-1}A` and :math:`M = (U\otimes W + W\otimes U)P/2`,

.. math::
   \bar Z &= Q - (U\oplus U)P/2 + h^2M, \\
   \bar A &= P - h^2(W\oplus W)P/2
       + h^2[1/3 - \tfrac{h^2}{9}(V\oplus V) + \tfrac{dh^4}{9}V\otimes V]\bar Z, \\
   \bar B &= -(B^{-1}\otimes B^{-1})[Q + h^2M + \tfrac{5h^4}{9}(V\otimes V)\bar Z],

all over h; the last is never formed (`pull_back.undo_inverse`). A layer depends on hA and hB alone,
so that its derivative in h is :math:`\langle\bar A, A\rangle + \langle\bar B, B\rangle`.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.algebra import fenced, matmul, total
from ...machine.kernels import one_kernel
from ...machine.rows import are_few
from ..method.adding import top
from ..method.around import Above
from ..method.bordered import Bordered, Vector, combined
from ..method.doublings import Doublings
from ..method.layer import ModeKernels
from ..method.mode_layers import Layer, Layers, Order, added_to, read
from ..skipping.plan import Plan, over_layers
from .fields import Fields, pair
from .interface import slopes_at_face
from .isotropic import absorption
from .layer import climb, descend
from .pull_back import MatrixSlopes, undo_inverse, undo_matrix
from .room import Keeper, Room

Kernels = tuple[ModeKernels, ModeKernels]


class Slopes(NamedTuple):
    """Of one mode, in what its beams are made of and in its ground, and the sum of the squares of
    its own in the layers' moments; of it and those before it, in what all share.
    """

    shared: "Shared"
    even_beams: Float[Array, "2 degree *batch"]
    odd_beams: Float[Array, "2 degree *batch"]
    ground: Bordered
    square: Float[Array, "*batch"]


class Shared(NamedTuple):
    """What all modes depend on, or slopes in it; and slopes at the faces of layers, from the top
    down, where layers are groups of others (`interface`), else None.
    """

    layers: Layers
    view_secant: Float[Array, "*batch"]
    faces: Float[Array, "level row *batch"] | None


class _Given(NamedTuple):
    """What kernels read of a mode."""

    layers: Layers
    plan: Plan
    order: Order
    kernels: Kernels
    view_secant: Float[Array, "*batch"]

    def layer(self, number: Array) -> tuple[Layer, Doublings]:
        """A layer, and its doublings."""
        own = jax.tree.map(lambda x: read(x, number), self.plan.doublings)
        return self.layers.layer(number, self.order.odd), own

    def place(self, number: Array | None) -> Array:
        """Number of a layer, of the only one too."""
        return jnp.zeros_like(self.layers.tau.reshape(-1)[0]) if number is None else number

    def compiled(self, function: Callable[..., Any], **how: bool) -> Callable[..., Any]:
        """`function` as one kernel.

        A layer that is the only one fills the room: in the kernel XLA finds no use for its number,
        nor for what was in the room (see `one_kernel`).
        """
        num_layers, num_nodes = self.layers.tau.shape[0], self.layers.moments.shape[1]
        return function if num_layers == 1 else one_kernel(function, num_nodes, **how)


def mode_slopes(
    shared: Shared,
    plan: Plan,
    single_scattering: bool,
    order: Order,
    kernels: Kernels,
    below: tuple[Bordered, Vector | None],
    weight: Float[Array, "*batch"],
    slopes: Shared,
    room: Room,
    above: Above | None = None,
) -> tuple[Float[Array, "*batch"], Room, Slopes]:
    """Reflection of a mode, and the slopes of `weight` times it, added to those of other modes.

    `below` the layers lies the ground, with what it absorbs of isotropic light where that is kept
    (`method.absorption`). There are no slopes in what lies `above` them.

    The room (`room.Keeper.empty`) is given back filled. Layers are read and written inside the
    kernels: as inputs and outputs of a scan every array would be one more kernel a layer.
    """
    layers, view_secant, _ = shared
    faces, most = slopes.faces, plan.doublings.most
    assert most is not None
    keeper = Keeper(layers.tau, layers.moments.shape[1], most, faces is not None)
    given = _Given(layers, plan, order, kernels, view_secant)
    stack, room = _up(below, room, given, keeper, single_scattering)
    closed = stack, weight, *(() if above is None else (above,))
    reflection, fields = given.compiled(_fields_at_the_top, in_parts=True)(*closed)
    beams = (jnp.zeros_like(x.beams) for x in kernels)
    start = *beams, slopes.view_secant, jnp.zeros_like(view_secant)
    carry = fields, start, slopes.layers, faces
    carry = _down(carry, room, given, keeper, single_scattering)
    fields, (even, odd, view, square), layers, faces = carry
    if faces is not None:
        at_ground = fields._replace(other=jnp.zeros_like(fields.other))
        last = slopes_at_face(at_ground, below[0], kernels, view_secant, single_scattering, order)
        faces = added_to(faces, plan.num_groups, last)
    shared = Shared(layers, view, faces)
    return reflection, room, Slopes(shared, even, odd, pair(1.0, [fields]), square)


def _up(
    below: tuple[Bordered, Vector | None],
    room: Room,
    given: _Given,
    keeper: Keeper,
    single_scattering: bool,
) -> tuple[Bordered, Room]:
    """All layers put on the ground; the room filled with what the way down needs of them."""

    def put_on_and_keep(below, room, given, number):
        (stack, ones), (layer, own) = below, given.layer(number)
        secants = given.view_secant[None]
        a, p = layer.matrices(given.order.mean, given.kernels, secants, single_scattering)
        keep = lambda room, new, k: keeper.with_doubling(room, new, number, k)  # noqa: E731
        kept = absorption(ones, layer, given.view_secant, given.order, given.kernels[0])
        stack, (_, ones), new, room = climb(stack, None, kept, a, p, layer.tau, own, room, keep)
        room = keeper.with_layer(room, new, number)
        return (stack, ones), keeper.with_stack(room, stack, number) if keeper.stacks else room

    put_one = given.compiled(put_on_and_keep, in_parts=True)

    def all_layers(below, room, given):
        step = lambda carry, number: put_one(*carry, given, given.place(number))  # noqa: E731
        return over_layers(step, (below, room), given.plan, upwards=True)

    (stack, _), room = given.compiled(all_layers, in_parts=True)(below, room, given)
    return stack, room


def _down(carry: Any, room: Room, given: _Given, keeper: Keeper, single_scattering: bool) -> Any:
    """Fields, and slopes of beams, layers and faces, from the top to the ground."""

    def undo(carry, room, given, number):
        fields, totals, slopes, faces = carry
        kernels, order, view_secant = given.kernels, given.order, given.view_secant
        layer, own = given.layer(number)
        kept, secants = keeper.layer(room, number), layer.secants(view_secant[None])
        # The beams' own entries of the stack are 1 whatever happens in it.
        fields = fields._replace(other=jnp.zeros_like(fields.other))
        if faces is not None:
            stack = keeper.stack(room, number)
            at_face = slopes_at_face(fields, stack, kernels, view_secant, single_scattering, order)
            faces = added_to(faces, number, at_face)
        fields, a_bar, p_bar = descend(
            fields, layer.tau, secants, kept, own, partial(keeper.doubling, room, number)
        )
        a, coalbedo = undo_matrix(
            kernels[0], layer.even, secants, a_bar, single_scattering, layer.coalbedo, order.mean
        )
        b = undo_inverse(kernels[1], layer.odd, kept.b_inverse, p_bar, single_scattering)
        _, step, _ = own.of_layer()
        totals, new = _collected(step, layer.tau, totals, a, b, coalbedo)
        return fields, totals, slopes.plus(number, order.odd, new), faces

    undo_one = given.compiled(undo, in_parts=True)

    def all_layers(carry, room, given):
        step = lambda carry, number: undo_one(carry, room, given, given.place(number))  # noqa: E731
        return over_layers(step, carry, given.plan)

    return given.compiled(all_layers, in_parts=True)(carry, room, given)


def _fields_at_the_top(stack: Bordered, weight, above: Above | None = None):
    """Reflection, and fields whose pair is the cotangent of `weight` times it."""
    scale = jnp.stack([jnp.ones_like(weight), -0.5 * weight])
    if above is not None:
        seen, nodes = above.over(stack)
        return seen[0], Fields(scale * nodes, scale * above.own, jnp.zeros_like(scale))
    solved = matmul(top(stack).inverse, stack.border)
    reflection = 0.5 * (jnp.sum(stack.border[:, 1] * solved[:, 0], axis=0) - stack.corner[0])
    return reflection, Fields(-scale * solved, scale, jnp.zeros_like(scale))


def _collected(step, tau, totals, a: MatrixSlopes, b: MatrixSlopes, coalbedo):
    """Totals over the layers, and the layer's own slopes, from those over h."""
    beams = None
    if are_few(tau):
        beams = combined([1.0, tau * step], [totals[:2], (a.beams, b.beams)])
    return _collected_rest(step, tau, beams, totals, a, b, coalbedo)


@fenced
def _collected_rest(step, tau, beams, totals, a: MatrixSlopes, b: MatrixSlopes, coalbedo):
    h = tau * step
    if beams is None:
        beams = totals[0] + h * a.beams, totals[1] + h * b.beams
    secants = h * (a.secants + b.secants)
    slopes = Layer(step * (a.h + b.h), h * coalbedo, secants[0], h * a.moments, h * b.moments)
    square = totals[3] + total(slopes.even**2) + total(slopes.odd**2)
    return (*beams, totals[2] + secants[1], square), slopes
