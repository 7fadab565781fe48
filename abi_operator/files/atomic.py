"""Output that is there whole or not at all."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from .errors import InputError


@contextmanager
def output_folder(path: str | PathLike[str]) -> Iterator[Path]:
    """Yield a temporary folder, the files of which move into `path` when the block succeeds.

    The temporary folder lies beside `path` (in it where there is no place beside it), on the same
    file system, so that moving is renaming.
    Whatever ends the block early, a keyboard interrupt too, deletes it and leaves `path` as it was.

    Parameters
    ----------
    path
        Folder for the output, made with its parents if need be; files of the same name in it are
        replaced, others stay.
    """
    target = Path(path).absolute()
    existing = next(folder for folder in (target, *target.parents) if folder.exists())
    if not existing.is_dir():
        raise InputError(f"{existing} is a file where a folder is needed; give another folder.")
    inside = os.path.ismount(target) or not os.access(target.parent, os.W_OK)
    beside = existing if existing != target or inside else target.parent
    try:
        temporary = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=beside))
    except OSError as error:
        raise InputError(
            f"{beside} cannot be written to ({error.strerror}); give another folder."
        ) from error
    try:
        yield temporary
        _move_files(temporary, target)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _move_files(source: Path, target: Path) -> None:
    """Move every file below `source` to the same place below `target`."""
    files = sorted(file.relative_to(source) for file in source.rglob("*") if file.is_file())
    for file in files:
        if (target / file).is_dir():
            raise InputError(f"{target / file} is a folder where a file is to be; move it away.")
    try:
        for file in files:
            (target / file).parent.mkdir(parents=True, exist_ok=True)
            os.replace(source / file, target / file)
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{target} cannot be written to ({error.strerror}); give another folder."
        ) from error
