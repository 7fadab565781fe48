"""Unfinished folders of runs that have ended, told from those of runs that are still alive.

A run holds a lock on a file in its folder, which the system lets go when the process has ended, in
whatever way. A folder without that file is none of ours, unless a run ended as it made or removed
it, and it is empty; and where file systems have no locks nothing but such is ever removed.

In its folder a run may keep parts of what it has computed (`parts`). Of a run that has ended early
the folder stays with these, and the next one that keeps parts goes on in it (`own_folder`).
"""

import glob
import os
import shutil
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

MARK = ".abi-operator-unfinished"
PARTS = ".abi-operator-parts"
WHOLE = ".npz"
"""Ending of the names of parts that have been written to their ends."""

# How `tempfile` ends a name, and when an empty folder is not one that a run has just made. [s]
_RANDOM = "?" * 8
_LONG_AGO = 86400.0


@contextmanager
def own_folder(
    name: str, beside: Path, places: Iterable[Path], *, keeps_parts: bool = False
) -> Iterator[Path]:
    """A folder of this run alone, which is marked as long as this block, and this process, is.

    What runs that have ended left of a folder `name` is removed. Parts that they have kept stay
    where this run keeps none; one that does is given the folder that has most of them.

    Parameters
    ----------
    name, beside
        What the folder is for, and where to make it.
    places
        Where others may have been made for the same.
    keeps_parts
        Whether this run looks for parts, and keeps some.
    """
    found = _abandoned(name, places, keeps_parts)
    kept = [each for each in found if num_parts(each[0])]
    taken = max(kept, key=lambda each: num_parts(each[0])) if keeps_parts and kept else None
    try:
        for folder, _ in found:
            with suppress(OSError):
                remove(folder, but_parts=taken is not None and folder == taken[0])
        folder, lock = taken or _new(name, beside)
    finally:
        for each in found:
            if each is not taken:
                os.close(each[1])
    try:
        yield folder
    finally:
        if lock is not None:
            os.close(lock)


def remove(folder: Path, *, but_parts: bool = False) -> None:
    """Remove a run's folder, or all in it but its parts, if it has any.

    The mark goes last: where this ends early the next run goes on with it.
    """
    spared = but_parts and num_parts(folder) > 0
    for path in folder.iterdir():
        if path.name == MARK or (spared and path.name == PARTS):
            continue
        shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
    if spared:
        for path in (folder / PARTS).iterdir():
            if path.suffix != WHOLE:
                path.unlink()
        return
    (folder / MARK).unlink(missing_ok=True)
    folder.rmdir()


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """In this block no other run puts files in place in a folder, where the system has locks."""
    file = os.open(folder, os.O_RDONLY) if fcntl is not None else None
    try:
        if fcntl is not None and file is not None:
            with suppress(OSError):
                fcntl.flock(file, fcntl.LOCK_EX)
        yield
    finally:
        if file is not None:
            os.close(file)


def num_parts(folder: Path) -> int:
    """How many parts a run has kept in its folder."""
    return len(list(folder.glob(f"{PARTS}/*{WHOLE}")))


def _new(name: str, beside: Path) -> tuple[Path, int | None]:
    """A new folder, and the lock on its mark, if the system has locks.

    The mark is there only when it is locked, so that nobody takes it for an abandoned one.
    """
    folder = Path(tempfile.mkdtemp(prefix=f".{name}-", dir=beside))
    mark = folder / MARK
    unlocked = mark.with_suffix(".new")
    file = os.open(unlocked, os.O_RDWR | os.O_CREAT, 0o600)
    if _lock(file):
        unlocked.rename(mark)
        return folder, file
    os.close(file)
    unlocked.unlink()
    return folder, None


def _abandoned(name: str, places: Iterable[Path], keeps_parts: bool) -> list[tuple[Path, int]]:
    """Folders of runs that have ended, and locks on them, so that no other run takes them.

    None that has parts where they are not to be touched. Folders that a run had made and not
    marked, or emptied and not removed, are removed here.
    """
    found = []
    pattern = f".{glob.escape(name)}-{_RANDOM}"
    for folder in sorted({path for place in places for path in place.glob(pattern)}):
        mark = folder / MARK
        with suppress(OSError):  # another's, or just removed by another run
            if not mark.exists():
                if time.time() - folder.stat().st_mtime > _LONG_AGO:
                    mark.with_suffix(".new").unlink(missing_ok=True)
                    folder.rmdir()  # which refuses one that is not empty
                continue
            if num_parts(folder) and not keeps_parts:
                continue
            file = os.open(mark, os.O_RDWR)
            if _lock(file) and mark.exists():
                found.append((folder, file))
            else:
                os.close(file)
    return found


def _lock(file: int) -> bool:
    """Lock an open file, if nobody has and the file system can."""
    if fcntl is None:
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
