"""How many columns are taken together: on a CPU as many as suit its cache, elsewhere thousands.

A tile is what a program solves at once, in a loop over tiles; a chunk is what a program is called
with, so that it is compiled for a few sizes whatever comes. On a CPU the fewer, the more of a layer
is in the cache next to the processor; the more, the less the start of a kernel counts
(`benchmarks/layout.py` measures both). Another device has no cache to keep a tile in, but many
units to fill and a time to start each kernel: there the more the better, and memory bounds the
number (`benchmarks/devices.py --tile` measures it).

These are functions, and asked as columns come: which devices there are is settled when JAX is first
used, and not when this package is imported.
"""

from typing import Any

import jax.numpy as jnp

from .backend import on_cpu
from .compiler import SHORTEST, shortest_loop

VECTOR = 8
"""Numbers in double precision that a vector unit holds at most; tiles narrower than a few of these
leave it idle."""

# Of few rows, or in single precision, a layer of so many columns is in the cache; of more streams
# one of as few as there are vectors of, or of half as many. Within an error budget columns are put
# in order: those of a narrower tile are more alike, which from 14 streams on is worth more.
_TILE, _FEW_STREAMS, _FEW_STREAMS_IN_ORDER, _MORE_STREAMS = 64, 6, 12, 14
_WHOLE_STREAMS = 16  # up to which a chunk has as many columns

# What another device than a CPU takes, of whatever is taken together, and of the solver's columns
# up to 8 and up to 16 streams. A GPU needs half the time a column for 16,384 that it needs for
# 4,096, and 0.75 to 0.95 of that for 32,768; where columns are sorted, 0.7 in chunks of two tiles.
_ELSEWHERE, _SOLVER_ELSEWHERE = 4096, {8: 32768, 16: 16384}
_SORTED_TILES_ELSEWHERE = 2
# Of a chunk of columns that are sorted, in tiles of 64, or of 32.
_SORTED_TILES = 32
# Columns of the solver in a tile of states, in tiles of the solver: its own loop is inside. The
# more there are the more alike are those that an error budget puts in order, and the fewer times
# are the optics of a layer begun: a Jacobian takes a tenth more with 8.
_SOLVER_TILES, _SOLVER_TILES_ELSEWHERE = 32, 2


def tile_size(num_streams: int, dtype: Any, rounds: bool = False, alone: bool = False) -> int:
    """Columns that the solver takes at once, at most.

    `rounds` tells whether they are solved within a budget, most of it in float32; `alone`, whether
    these are slopes of the one layer that there is. That is no kernel, but a hundred, which take
    as long to begin as the arithmetic of few columns.

    The fewer, the more of a layer is in the cache next to the processor, but of too few LLVM makes
    no vectors (`compiler.shortest_loop`; `rows.in_rows` has what was done about it). Where a
    layer is one kernel (`kernels`) a tile is also small enough for that.
    """
    if not on_cpu():
        fitting = [tile for most, tile in _SOLVER_ELSEWHERE.items() if num_streams <= most]
        return fitting[0] if fitting else _ELSEWHERE
    if alone and num_streams <= _WHOLE_STREAMS:
        return _TILE
    return _tile(num_streams, dtype, rounds, shortest_loop())


def _tile(num_streams: int, dtype: Any, rounds: bool, shortest: int) -> int:
    if rounds and num_streams > _FEW_STREAMS_IN_ORDER:
        return shortest
    if rounds or jnp.dtype(dtype) == jnp.float32 or num_streams <= _FEW_STREAMS:
        return _TILE
    return shortest if num_streams <= _MORE_STREAMS else shortest // 2


def tile_of_states(columns: int, num_streams: int, dtype: Any) -> int:
    """States of which each is so many columns of the solver that are solved at once, at most."""
    if on_cpu():
        together = _SOLVER_TILES * _whole(num_streams, dtype)
    else:
        together = _SOLVER_TILES_ELSEWHERE * tile_size(num_streams, dtype)
    return VECTOR * max(1, together // columns // VECTOR)


def _whole(num_streams: int, dtype: Any, rounds: bool = False) -> int:
    """Columns of which those that are taken together are a multiple, on a CPU."""
    single = rounds or jnp.dtype(dtype) == jnp.float32
    return _TILE if single or num_streams <= _WHOLE_STREAMS else _TILE // 2


def tile_of_grounds() -> int:
    """Columns whose grounds are looked at at once, each from some 2000 views."""
    return 64 if on_cpu() else _ELSEWHERE


def chunks_of_columns(
    num_streams: int, dtype: Any, in_order: bool = False, rounds: bool = False
) -> tuple[int, ...]:
    """Numbers of the solver's columns that are worth a program, rising.

    Those that are put `in_order` before they are cut into tiles are the more alike in a tile the
    more there are of them.
    """
    if not on_cpu():
        tile = tile_size(num_streams, dtype, rounds)
        widths = _few_elsewhere(tile)
        return (*widths, _SORTED_TILES_ELSEWHERE * tile) if in_order else widths
    # A chunk of fewer columns than these would be solved in few times what it needs to begin.
    least = max(SHORTEST, _tile(num_streams, dtype, rounds, SHORTEST))
    whole = _whole(num_streams, dtype, rounds)
    if in_order:
        return VECTOR, least, 8 * whole, _SORTED_TILES * whole
    if num_streams > 8:
        return VECTOR, least, 8 * whole
    # A chunk is solved in few times what it needs to begin and to end.
    between = (2 * whole,) if least < whole else ()
    return VECTOR, least, *between, 8 * whole, 16 * whole


def chunks_of_states(tile: int) -> tuple[int, ...]:
    """Numbers of states that are worth a program, rising, of those solved in tiles of so many."""
    if not on_cpu():
        return _few_elsewhere(tile)
    return 1, VECTOR * max(1, tile // 4 // VECTOR), 2 * tile


def _few_elsewhere(tile: int) -> tuple[int, ...]:
    """Widths up to a tile: half as many columns take more than half the time, and each program half
    a minute to compile.
    """
    return max(1, tile // 16), max(2, tile // 4), tile


def chunks_to_read() -> tuple[int, ...]:
    """Numbers of columns whose optics alone are taken together, rising."""
    return 64, 1024 if on_cpu() else _ELSEWHERE


def chunk_of_pixels() -> int:
    """Pixels that are retrieved together.

    On a CPU few: a minimisation lasts until the slowest of them is done, and the matrices of many
    columns leave the cache. 196 pixels of three bands took 3.1, 3.5, 3.8 and 4.8 s on two cores in
    chunks of 16, 32, 48 and 96.
    """
    return 16 if on_cpu() else _ELSEWHERE


def chunk_of_pixels_to_read() -> int:
    """Pixels whose thickest layers are looked for together."""
    return 256 if on_cpu() else _ELSEWHERE
