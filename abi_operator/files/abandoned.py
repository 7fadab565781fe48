"""Unfinished folders of runs that have ended, told from those of runs that are still alive.

A run holds a lock on a file in its folder, which the system lets go when the process has ended, in
whatever way. A folder without that file is none of ours, and where file systems have no locks
nothing is ever removed.
"""

import glob
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

MARK = ".abi-operator-unfinished"


@contextmanager
def marked(folder: Path) -> Iterator[None]:
    """Mark a folder as that of a run which is alive as long as this block, and this process, is.

    The mark is there only when it is locked, so that nobody takes it for an abandoned one.
    """
    mark = folder / MARK
    unlocked = mark.with_suffix(".new")
    file = os.open(unlocked, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        if _lock(file):
            unlocked.rename(mark)
        else:
            unlocked.unlink()
        yield
    finally:
        os.close(file)


def remove_abandoned(name: str, places: Iterable[Path]) -> list[Path]:
    """Remove what runs that have ended left of the folder `name` in some places, and return it."""
    removed = []
    for place in set(places):
        for mark in place.glob(f".{glob.escape(name)}-*/{MARK}"):
            with suppress(OSError):  # another's, or just removed by another run
                file = os.open(mark, os.O_RDWR)
                try:
                    if _lock(file):
                        shutil.rmtree(mark.parent)
                        removed.append(mark.parent)
                finally:
                    os.close(file)
    return removed


def _lock(file: int) -> bool:
    """Lock an open file, if nobody has and the file system can."""
    if fcntl is None:
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
