"""What a long run has computed so far, kept in its unfinished folder for a run that does the same.

A part is known by a name that tells all that it depends on (a digest), and is there whole or not at
all. Which runs find it is settled by `output_folder`.
"""

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from .abandoned import PARTS, WHOLE

# Checksums guard what is in an archive, but not that all of it is there.
_NAMES = "names_of_arrays"


class Parts:
    """Parts of a run, each some arrays by name.

    Parameters
    ----------
    folder
        That of `output_folder`, which ``keeps_parts``.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder / PARTS
        self.num_found = 0

    def find(self, name: str) -> dict[str, np.ndarray] | None:
        """A part that was kept before; None where there is none, or it cannot be read.

        What is not an array of numbers or letters, and would run code as it is read, is not read.
        """
        try:
            with self._path(name).open("rb") as file, np.load(file) as arrays:
                found = dict(arrays)
                names = found.pop(_NAMES).tolist()
        except Exception:  # of a damaged archive also what it would need: a password, a method
            return None
        if names != list(found):
            return None
        self.num_found += 1
        return found

    def keep(self, name: str, arrays: Mapping[str, np.ndarray]) -> None:
        """Keep a part; `OSError` where there is no room for it."""
        self._folder.mkdir(exist_ok=True)
        path = self._path(name)
        unfinished = path.with_suffix(".unfinished")
        with unfinished.open("wb") as file:
            # Before NumPy 2.2 `allow_pickle` would be one of the arrays.
            np.savez(file, **arrays, **{_NAMES: np.array(list(arrays), str)})  # pyright: ignore[reportArgumentType]
        os.replace(unfinished, path)

    def _path(self, name: str) -> Path:
        return self._folder / f"{name}{WHOLE}"
