"""Columns in chunks of one size, so that one program is compiled for all of them."""

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import numpy as np

Columns = TypeVar("Columns")


def map_chunks(
    function: Callable[[Columns], Any], columns: Columns, num_columns: int, chunk_columns: int
) -> Any:
    """Apply a function to chunks of columns and put its results together.

    Parameters
    ----------
    function
        Maps a pytree of arrays with a leading column axis to another.
    columns
        The arrays of all columns; one column or more.
    num_columns
        How many there are. [-]
    chunk_columns
        Columns that are passed together; the last chunk is filled up with copies of the last
        column, the results of which are dropped. [-]

    Returns
    -------
    What `function` returns, as NumPy arrays of all columns.
    """
    chunks = []
    for start in range(0, num_columns, chunk_columns):
        index = np.minimum(np.arange(start, start + chunk_columns), num_columns - 1)
        result = function(jax.tree.map(lambda x, index=index: x[index], columns))
        kept = min(chunk_columns, num_columns - start)
        chunks.append(jax.tree.map(lambda x, kept=kept: np.asarray(x)[:kept], result))
    return jax.tree.map(lambda *parts: np.concatenate(parts), *chunks)
