"""Many pixels, a chunk at a time and on every core."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from abi_operator.speed import usable_cores

T = TypeVar("T")

CHUNK = 16
"""Pixels that are solved together. A minimisation lasts until the slowest of them is done, and the
matrices of many columns leave the cache: 196 pixels of three bands took 3.1, 3.5, 3.8 and 4.8 s on
two cores in chunks of 16, 32, 48 and 96 (`benchmarks/layout.py`)."""


def map_chunks(function: Callable[..., T], *arguments: PyTree, chunk: int = CHUNK) -> T:
    """Apply a compiled, batched function to all pixels.

    Parameters
    ----------
    function
        From arrays of one chunk to arrays, compiled by `jax.jit`, pixels leading in all of them.
    arguments
        Arrays of all pixels, one pixel or more. The last chunk is filled up with copies of the
        last pixel, so that one program serves all.
    chunk
        Pixels a chunk.

    Returns
    -------
    What `function` returns, for all pixels, as NumPy arrays.
    """
    num_pixels = jax.tree.leaves(arguments)[0].shape[0]
    arguments = jax.tree.map(np.asarray, arguments)
    starts = range(0, num_pixels, chunk)
    # A setting of this thread, not of the workers.
    x64 = jax.dtypes.canonicalize_dtype(np.float64) == np.float64

    def solve(start: int) -> T:
        with jax.enable_x64(x64):
            rows = np.minimum(np.arange(start, start + chunk), num_pixels - 1)
            result = function(*jax.tree.map(lambda x: jnp.asarray(x[rows]), arguments))
            return jax.tree.map(np.asarray, result)

    first = solve(starts[0])  # compiles
    with ThreadPoolExecutor(usable_cores()) as pool:  # JAX computes without Python's global lock
        others = list(pool.map(solve, starts[1:]))
    return jax.tree.map(lambda *parts: np.concatenate(parts)[:num_pixels], first, *others)
