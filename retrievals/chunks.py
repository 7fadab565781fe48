"""Many pixels, a chunk at a time and on every core."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from abi_operator.machine.sizes import chunk_of_pixels
from abi_operator.machine.speed import usable_cores

T = TypeVar("T")


def map_chunks(function: Callable[..., T], *arguments: PyTree, chunk: int | None = None) -> T:
    """Apply a compiled, batched function to all pixels.

    Parameters
    ----------
    function
        From arrays of one chunk to arrays, compiled, pixels leading in all of them.
    arguments
        Arrays of all pixels, one pixel or more. The last chunk is filled up with copies of the
        last pixel, so that one program serves all.
    chunk
        Pixels a chunk; None for those that are retrieved together.

    Returns
    -------
    What `function` returns, for all pixels, as NumPy arrays.
    """
    chunk = chunk_of_pixels() if chunk is None else chunk
    num_pixels = jax.tree.leaves(arguments)[0].shape[0]
    arguments = jax.tree.map(np.asarray, arguments)
    starts = range(0, num_pixels, chunk)
    x64 = _in_double_precision()

    def solve(start: int) -> T:
        with jax.enable_x64(x64):
            result = function(*jax.tree.map(partial(_filled, start, chunk), arguments))
            return jax.tree.map(np.asarray, result)

    first = solve(starts[0])  # compiles
    with ThreadPoolExecutor(usable_cores()) as pool:  # JAX computes without Python's global lock
        others = list(pool.map(solve, starts[1:]))
    return jax.tree.map(lambda *parts: np.concatenate(parts)[:num_pixels], first, *others)


def _filled(start: int, chunk: int, array: np.ndarray) -> jax.Array:
    """A chunk of an array, the last of its rows as often as there are too few."""
    rows = array[start : start + chunk]
    if len(rows) < chunk:
        rows = np.concatenate(
            [rows, np.broadcast_to(rows[-1:], (chunk - len(rows), *rows.shape[1:]))]
        )
    return jnp.asarray(rows)


def with_rows(rows: np.ndarray, array: np.ndarray, values: np.ndarray) -> np.ndarray:
    """An array with other values in some rows."""
    array = array.copy()
    array[rows] = values
    return array


@contextmanager
def meanwhile(function: Callable[[], Any]) -> Iterator[None]:
    """Run a function on another core beside what the context holds; its result is not wanted.

    What it compiles is there when the context ends: to compile a program keeps one core busy, for
    much of the time, and leaves the others free.
    """
    x64 = _in_double_precision()

    def run() -> None:
        with jax.enable_x64(x64):
            function()

    with ThreadPoolExecutor(1) as pool:
        running = pool.submit(run)
        yield
        running.result()


def _in_double_precision() -> bool:
    """A setting of this thread, not of others."""
    return jax.dtypes.canonicalize_dtype(np.float64) == np.float64
