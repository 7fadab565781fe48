"""Output that is there whole or not at all."""

import errno
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from os import PathLike
from pathlib import Path

from .._ending import undisturbed, unfinished
from .abandoned import MARK, PARTS, alone, num_parts, own_folder, remove
from .errors import InputError

# What says that nothing more can be written; the NetCDF library names no such reason.
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
_NETCDF = "NetCDF: "
# With an input that is wrong the same command would only end there again.
_MENDED = "a run in which this is mended goes on"


@contextmanager
def output_folder(
    path: str | PathLike[str],
    *,
    outdated: Callable[[], Iterable[str]] = tuple,
    keeps_parts: bool = False,
) -> Iterator[Path]:
    """Yield a temporary folder, the files of which move into `path` when the block succeeds.

    The temporary folder lies beside `path` (in it where there is no place beside it), on the same
    file system, so that moving is renaming; of several runs one moves after the other.
    Whatever ends the block early, a keyboard interrupt too, deletes it and leaves `path` as it was.
    What a process that was killed has left there, the next one that writes to `path` deletes; where
    it was killed as files moved, some of them have moved, and the next one replaces them.
    Of a block that keeps `Parts` these stay where it ends early, until it ends well.

    Parameters
    ----------
    path
        Folder for the output, made with its parents if need be, or a link to one; files of the same
        name in it are replaced, others stay.
    outdated
        Gives names of files in `path` that go where they are not replaced, when all is ready to be
        moved: another run may just have put them there.
    keeps_parts
        Whether the block keeps `Parts` in the folder.

    Raises
    ------
    InputError
        Where the output cannot be written, or there is no room for it.
    """
    target = Path(path).resolve()  # a link may lead to another file system
    existing = _existing(target)
    inside = os.path.ismount(target) or not os.access(target.parent, os.W_OK)
    beside = existing if existing != target or inside else target.parent
    places = {beside, *(place for place in (target, target.parent) if place.is_dir())}
    with ExitStack() as stack:
        with _writable(existing):
            own = own_folder(target.name, beside, places, keeps_parts=keeps_parts)
            temporary = stack.enter_context(own)
        stack.enter_context(unfinished(temporary, _clear))
        whole = False
        try:
            yield temporary
            with undisturbed(), _writable(target):
                _put_in_place(temporary, target, outdated)
            whole = True
        except InputError as error:
            if not num_parts(temporary):
                raise
            raise InputError(f"{str(error).rstrip('.')}{_kept(temporary, _MENDED)}.") from error
        except (OSError, RuntimeError) as error:
            reason = _no_room(error)
            if reason is None:
                raise
            raise InputError(_full(target, temporary, reason)) from error
        finally:
            with suppress(OSError):
                remove(temporary, but_parts=not whole)


def check_output_folder(path: str | PathLike[str]) -> None:
    """Raise `InputError` where an `output_folder` cannot be written, before it is needed."""
    with _writable(_existing(Path(path).resolve())):
        pass


def _existing(target: Path) -> Path:
    """The folder, or the nearest of those above it that is there."""
    existing = next(folder for folder in (target, *target.parents) if folder.exists())
    if not existing.is_dir():
        raise InputError(f"{existing} is a file where a folder is needed; give another folder.")
    return existing


def _clear(folder: Path) -> str:
    """Remove all but parts, and say where these are."""
    remove(folder, but_parts=True)
    return _kept(folder)


def _kept(folder: Path, next_run: str = "the same command goes on") -> str:
    """Where parts are, if there are some, and what makes use of them."""
    kept = num_parts(folder)
    return f"; what was simulated is kept in {folder}, and {next_run}" if kept else ""


@contextmanager
def _writable(folder: Path) -> Iterator[None]:
    """Say so where a folder, or what is to be made in it, cannot be written."""
    try:
        if folder.is_dir():
            tempfile.TemporaryFile(dir=folder).close()
        yield
    except OSError as error:
        raise InputError(
            f"{folder} cannot be written to ({error.strerror}); give another folder."
        ) from error


def _no_room(error: OSError | RuntimeError) -> str | None:
    """Why nothing more could be written, where that is what is wrong."""
    if isinstance(error, OSError):
        return error.strerror if error.errno in _NO_ROOM else None
    return str(error) if str(error).startswith(_NETCDF) else None


def _full(target: Path, temporary: Path, reason: str) -> str:
    """The sentence for a disk that is full, or a file that may not be larger."""
    written = sum(file.stat().st_size for file in temporary.rglob("*") if file.is_file()) / 1e6
    free = shutil.disk_usage(temporary).free / 1e6
    return (
        f"the output for {target} cannot be written ({reason}) after {written:.1f} MB, with "
        f"{free:.1f} MB free there; make room, or give a folder on another disk{_kept(temporary)}."
    )


def _put_in_place(source: Path, target: Path, outdated: Callable[[], Iterable[str]]) -> None:
    """Move every file below `source` to the same place below `target`, and remove the outdated.

    The last file comes last of all: it is the result, which tells what else there is.
    """
    files = sorted(file.relative_to(source) for file in source.rglob("*") if file.is_file())
    files = [file for file in files if file.parts[0] not in (MARK, PARTS)]
    target.mkdir(parents=True, exist_ok=True)
    with alone(target):
        for file in files:
            if (target / file).is_dir():
                raise InputError(
                    f"{target / file} is a folder where a file is to be; move it away."
                )
        gone = set(outdated()) - {str(file) for file in files}
        for file in files[:-1]:
            _move(source, target, file)
        for name in gone:
            (target / name).unlink(missing_ok=True)
        for file in files[-1:]:
            _move(source, target, file)


def _move(source: Path, target: Path, file: Path) -> None:
    (target / file).parent.mkdir(parents=True, exist_ok=True)
    os.replace(source / file, target / file)
