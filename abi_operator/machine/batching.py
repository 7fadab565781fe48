"""Tiles of columns, one after the other, on every device of a CPU.

Kernels have their batch last and work on one tile of columns at a time, small enough that the
matrices of a layer stay in the cache and large enough to fill the vector units (`sizes`).

XLA runs the loop over tiles on one core: its loops share their temporary memory and so follow each
other, however a program is written. It does run several CPU devices at a time, and where JAX has
more than one (``JAX_NUM_CPU_DEVICES=4``, before JAX is first used) every device takes its share of
the tiles, under any transformation. What comes back then lies on all of them. Not so where the
caller settles what runs where: by `jax.default_device`, a mesh, or several processes.

Where a batch divides evenly, it is divided as it comes, before anything is done to it
(`on_every_device`): each device then copies and transposes its own columns and nothing is
exchanged. Left to XLA, to pad, transpose and cut an array of which each device holds a part takes a
few dozen exchanges, as long as some hundred columns of 4 streams.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from jaxtyping import Array

from .plain import is_plain
from .sizes import VECTOR
from .told import AtOnce, glanced, unless_told, with_the_rest

_FEWEST_A_DEVICE = 4 * VECTOR


def tile_by_tile(
    function: Callable[[list[Array]], Any],
    leaves: Sequence[Array],
    own_axes: Sequence[int],
    tile: int,
    need: Callable[[list[Array]], Array] | None = None,
    at_once: AtOnce | None = None,
) -> Any:
    """Apply a batch-last `function` to arrays whose batch comes first, on every CPU device.

    Parameters
    ----------
    function
        Of a list of arrays ``*own batch`` to a pytree of arrays whose last axis is the batch, every
        column by itself.
    leaves
        Its arguments, ``*batch *own``, whose batches broadcast.
    own_axes
        Number of axes of each that belong to one column.
    tile
        Columns a tile, at most.
    need, at_once
        As in `map_tiles`, of such a list.

    Returns
    -------
    What `function` gives of all columns, with the axes of the batch first.
    """

    def of_share(leaves: Sequence[Array]) -> Any:
        batch = _outer(leaves, own_axes)[0]

        def batch_last(x: Array, own: int) -> Array:
            shape = x.shape[x.ndim - own :]
            full = jnp.broadcast_to(x, (*batch, *shape))
            return jnp.moveaxis(full.reshape(math.prod(batch), *shape), 0, -1)

        def batch_first(x: Array) -> Array:
            return jnp.moveaxis(x, -1, 0).reshape(*batch, *x.shape[:-1])

        last = [batch_last(x, own) for x, own in zip(leaves, own_axes, strict=True)]
        return jax.tree.map(batch_first, map_tiles(function, last, tile, need, at_once))

    batch, shapes = _outer(leaves, own_axes)
    divided = [len(shape) == len(batch) > 0 and shape[0] == batch[0] for shape in shapes]
    return on_every_device(of_share, list(leaves), divided)


def _outer(
    leaves: Sequence[Array], own_axes: Sequence[int]
) -> tuple[tuple[int, ...], list[tuple[int, ...]]]:
    """Shape of the batch, and of that of each array, which broadcasts to it."""
    shapes = [x.shape[: x.ndim - own] for x, own in zip(leaves, own_axes, strict=True)]
    return np.broadcast_shapes(*shapes), shapes


def map_tiles(
    function: Callable[[Any], Any],
    columns: Any,
    tile: int,
    need: Callable[[Any], Array] | None = None,
    at_once: AtOnce | None = None,
) -> Any:
    """Apply a batch-last `function` to a pytree of arrays tile by tile, on every CPU device.

    Parameters
    ----------
    function
        Maps a pytree of arrays whose last axis is the batch to another such.
    columns
        Its argument; all leaves have the same last axis. Tiles are equally wide: the last is filled
        up with copies of the last column, whose results are dropped.
    tile
        Columns a tile, at most.
    need
        Maps columns to a number each, by which they are sorted before they are cut into tiles:
        those in a tile are then alike. None leaves them as they come.
    at_once
        Tells the value of some columns without `function` (`told`); None for itself: of none.
    """
    size = jax.tree.leaves(columns)[0].shape[-1]
    devices = _devices(size)
    count, width = _equal_tiles(size, tile, len(devices))
    apart = count == 1 or len(devices) > 1 or is_plain()
    if apart:
        function = unless_told(function, at_once)
    if count == 1:
        return function(columns)

    # Columns are cut into tiles while their axis is the first, as callers give them, and turned
    # one tile at a time, in the cache: XLA drops what turns all of them to and fro.
    def tiled(x: Array, order: Array | None = None) -> Array:
        padding = [(0, count * width - size)] + [(0, 0)] * (x.ndim - 1)
        first = jnp.pad(_taken(jnp.moveaxis(x, -1, 0), order), padding, mode="edge")
        return first.reshape(count, width, *first.shape[1:])

    def joined(x: Array, place: Array | None = None) -> Array:
        first = x.reshape(count * width, *x.shape[2:])[:size]
        return jnp.moveaxis(_taken(first, place), 0, -1)

    def by_tiles(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
        def of_tile(columns: Any) -> Any:
            result = function(jax.tree.map(lambda x: jnp.moveaxis(x, 0, -1), columns))
            return jax.tree.map(lambda x: jnp.moveaxis(x, -1, 0), result)

        def mapped(tiles: Any) -> Any:
            # Reverse mode computes a tile again when its turn comes: its memory is that of a tile.
            return jax.lax.map(jax.checkpoint(of_tile), tiles)

        return _divided(mapped, devices, _SHARE) if len(devices) > 1 else mapped

    if at_once is not None and not apart:
        glance = partial(glanced, at_once=at_once, need=need)
        known = jax.tree.map(joined, by_tiles(glance)(jax.tree.map(tiled, columns)))
        first, known = jax.tree.map(lambda x: jnp.moveaxis(x, -1, 0), (columns, known))
        whole = with_the_rest(function, first, known, width)
        return jax.tree.map(lambda x: jnp.moveaxis(x, 0, -1), whole)
    order = place = None
    if need is not None:
        numbers = joined(by_tiles(need)(jax.tree.map(tiled, columns)))
        order = jnp.argsort(numbers)
        place = _places(order)
    found = by_tiles(function)(jax.tree.map(lambda x: tiled(x, order), columns))
    return jax.tree.map(lambda x: joined(x, place), found)


def _taken(x: Array, order: Array | None) -> Array:
    """Columns in another order."""
    if order is None:
        return x
    return x.at[order].get(mode="promise_in_bounds", unique_indices=True)


def _places(order: Array) -> Array:
    """Where each column is in an order."""
    return jnp.zeros_like(order).at[order].set(jnp.arange(order.size), unique_indices=True)


def on_every_device(function: Callable[[Any], Any], columns: Any, divided: Sequence[bool]) -> Any:
    """Apply a batch-first `function`, whose columns do not mix, to a share on every CPU device.

    Parameters
    ----------
    function
        Maps a pytree of arrays to another, in all of which the batch's first axis is the first.
    columns
        Its argument.
    divided
        Whether the first axis of each of its leaves is the batch's first. Others all columns share.
    """
    leaves, structure = jax.tree.flatten(columns)
    sizes = {x.shape[0] for x, own in zip(leaves, divided, strict=True) if own}
    size = sizes.pop() if len(sizes) == 1 else 0
    devices = _devices(size)
    if len(devices) == 1 or size % len(devices):
        return function(columns)
    specs = [_SHARE if own else PartitionSpec() for own in divided]
    return _divided(function, devices, jax.tree.unflatten(structure, specs))(columns)


def announced(arrays: Sequence[Array], size: int) -> list[Array]:
    """The same arrays, of `size` columns, which tell `jax.jit` that every CPU device takes a share.

    Where columns are divided by an operation that is not traced inside until it is compiled,
    `jax.jit` would not find the devices by itself.
    """
    devices = _devices(size)
    given = list(arrays)
    if len(devices) > 1:
        everywhere = NamedSharding(Mesh(np.asarray(devices), ("device",)), PartitionSpec())
        smallest = min(range(len(given)), key=lambda k: given[k].size)
        given[smallest] = jax.lax.with_sharding_constraint(given[smallest], everywhere)
    return given


_SHARE = PartitionSpec("device")


def _divided(function: Callable[[Any], Any], devices: list[Any], shares: Any) -> Any:
    """`function` of shares of its argument, each on its device."""
    mesh = Mesh(np.asarray(devices), ("device",))
    # Nothing is exchanged between the devices, so there is nothing to check.
    return jax.shard_map(function, mesh=mesh, in_specs=(shares,), out_specs=_SHARE, check_vma=False)


def _devices(size: int) -> list[Any]:
    """CPU devices that so many columns occupy and this program may use; one stands for any."""
    devices = jax.local_devices()
    settled = (
        jax.config.jax_default_device is not None  # pyright: ignore[reportAttributeAccessIssue]
        or not jax.sharding.get_abstract_mesh().empty
        or jax.process_count() > 1
    )
    few = size < _FEWEST_A_DEVICE * len(devices)
    return devices[:1] if settled or few or devices[0].platform != "cpu" else devices


def _equal_tiles(size: int, tile: int, num_devices: int) -> tuple[int, int]:
    """Number of tiles, the same for every device, and their width: as narrow as the number lets."""
    share = math.ceil(size / num_devices)
    count = max(1, math.ceil(share / tile))
    width = min(tile, VECTOR * math.ceil(share / count / VECTOR))
    return count * num_devices, width
