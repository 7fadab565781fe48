"""How columns in memory are cut into chunks of a few widths."""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from .backend import on_cpu

Chunk = tuple[int, int]
"""Where it starts, and its width."""


def cut(size: int, widths: Sequence[int], num_cores: int) -> list[Chunk]:
    """Start and width of each chunk.

    Large chunks, as many on every core; smaller ones for what is left, so that cores end together.
    These are as wide as lets them end soonest, if a chunk takes as long to begin and to end as half
    as many columns take to be solved as are worth a program: the second width.
    """
    *smaller, largest = widths
    if not smaller:
        return _evenly(0, size, largest)
    to_begin = smaller[-1 if len(smaller) == 1 else 1] // 2
    share = size // (largest * num_cores) * num_cores * largest
    if size - share > largest * num_cores - smaller[-1]:
        share = size  # no more columns twice than a small chunk has
    chunks = _evenly(0, share, largest) if share else []
    rest = size - share
    if rest == 0:
        return chunks
    rounds = {w: math.ceil(math.ceil(rest / w) / num_cores) for w in smaller}
    width = min(smaller, key=lambda w: rounds[w] * (w + to_begin))
    if width >= rest:
        return [*chunks, (max(0, size - width), width)]
    return chunks + _evenly(share, rest, width)


def _evenly(start: int, count: int, width: int) -> list[Chunk]:
    """Chunks of one width for `count` columns from `start` on."""
    number = -(-count // width)
    end = start + count
    return [(max(0, min(start + k * width, end - width)), width) for k in range(number)]


def first_of_each(chunks: list[Chunk]) -> list[Chunk]:
    """The first chunk of each width."""
    return list({width: (start, width) for start, width in reversed(chunks)}.values())


def counts_of(chunks: Sequence[Chunk], size: int) -> tuple[int, ...]:
    """Columns of each chunk that are in none after it."""
    starts = [start for start, _ in chunks]
    return tuple(end - start for start, end in zip(starts, [*starts[1:], size], strict=True))


def as_it_lies(x: Any) -> Any:
    """An array as it can be cut without moving it: JAX's on a CPU are NumPy's, too."""
    return x if isinstance(x, jax.Array) and not on_cpu() else np.asarray(x)


def part_of(x: Any, start: int, width: int) -> Any:
    """So many columns of an array, where it lies; those after the last are copies of it."""
    end = start + width
    if isinstance(x, jax.Array):
        return x if (start, end) == (0, len(x)) else _part_on_device(x, start, width)
    return x[start:end] if end <= len(x) else x[np.minimum(np.arange(start, end), len(x) - 1)]


@partial(jax.jit, static_argnums=2)
def _part_on_device(x: Array, start: int, width: int) -> Array:
    return x[jnp.minimum(start + jnp.arange(width), len(x) - 1)]
