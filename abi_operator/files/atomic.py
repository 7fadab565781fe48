"""Output that is there whole or not at all."""

import errno
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from .._ending import undisturbed, unfinished
from .abandoned import MARK, marked, remove_abandoned
from .errors import InputError

# What says that nothing more can be written; the NetCDF library names no such reason.
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
_NETCDF = "NetCDF: "


@contextmanager
def output_folder(path: str | PathLike[str], *, outdated: Iterable[str] = ()) -> Iterator[Path]:
    """Yield a temporary folder, the files of which move into `path` when the block succeeds.

    The temporary folder lies beside `path` (in it where there is no place beside it), on the same
    file system, so that moving is renaming.
    Whatever ends the block early, a keyboard interrupt too, deletes it and leaves `path` as it was.
    What a process that was killed has left there, the next one that writes to `path` deletes.

    Parameters
    ----------
    path
        Folder for the output, made with its parents if need be; files of the same name in it are
        replaced, others stay.
    outdated
        Names of files in `path` that go where they are not replaced.

    Raises
    ------
    InputError
        Where the output cannot be written, or there is no room for it.
    """
    target = Path(path).absolute()
    existing = next(folder for folder in (target, *target.parents) if folder.exists())
    if not existing.is_dir():
        raise InputError(f"{existing} is a file where a folder is needed; give another folder.")
    inside = os.path.ismount(target) or not os.access(target.parent, os.W_OK)
    beside = existing if existing != target or inside else target.parent
    remove_abandoned(target.name, (beside, target, target.parent))
    try:
        temporary = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=beside))
    except OSError as error:
        raise InputError(
            f"{beside} cannot be written to ({error.strerror}); give another folder."
        ) from error
    with unfinished(temporary):
        try:
            with marked(temporary):
                yield temporary
                with undisturbed():
                    _move_files(temporary, target, outdated)
        except (OSError, RuntimeError) as error:
            reason = _no_room(error)
            if reason is None:
                raise
            raise InputError(_full(target, temporary, reason)) from error
        finally:
            shutil.rmtree(temporary, ignore_errors=True)


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
        f"{free:.1f} MB free there; make room, or give a folder on another disk."
    )


def _move_files(source: Path, target: Path, outdated: Iterable[str]) -> None:
    """Move every file below `source` to the same place below `target`, and remove the outdated."""
    files = sorted(file.relative_to(source) for file in source.rglob("*") if file.is_file())
    files = [file for file in files if file.name != MARK]
    for file in files:
        if (target / file).is_dir():
            raise InputError(f"{target / file} is a folder where a file is to be; move it away.")
    try:
        for file in files:
            (target / file).parent.mkdir(parents=True, exist_ok=True)
            os.replace(source / file, target / file)
        target.mkdir(parents=True, exist_ok=True)
        for name in set(outdated) - {str(file) for file in files}:
            (target / name).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(
            f"{target} cannot be written to ({error.strerror}); give another folder."
        ) from error
