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
(`layer.half_layer`), with :math:`U = Z^{-1}A`, :math:`W = Z^{-1}C`,
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

from .._kernels import one_kernel, small_enough
from .._numerics import Entry, Rows, as_array, fenced, is_entry, matmul
from .adding import top
from .bordered import Bordered
from .fields import Fields, pair
from .layer import ModeKernels
from .layer_adjoint import Layer, Layers, Order, climb, descend
from .pull_back import MatrixSlopes, undo_inverse, undo_matrix

Kernels = tuple[ModeKernels, ModeKernels]


class Slopes(NamedTuple):
    """Of one mode, in what its beams are made of and in its ground; of it and those before it, in
    what all share.
    """

    shared: "Shared"
    even_beams: Float[Array, "2 degree *batch"]
    odd_beams: Float[Array, "2 degree *batch"]
    ground: Bordered


class Shared(NamedTuple):
    """What all modes depend on, or slopes in it."""

    layers: Layers
    view_secant: Float[Array, "*batch"]


def mode_slopes(
    shared: Shared,
    num_doublings: int,
    single_scattering: bool,
    order: Order,
    kernels: Kernels,
    ground: Bordered,
    weight: Float[Array, "*batch"],
    slopes: Shared,
    kept: Any,
) -> tuple[Float[Array, "*batch"], Any, Slopes]:
    """Reflection of a mode, and the slopes of `weight` times it, added to those of other modes.

    `kept` is `room` for what is kept of all layers, given back filled: modes that share it do not
    clear it, nor copy it, one after the other. Layers are read and written inside the kernels: as
    inputs and outputs of a scan every array would be one more kernel a layer. Matrices lie in it as
    one row each: LLVM unrolls a copy of 64 numbers whole, number by number, before it could make
    vectors of it.
    """
    layers, view_secant = shared
    num_layers, num_nodes = layers.tau.shape[0], layers.moments.shape[1]
    dtype = layers.tau.dtype
    numbers = jnp.arange(num_layers, dtype=dtype)

    def compiled(function: Callable[..., Any], **how: bool) -> Callable[..., Any]:
        # A layer that is the only one fills the room: in the kernel XLA finds no use for its
        # number, nor for what was in the room (see `one_kernel`).
        return function if numbers.size == 1 else one_kernel(function, num_nodes, **how)

    def moved_at_once(function: Callable[..., Any], **how: bool) -> Callable[..., Any]:
        # In a layer that is too large for one kernel, all that is only moved is one.
        alone = numbers.size == 1 or small_enough(num_nodes, dtype, **how)
        return function if alone else one_kernel(function, 1)

    def put_on_and_keep(stack, kept, layers, number, order, kernels, view_secant):
        layer = layers.layer(number, order.odd)
        a, p = layer.matrices(order.mean, kernels, view_secant, single_scattering)
        stack, new = climb(stack, a, p, layer.tau, num_doublings)
        return stack, keep(kept, new, number)

    @partial(moved_at_once, in_parts=True)
    def keep(kept, new, number):
        return jax.tree.map(partial(_in_row, number.astype(jnp.int32)), kept, new)

    put_one = compiled(put_on_and_keep, in_parts=True)

    def up(carry, number):
        return put_one(*carry, layers, number, order, kernels, view_secant), None

    shapes = _shapes_of_kept(num_nodes, layers.tau, num_doublings)
    (stack, kept), _ = jax.lax.scan(up, (ground, kept), numbers, reverse=True)
    reflection, fields = _fields_at_the_top(stack, weight)

    def undo(fields, totals, layer, mean, kept, kernels, view_secant):
        # The beams' own entries of the stack are 1 whatever happens in it.
        fields = fields._replace(other=jnp.zeros_like(fields.other))
        secants = layer.secants(view_secant)
        fields, a_bar, p_bar = descend(fields, layer.tau, secants, kept, num_doublings)
        a, coalbedo = undo_matrix(
            kernels[0], layer.even, secants, a_bar, single_scattering, layer.coalbedo, mean
        )
        b = undo_inverse(kernels[1], layer.odd, kept.b_inverse, p_bar, single_scattering)
        step = 0.5 / 2**num_doublings
        return fields, *_collected(step, layer.tau, totals, a, b, coalbedo)

    @compiled
    def undo_one(carry, layers, kept, number, order, kernels, view_secant):
        fields, totals, slopes = carry
        own = entries(kept, number) if small_enough(num_nodes, dtype) else arrays(kept, number)
        layer = layers.layer(number, order.odd)
        fields, totals, new = undo(fields, totals, layer, order.mean, own, kernels, view_secant)
        return fields, totals, slopes.plus(number, order.odd, new)

    def entries(kept, number):
        place = number.astype(jnp.int32)
        return jax.tree.map(lambda x, like: Entry(x, place, like.shape), kept, shapes)

    @moved_at_once
    def arrays(kept, number):
        return jax.tree.map(as_array, entries(kept, number), is_leaf=is_entry)

    def down(carry, number):
        return undo_one(carry, layers, kept, number, order, kernels, view_secant), None

    start = *(jnp.zeros_like(x.beams) for x in kernels), slopes.view_secant
    carry, _ = jax.lax.scan(down, (fields, start, slopes.layers), numbers)
    fields, (even, odd, view), layers = carry
    return reflection, kept, Slopes(Shared(layers, view), even, odd, pair(1.0, [fields]))


def room(like: Float[Array, "layer *batch"], num_nodes: int, num_doublings: int) -> Any:
    """Room for what is kept of all layers, which are like these."""
    # A number of its own in each: arrays of zeros would be one for XLA, and copied.
    leaves, structure = jax.tree.flatten(_shapes_of_kept(num_nodes, like, num_doublings))
    return structure.unflatten(
        jnp.full((like.shape[0], x.size), float(k), x.dtype) for k, x in enumerate(leaves)
    )


def _shapes_of_kept(num_nodes: int, like: Array, num_doublings: int) -> Any:
    """What `climb` keeps of one layer."""

    def kept(like: Array) -> Any:
        def array(*own: int) -> Array:
            return jnp.zeros((*own, *like.shape[1:]), like.dtype)

        matrix = Bordered(array(num_nodes, num_nodes), array(num_nodes, 2), array(2), array(1))
        _, kept = climb(matrix, matrix, matrix, array(), num_doublings)
        return jax.tree.map(_joined, kept, is_leaf=_in_blocks)

    return jax.eval_shape(kept, like)


def _in_blocks(x: Any) -> bool:
    return isinstance(x, Rows)


def _joined(x: Any) -> Array:
    return x.joined() if isinstance(x, Rows) else x


def _in_row(place: Any, rows: Array, new: Any) -> Array:
    """The array with `new` in that row; a matrix in blocks is put together on the way."""
    start = 0
    for block in new.blocks if isinstance(new, Rows) else (new,):
        rows = _put(rows, block.reshape(-1), place, start)
        start += block.size
    return rows


def _put(rows, part, place, start):
    @fenced
    def put(rows, part, place):
        return jax.lax.dynamic_update_slice(rows, part[None], (place, jnp.int32(start)))

    return put(rows, part, place)


def _fields_at_the_top(stack: Bordered, weight):
    """Reflection, and fields whose pair is the cotangent of `weight` times it."""
    solved = matmul(top(stack).inverse, stack.border)
    reflection = 0.5 * (jnp.sum(stack.border[:, 1] * solved[:, 0], axis=0) - stack.corner[0])
    scale = jnp.stack([jnp.ones_like(weight), -0.5 * weight])
    return reflection, Fields(-scale * solved, scale, jnp.zeros_like(scale))


@fenced
def _collected(step, tau, totals, a: MatrixSlopes, b: MatrixSlopes, coalbedo):
    """Totals over the layers, and the layer's own slopes, from those over h."""
    h = tau * step
    secants = h * (a.secants + b.secants)
    beams = totals[0] + h * a.beams, totals[1] + h * b.beams
    slopes = Layer(step * (a.h + b.h), h * coalbedo, secants[0], h * a.moments, h * b.moments)
    return (*beams, totals[2] + secants[1]), slopes
