"""Room for what the way up keeps of layers and of their doublings, for the way down.

It is one array for each kind of thing kept, with a row for every layer or every doubling of every
layer. Matrices lie in it as one row each: LLVM unrolls a copy of 64 numbers whole, number by
number, before it could make vectors of it. Modes that share it do not clear it, nor copy it, one
after the other.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.algebra import Entry, Rows, as_array, fenced, is_entry
from ...machine.kernels import one_kernel, small_enough
from ..method.bordered import Bordered, Vector
from .fields import Action, Feed
from .layer import Doubled, Kept, Part


class Room(NamedTuple):
    """What is kept: `gradient.layer.Kept` of each layer, and a quotient of each doubling.

    None in place of the latter where there are none. And the stack with each layer on it, where it
    is wanted.
    """

    layers: Any
    doublings: Any
    stacks: Any = None


class Keeper:
    """Puts things into a room and finds them there; numbers of layers are floating (`Order`).

    Parameters
    ----------
    tau
        Optical depth of the layers of which things are kept, which they are like.
    num_nodes
        Rows of the matrices.
    most
        Doublings of a layer, at most.
    stacks
        Whether stacks are kept.
    warm
        Whether there is thermal light.
    """

    def __init__(
        self,
        tau: Float[Array, "layer *batch"],
        num_nodes: int,
        most: int,
        stacks: bool = False,
        warm: bool = False,
    ):
        self.num_layers, self.num_nodes, self.most = tau.shape[0], num_nodes, most
        self.stacks = stacks
        self.dtype, self.shapes = tau.dtype, _shapes(num_nodes, tau, warm)

    def empty(self) -> Room:
        """Room with nothing of use in it."""
        count = self.num_layers * self.most
        doublings = _empty(self.shapes.doublings, count, 1) if count else None
        stacks = _empty(self.shapes.stacks, self.num_layers, 2) if self.stacks else None
        return Room(_empty(self.shapes.layers, self.num_layers, 0), doublings, stacks)

    def with_layer(self, room: Room, kept: Any, number: Array) -> Room:
        """The room with what is kept of a layer."""
        return room._replace(layers=self._put(room.layers, kept, number))

    def with_doubling(self, room: Room, kept: Any, number: Array, k: Any) -> Room:
        """The room with what is kept of a layer's k-th doubling."""
        return room._replace(doublings=self._put(room.doublings, kept, self._place(number, k)))

    def with_stack(self, room: Room, stack: Bordered, number: Array) -> Room:
        """The room with the stack of a layer and all below."""
        return room._replace(stacks=self._put(room.stacks, stack, number))

    def stack(self, room: Room, number: Array) -> Any:
        """What was kept of a stack."""
        found = self._get(room.stacks, self.shapes.stacks, number)
        return jax.tree.map(as_array, found, is_leaf=is_entry)

    def layer(self, room: Room, number: Array) -> Any:
        """What was kept of a layer."""
        return self._get(room.layers, self.shapes.layers, number)

    def doubling(self, room: Room, number: Array, k: Any) -> Any:
        """What was kept of a layer's k-th doubling."""
        return self._get(room.doublings, self.shapes.doublings, self._place(number, k))

    def _place(self, number, k):
        return number * self.most + jnp.asarray(k, self.dtype)

    def _put(self, rows, new, number):
        def put(rows, new, number):
            return jax.tree.map(partial(_in_row, number.astype(jnp.int32)), rows, new)

        return self._moved_at_once(put, in_parts=True)(rows, new, number)

    def _get(self, rows, shapes, number):
        def entries(rows, number):
            place = number.astype(jnp.int32)
            return jax.tree.map(lambda x, like: Entry(x, place, like.shape), rows, shapes)

        def arrays(rows, number):
            return jax.tree.map(as_array, entries(rows, number), is_leaf=is_entry)

        small = small_enough(self.num_nodes, self.dtype, in_parts=True)
        return entries(rows, number) if small else self._moved_at_once(arrays)(rows, number)

    def _moved_at_once(self, function: Callable[..., Any], **how: bool) -> Callable[..., Any]:
        # In a layer that is too large for one kernel, all that is only moved is one. A layer that
        # is the only one fills the room: see `mode`.
        alone = self.num_layers == 1 or small_enough(self.num_nodes, self.dtype, **how)
        return function if alone else one_kernel(function, 1)


def _empty(shapes: Any, count: int, first: int) -> Any:
    # A number of its own in each: arrays of zeros would be one for XLA, and copied.
    leaves, structure = jax.tree.flatten(shapes)
    return structure.unflatten(
        jnp.full((count, x.size), first + 3.0 * k, x.dtype) for k, x in enumerate(leaves)
    )


def _shapes(num_nodes: int, like: Float[Array, "layer *batch"], warm: bool) -> Room:
    """What `climb` keeps of one layer, and of each doubling; and a stack."""

    def kept() -> Room:
        def array(*own: int) -> Array:
            return jnp.zeros((*own, *like.shape[1:]), like.dtype)

        core, border = array(num_nodes, num_nodes), array(num_nodes, 2)
        beams, corner = array(2), array(1)
        part, feed = Part(core, border), Feed(border, corner)
        adding = Action(core, border, beams, beams, feed, feed)
        own = Bordered(core, border, beams, corner)
        response = Vector(array(num_nodes), corner) if warm else None
        kept = Kept(own, feed, feed, part, part, adding, response)
        return Room(kept, Doubled(part, feed), own)

    return jax.eval_shape(kept)


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
