"""Which layout runs at which size.

Kernels have their batch last and work on one tile of columns at a time, small enough that the
matrices of a layer stay in the cache and large enough to fill the vector units. Microseconds per
layer and azimuth mode of the value, float64, one core (`benchmarks/layout.py`):

======= ==== ==== ==== ==== ==== ========
streams   16   32   64  128  256 no tiles
======= ==== ==== ==== ==== ==== ========
4       0.81 0.44 0.29 0.22 0.19     0.19
8       1.64 0.79 0.63 0.53 0.63     0.89
16      3.58 3.11 2.80 2.78 4.33     5.79
======= ==== ==== ==== ==== ==== ========
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array


def tile_size(num_streams: int) -> int:
    """Columns that are solved together."""
    return 256 if num_streams <= 4 else 128 if num_streams <= 8 else 64 if num_streams <= 16 else 16


def map_tiles(function: Callable[[Any], Any], columns: Any, tile: int) -> Any:
    """Apply a batch-last `function` to a pytree of arrays tile by tile.

    Parameters
    ----------
    function
        Maps a pytree of arrays whose last axis is the batch to another such.
    columns
        Its argument; all leaves have the same last axis. A last, partial tile is filled up with
        copies of the last column, whose results are dropped.
    tile
        Columns a tile.
    """
    size = jax.tree.leaves(columns)[0].shape[-1]
    if size <= tile:
        return function(columns)
    count = -(-size // tile)

    def tiled(x: Array) -> Array:
        padding = [(0, 0)] * (x.ndim - 1) + [(0, count * tile - size)]
        return jnp.moveaxis(
            jnp.pad(x, padding, mode="edge").reshape(*x.shape[:-1], count, tile), -2, 0
        )

    def joined(x: Array) -> Array:
        return jnp.moveaxis(x, 0, -2).reshape(*x.shape[1:-1], count * tile)[..., :size]

    # Reverse mode computes a tile again when its turn comes, so that its memory is that of a tile.
    mapped = jax.lax.map(jax.checkpoint(function), jax.tree.map(tiled, columns))
    return jax.tree.map(joined, mapped)
