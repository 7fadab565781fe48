"""Columns with values, in chunks of a few sizes and on every core.

XLA compiles a program for one number of columns and runs it on one core. Where columns can be read
(not under `jax.jit`), they are cut into chunks of one of a program's `widths`, as they lie in
memory. So a program is compiled for these sizes and for no other number of columns, whatever comes;
and nothing has to be set before JAX starts. The last chunk of a size begins where it must to end
with the last column: some columns are solved twice, but none is copied. They are taken of the later
chunk, whichever is done first: a column may differ by what is solved beside it, to rounding and
within what the solver may skip, but not from one call to an equal one. Fewer columns than the
smallest chunk has are filled up with copies.

On a CPU threads take one chunk after the other. Values are waited for. Slopes are not where there
is a chunk for each core at most (`begin_chunks`): they are JAX's own results then, of programs that
may still run. To put these together takes one more small program for every number of columns, which
values do without.

On another device, where to compile takes longer still, all chunks are begun at once, nothing is
waited for, and what comes of them is put together there: it holds the arguments and the results of
all columns, and of one chunk what the solver needs.

How they are compiled is settled in `compiler`.
"""

import gc
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from threading import Lock
from typing import Any

import jax
import numpy as np
from jaxtyping import Array

from .backend import on_cpu
from .cutting import as_it_lies, counts_of, cut, first_of_each, part_of
from .lanes import lanes, parted, threads
from .listening import compiling, is_heard, tell_solved
from .processor import usable_cores
from .slopes import assembled

_ALIGNMENT = 64  # bytes

# What has been compiled: of several threads with a new program each would compile it.
_compiled: set[Any] = set()


def forget_compiled() -> None:
    """JAX has thrown programs away: each is compiled by one thread again, before others call it."""
    _compiled.clear()


def can_be_cut(arrays: Sequence[Any]) -> bool:
    """Whether columns lie on one device, and nobody settles what runs where."""
    settled = (
        jax.config.jax_default_device is not None  # pyright: ignore[reportAttributeAccessIssue]
        or not jax.sharding.get_abstract_mesh().empty
        or jax.process_count() > 1
    )
    return not settled and all(len(x.devices()) == 1 for x in arrays if isinstance(x, jax.Array))


def map_chunks(
    function: Callable[[list[Array]], Any],
    key: Any,
    arrays: Sequence[Any],
    own: Sequence[bool],
    batch: tuple[int, ...],
    widths: Sequence[int],
) -> Any:
    """Apply a compiled, batch-first `function` whose columns do not mix to chunks of columns.

    Parameters
    ----------
    function
        Of a list of arrays with the columns of a chunk on the first axis, or one for all where the
        columns share it, to a pytree of arrays with the columns on the first axis.
    key
        What the function is compiled for, beside the shapes.
    arrays
        What it is applied to.
    own
        Which of them have an entry for each column.
    batch
        Shape that the batch has outside; one column or more.
    widths
        Numbers of columns of a chunk that it may be compiled for, rising.

    Returns
    -------
    The results of all columns, in one array each, with the batch in its shape: the function's own
    where there is one chunk of just these columns, else NumPy's, which JAX takes without a copy; on
    another device than a CPU JAX's.
    """
    columns = _Columns(function, key, arrays, own, math.prod(batch))
    if not on_cpu():
        return _put_together(*_begun_elsewhere(columns, widths), batch)
    chunks = cut(columns.size, widths, usable_cores())
    whole = len(chunks) == 1 and batch == (chunks[0][1],)
    own_columns = dict(zip(chunks, counts_of(chunks, columns.size), strict=True))
    results = _Results(columns.size)

    def finish(chunk: tuple[int, int], found: Any) -> Any:
        jax.block_until_ready(found)
        tell_solved(own_columns[chunk])
        return found if whole else results.put(chunk[0], own_columns[chunk], found)

    def solve(chunk: tuple[int, int]) -> Any:
        return finish(chunk, columns.begin(chunk[1], columns.of(*chunk)))

    if len(chunks) <= len(lanes()):
        begun = _on_lanes(columns, chunks, columns.of)
        found = [finish(*pair) for pair in zip(chunks, begun, strict=True)]
    else:
        new = [c for c in first_of_each(chunks) if not columns.known(c[1])]
        found = [threads().submit(solve, c).result() for c in new]
        found += threads().map(solve, [c for c in chunks if c not in new])
    return found[0] if whole else results.shaped(batch)


def begin_chunks(
    function: Callable[[list[Array]], Any],
    key: Any,
    arrays: Sequence[Any],
    own: Sequence[bool],
    batch: tuple[int, ...],
    widths: Sequence[int],
) -> tuple[tuple[int, ...], list[Any]] | None:
    """Begin what `map_chunks` does, without waiting; None where cores have several chunks each.

    On a CPU columns are copied: JAX reads NumPy's arrays in their place, and what the caller writes
    there while chunks are solved is none of their business.

    Returns
    -------
    Number of columns that are to be taken of each chunk, from its first on, and the results of the
    chunks, which may still be computed.
    """
    columns = _Columns(function, key, arrays, own, math.prod(batch))
    if not on_cpu():
        return _begun_elsewhere(columns, widths)
    chunks = cut(columns.size, widths, usable_cores())
    if len(chunks) > len(lanes()):
        return None
    found = _on_lanes(columns, chunks, lambda *chunk: _copied(columns.of(*chunk)))
    return counts_of(chunks, columns.size), found


def _begun_elsewhere(
    columns: "_Columns", widths: Sequence[int]
) -> tuple[tuple[int, ...], list[Any]]:
    """What `begin_chunks` gives, on another device than a CPU."""
    chunks = cut(columns.size, widths, 1)
    counts = counts_of(chunks, columns.size)

    def begin() -> list[Any]:
        found = [columns.begin(width, columns.of(start, width)) for start, width in chunks]
        if is_heard():
            for part, count in zip(found, counts, strict=True):
                jax.block_until_ready(part)
                tell_solved(count)
        return found

    return counts, lanes()[0].submit(begin).result()  # not in this thread: see `_on_lanes`


def _put_together(counts: tuple[int, ...], found: list[Any], batch: tuple[int, ...]) -> Any:
    """Results of all columns, on the device."""
    parts = [jax.tree.leaves(x) for x in found]
    rows = [assembled(list(x), counts, batch) for x in zip(*parts, strict=True)]
    return jax.tree.unflatten(jax.tree.structure(found[0]), rows)


def _on_lanes(
    columns: "_Columns",
    chunks: Sequence[tuple[int, int]],
    given: Callable[[int, int], list[np.ndarray]],
) -> list[Any]:
    """Results of a chunk for each core at most, which may still be computed.

    Never begun in this thread: what it is in the middle of, such as a `jax.vmap` of derivatives,
    would be part of what JAX knows a compiled program by.
    """
    begun: list[Any] = []
    with parted():
        for lane, chunk in zip(lanes(), chunks, strict=False):
            known = columns.known(chunk[1])
            begun.append(lane.submit(columns.begin, chunk[1], given(*chunk)))
            if not known:
                begun[-1].result()  # compiled once, for so few chunks have one width
        return [x.result() for x in begun]


class _Columns:
    """Columns in memory, chunks of which a compiled function is called with."""

    def __init__(
        self,
        function: Callable[..., Any],
        key: Any,
        arrays: Sequence[Any],
        own: Sequence[bool],
        size: int,
    ) -> None:
        self._function, self._own, self.size = function, own, size
        self._arrays = [as_it_lies(x) for x in arrays]
        shapes = tuple(x.shape[each:] for x, each in zip(self._arrays, own, strict=True))
        self._x64 = jax.dtypes.canonicalize_dtype(np.float64) == np.float64
        self._device = jax.local_devices()[0]
        self._key = key, shapes, self._x64

    def known(self, width: int) -> bool:
        """Whether the function has been compiled for so many."""
        return (*self._key, width) in _compiled

    def of(self, start: int, width: int) -> list[Any]:
        """Arrays of so many columns; those after the last are copies of it."""
        pairs = zip(self._arrays, self._own, strict=True)
        return [part_of(x, start, width) if each else x for x, each in pairs]

    def begin(self, width: int, some: list[Any]) -> Any:
        """Call the function with arrays of so many columns."""
        known = self.known(width)
        # Settings of the caller's thread, not of this one.
        settings = jax.enable_x64(self._x64), jax.default_device(self._device)
        with settings[0], settings[1], nullcontext() if known else _first_call():
            found = self._function(some)
        if not known:
            _compiled.add((*self._key, width))
        return found


@contextmanager
def _first_call() -> Iterator[None]:
    """A call that compiles, or reads a program from the disk."""
    with compiling(), _no_search_for_garbage():
        yield


@contextmanager
def _no_search_for_garbage() -> Iterator[None]:
    """Tracing makes many small objects that stay; to search for others takes part of its time."""
    searching = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if searching:
            gc.enable()


class _Results:
    """Arrays of all columns, into which each chunk is copied by the thread that has solved it."""

    def __init__(self, size: int) -> None:
        self._size, self._lock = size, Lock()
        self._arrays: list[np.ndarray] = []
        self._structure: Any = None

    def put(self, start: int, count: int, found: Any) -> None:
        parts, structure = jax.tree.flatten(found)
        with self._lock:
            if self._structure is None:
                self._arrays = [_aligned((self._size, *x.shape[1:]), x.dtype) for x in parts]
                self._structure = structure
        for array, part in zip(self._arrays, parts, strict=True):
            array[start : start + count] = np.asarray(part)[:count]

    def shaped(self, batch: tuple[int, ...]) -> Any:
        arrays = [x.reshape((*batch, *x.shape[1:])) for x in self._arrays]
        return jax.tree.unflatten(self._structure, arrays)


def _copied(arrays: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Copies that JAX takes as they are, in one piece of memory, which takes half the time."""
    places, first = [], 0
    for x in arrays:
        places.append(slice(first, first + x.nbytes))
        first += -(-x.nbytes // _ALIGNMENT) * _ALIGNMENT
    memory = _aligned((first,), np.dtype(np.uint8))
    pairs = zip(arrays, places, strict=True)
    copies = [memory[place].view(x.dtype).reshape(x.shape) for x, place in pairs]
    for own, x in zip(copies, arrays, strict=True):
        own[...] = x
    return copies


def _aligned(shape: tuple[int, ...], dtype: Any) -> np.ndarray:
    """An array that JAX takes as it is, which one is that begins where XLA's own do."""
    count = math.prod(shape) * dtype.itemsize
    memory = np.empty(count + _ALIGNMENT, np.uint8)
    first = -memory.ctypes.data % _ALIGNMENT
    return memory[first : first + count].view(dtype).reshape(shape)
