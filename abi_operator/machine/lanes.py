"""Threads that begin work on XLA's threads, and how these come to a core each.

XLA runs what one thread of Python has begun one after the other, on a pool of its own of one thread
a core. Two of them that are woken at once are now and then put on the same core by Linux, which
parts them a few milliseconds later: a fifth of what a thousand columns of 4 streams take. So each
is offered a core of its own while they are woken (`parted`), and every core right afterwards: were
they kept there, a second process that does the same would leave the others idle.
"""

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from threading import Lock

from .processor import usable_cores

_POOL = "tf_XLAEigen"
_one_at_a_time = Lock()


def threads() -> ThreadPoolExecutor:
    """One thread a core, for whatever comes."""
    return _threads(os.getpid())


def lanes() -> list[ThreadPoolExecutor]:
    """The same, one by one."""
    return _lanes(os.getpid())


@cache
def _threads(_process: int) -> ThreadPoolExecutor:
    """Threads of this process: one that was forked has none of its parent's."""
    return ThreadPoolExecutor(usable_cores(), thread_name_prefix="abi-operator")


@cache
def _lanes(_process: int) -> list[ThreadPoolExecutor]:
    name = "abi-operator-lane"
    return [ThreadPoolExecutor(1, thread_name_prefix=name) for _ in range(usable_cores())]


@contextmanager
def parted() -> Iterator[None]:
    """XLA's threads on a core each, where there is one for each and nobody has settled it.

    JAX has been used by this process before.
    """
    if not _one_at_a_time.acquire(blocking=False):
        yield
        return
    moved = []
    try:
        moved = _part(_xla_threads(os.getpid()))
        yield
    finally:
        for thread, cores in moved:
            _keep(thread, cores)
        _one_at_a_time.release()


def _part(pool: tuple[int, ...]) -> list[tuple[int, set[int]]]:
    """Put threads on a core each; those that were moved, and where they may be otherwise."""
    if len(pool) < 2:
        return []
    try:
        cores = os.sched_getaffinity(0)
        if len(cores) != len(pool) or any(os.sched_getaffinity(x) != cores for x in pool):
            return []
    except OSError:  # a thread that has ended
        return []
    for thread, core in zip(pool, sorted(cores), strict=True):
        _keep(thread, {core})
    return [(thread, cores) for thread in pool]


def _keep(thread: int, cores: set[int]) -> None:
    try:
        os.sched_setaffinity(thread, cores)
    except OSError:  # it has ended, or this is forbidden
        pass


@cache
def _xla_threads(_process: int) -> tuple[int, ...]:
    """Numbers of the pool's threads, none where there is no Linux to tell them."""
    try:
        tasks = sorted(Path("/proc/self/task").iterdir())
        return tuple(int(x.name) for x in tasks if (x / "comm").read_text().strip() == _POOL)
    except OSError:
        return ()
