r"""One mode's slopes where there may be thermal light: one pass up the layers, one down.

As `mode`, where the doublings and the start are derived, with what `thermal` adds. What is
differentiated is settled at the top (`AtTheTop`): fields whose pair is the cotangent of Y there.
For the radiance towards the view, with the weight c of the mode's reflection,

.. math::
   L = c\,\tfrac12(b_v^T(1+Y)^{-1}b_s - x) + \tfrac12(e_v - b_v^T s), \qquad
   s = (1+Y)^{-1}(2(I - B)1 + e),

b and x being border and corner of Y: the source's field is s less c (1+Y)^{-1} b_s, and c at the
sun itself; the view's is (1+Y)^{-1} b_v / 2, and -1/2 at the view itself. It does not know c, so
that -1 times it is the slope in e at every level.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.algebra import fenced, matmul, total
from ...machine.kernels import one_kernel
from ..method.adding import top
from ..method.bordered import Bordered, Vector
from ..method.doublings import Doublings
from ..method.mode_layers import Layer, Layers, Order, added_to, read
from .fields import Fields, pair
from .isotropic import absorption
from .layer import climb, descend_warm
from .mode import Kernels
from .pull_back import MatrixSlopes, undo_inverse, undo_matrix
from .room import Keeper, Room
from .thermal import Warmth, isotropic_nodes


class Heating(NamedTuple):
    """Thermal light of a column, or slopes in it.

    Parameters
    ----------
    jumps
        Increase of the Planck function from top to bottom of each layer. [radiance unit]
    ground
        e of the ground (`method.adding.emitting_ground`), at the nodes and at the view.
    above
        2(I - B): twice what falls on the top from all directions less the Planck function there.
    """

    jumps: Float[Array, "layer *batch"]
    ground: Vector
    above: Float[Array, "*batch"]


class Air(NamedTuple):
    """What all modes see of the layers, or slopes in it.

    The view's secants are each layer's own, like the sun's, since a view may stand where the sun
    does (`fluxes`).
    """

    layers: Layers
    view_secants: Float[Array, "layer *batch"]


class Slopes(NamedTuple):
    """Of one mode, in what its beams are made of, in its ground and in e there, and the sum of the
    squares of its own in the layers' moments; of it and those before it, in the air. None in place
    of slopes in thermal light where there is none.
    """

    air: Air
    beams: tuple[Float[Array, "2 degree *batch"], Float[Array, "2 degree *batch"]]
    ground: Bordered
    column: Vector
    jumps: Float[Array, "layer *batch"] | None
    square: Float[Array, "*batch"]


AtTheTop = Callable[[Bordered, Any], tuple[Any, Fields]]
"""Answers, and fields whose pair is the cotangent of Y, from the stack and its e."""


def slopes_of_mode(
    air: Air,
    jumps: Float[Array, "layer *batch"] | None,
    doublings: Doublings,
    single_scattering: bool,
    order: Order,
    kernels: Kernels,
    below: tuple[Bordered, Vector | None],
    column: Vector | None,
    at_the_top: AtTheTop,
    slopes: Air,
    room: Room,
) -> tuple[Any, Fields, Room, Slopes]:
    """Answers of a mode, the fields at the top, and slopes, added to those in the air.

    The room (`room.Keeper.empty`) is given back filled. Without thermal light `jumps` and `column`
    are None. What is `below`, and how layers are read and written inside the kernels: see `mode`.
    """
    num_layers, num_nodes = air.layers.tau.shape[0], air.layers.moments.shape[1]
    numbers = jnp.arange(num_layers, dtype=air.layers.tau.dtype)
    assert doublings.most is not None
    keeper = Keeper(air.layers.tau, num_nodes, doublings.most, warm=column is not None)

    def compiled(function: Callable[..., Any], **how: bool) -> Callable[..., Any]:
        # As in `mode`, where it says why.
        return function if num_layers == 1 else one_kernel(function, num_nodes, **how)

    def put_on_and_keep(below, air, jumps, doublings, number, order, kernels):
        stack, (column, ones), room = below
        layer, view_secant, own = _read(air, doublings, number, order)
        a, p = layer.matrices(order.mean, kernels, view_secant[None], single_scattering)
        keep = lambda room, new, k: keeper.with_doubling(room, new, number, k)  # noqa: E731
        warmth = None if column is None else Warmth(column, read(jumps, number))
        kept = absorption(ones, layer, view_secant, order, kernels[0])
        stack, light, new, room = climb(stack, warmth, kept, a, p, layer.tau, own, room, keep)
        return stack, light, keeper.with_layer(room, new, number)

    put_one = compiled(put_on_and_keep, in_parts=True)

    def up(below, number):
        return put_one(below, air, jumps, doublings, number, order, kernels), None

    ground, absorbed = below
    at_ground = ground, (column, absorbed), room
    (stack, (column, _), room), _ = jax.lax.scan(up, at_ground, numbers, reverse=True)
    answers, fields = at_the_top(stack, column)

    @partial(compiled, in_parts=True)
    def undo_one(above, air, jumps, doublings, room, number, order, kernels):
        fields, totals, slopes, of_jumps = above
        layer, view_secant, own = _read(air, doublings, number, order)
        kept, secants = keeper.layer(room, number), jnp.stack([layer.sun_secant, view_secant])
        jump = None if jumps is None else read(jumps, number)
        # The beams' own entries of the stack are 1 whatever happens in it.
        fields = fields._replace(other=jnp.zeros_like(fields.other))
        doubled = partial(keeper.doubling, room, number)
        fields, a_bar, p_bar, of_jump = descend_warm(
            fields, jump, layer.tau, secants, kept, own, doubled
        )
        a, coalbedo = undo_matrix(
            kernels[0], layer.even, secants, a_bar, single_scattering, layer.coalbedo, order.mean
        )
        b = undo_inverse(kernels[1], layer.odd, kept.b_inverse, p_bar, single_scattering)
        totals, new, of_view = _collected(own.of_layer()[1], layer.tau, totals, a, b, coalbedo)
        views = added_to(slopes.view_secants, number, of_view)
        slopes = Air(slopes.layers.plus(number, order.odd, new), views)
        if of_jump is not None:
            of_jumps = added_to(of_jumps, number, of_jump)
        return fields, totals, slopes, of_jumps

    def down(above, number):
        return undo_one(above, air, jumps, doublings, room, number, order, kernels), None

    beams = jnp.zeros_like(kernels[0].beams), jnp.zeros_like(kernels[1].beams)
    nothing = *beams, jnp.zeros_like(air.layers.tau[0])
    above = fields, nothing, slopes, jax.tree.map(jnp.zeros_like, jumps)
    (at_bottom, (*beams, square), slopes, of_jumps), _ = jax.lax.scan(down, above, numbers)
    of_ground = pair(1.0, [at_bottom]), _slope_of_column(at_bottom)
    return answers, fields, room, Slopes(slopes, (*beams,), *of_ground, of_jumps, square)


def _read(
    air: Air, doublings: Doublings, number: Array, order: Order
) -> tuple[Layer, Array, Doublings]:
    """A layer, the view's secant in it, and its doublings."""
    own = jax.tree.map(lambda x: read(x, number), doublings)
    return air.layers.layer(number, order.odd), read(air.view_secants, number), own


def radiance_at_the_top(above: Float[Array, "*batch"], weight: Float[Array, "*batch"]) -> AtTheTop:
    """Reflection of sunlight and emission towards the view, and the fields of the head."""

    def at_the_top(stack: Bordered, column: Vector) -> tuple[Any, Fields]:
        driving = above * isotropic_nodes(stack.core)[:, 0] + column.nodes
        rights = jnp.concatenate([stack.border, driving[:, None]], axis=1)
        solved = matmul(top(stack).inverse, rights)
        sun, view, warm = solved[:, 0], solved[:, 1], solved[:, 2]
        to_view = stack.border[:, 1]
        reflection = 0.5 * (jnp.sum(to_view * sun, axis=0) - stack.corner[0])
        emitted = 0.5 * (column.beams[0] - jnp.sum(to_view * warm, axis=0))
        nodes = jnp.stack([warm - weight * sun, 0.5 * view], axis=1)
        own = jnp.stack([weight, jnp.full_like(weight, -0.5)])
        return (reflection, emitted), Fields(nodes, own, jnp.zeros_like(own))

    return at_the_top


def slope_of_light_from_above(fields: Fields) -> Float[Array, "*batch"]:
    """Slope in `Heating.above`, from the fields at the top."""
    return -jnp.sum(fields.nodes[:, 1] * isotropic_nodes(fields.nodes)[:, 0], axis=0)


def _slope_of_column(fields: Fields) -> Vector:
    return Vector(-fields.nodes[:, 1], -fields.own[1:])


@fenced
def _collected(step, tau, totals, a: MatrixSlopes, b: MatrixSlopes, coalbedo):
    """Totals over the layers, and the layer's own slopes, from those over h."""
    h = tau * step
    sun, view = h * (a.secants + b.secants)
    beams = totals[0] + h * a.beams, totals[1] + h * b.beams
    slopes = Layer(step * (a.h + b.h), h * coalbedo, sun, h * a.moments, h * b.moments)
    square = totals[2] + total(slopes.even**2) + total(slopes.odd**2)
    return (*beams, square), slopes, view
