"""Simulate a scene that need not fit into memory: time by time, block of rows by block of rows."""

from collections.abc import Callable

import numpy as np
import xarray as xr

from ..files import Parts
from ..radiance import THERMAL
from ..settings import NUM_STREAMS
from .account import COUNTED_OVER, Attribute, add_accounts
from .progress import Progress
from .simulate import ERROR_BUDGET, simulate

ReadBlock = Callable[[int, slice], xr.Dataset]
WriteBlock = Callable[[int, slice, xr.Dataset], None]


def row_blocks(shape: tuple[int, int], block_columns: int) -> list[slice]:
    """Slices of rows that together are all rows of a scene, in blocks of so many columns or fewer.

    Parameters
    ----------
    shape
        Numbers of rows and columns of the scene. [-]
    block_columns
        Atmospheric columns in memory at a time; a block has one row at least. [-]
    """
    num_rows = max(1, block_columns // shape[1])
    return [slice(y, min(y + num_rows, shape[0])) for y in range(0, shape[0], num_rows)]


def run(
    read_block: ReadBlock,
    times: np.ndarray,
    shape: tuple[int, int],
    write_block: WriteBlock,
    *,
    num_streams: float = NUM_STREAMS,
    error_budget: float | None = ERROR_BUDGET,
    block_columns: int = 16384,
    progress: bool = True,
    parts: Parts | None = None,
) -> dict[str, Attribute]:
    """Simulate all times of a scene with one block of rows in memory.

    Parameters
    ----------
    read_block
        Returns the scenario of a block, given the index of the time and the rows.
    times
        Times of the scene.
    shape
        Numbers of rows and columns of the scene. [-]
    write_block
        Takes the index of the time, the rows and the block's result.
    num_streams, error_budget
        As in `simulate`.
    block_columns
        Atmospheric columns in memory at a time. [-]
    progress
        Whether to show how many columns are done, where a terminal looks on.
    parts
        Where blocks that are solved are kept, and found where an earlier run has solved them. None
        are of a scene of one block.

    Returns
    -------
    Attributes that account for the whole scene (`add_accounts`). Of several times counts are sums,
    and ``counted_over`` says so.
    """
    account: dict[str, Attribute] = {}
    total = len(times) * shape[0] * shape[1]
    blocks = row_blocks(shape, block_columns)
    if len(times) * len(blocks) == 1:
        parts = None
    with Progress(total, show=progress) as bar:
        for time_index in range(len(times)):
            for rows in blocks:
                block = read_block(time_index, rows)
                thermal = np.isin(block["band"].values, list(THERMAL))
                programs = int(thermal.sum()) + bool((~thermal).any())
                bar.begin(block.sizes["y"] * block.sizes["x"], programs)
                result = simulate(
                    block,
                    num_streams=num_streams,
                    error_budget=error_budget,
                    listener=bar,
                    parts=parts,
                )
                write_block(time_index, rows, result)
                account = add_accounts([account, result.attrs])
                bar.end()
    if len(times) > 1:
        account[COUNTED_OVER] = f"{len(times)} times, of which all that ends in _count is the sum"
    return account
