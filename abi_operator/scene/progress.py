"""How far a simulation is: on a terminal, a bar that moves every second or says why it does not."""

import sys
from threading import Event, Lock, Thread
from typing import Self, TextIO

from tqdm import tqdm

# How often the bar is drawn. [s]
_INTERVAL = 1.0


class Progress:
    """A bar of columns, drawn by a thread of its own; no bar where no terminal looks on.

    A context manager, and a `machine.listening.Listener`: it is told of columns as they are solved,
    by as many programs as a block takes, so that it moves in blocks that take minutes.

    Parameters
    ----------
    total
        Columns of all blocks. [-]
    show
        Whether to show anything.
    file
        Where to.
    """

    def __init__(self, total: int, *, show: bool = True, file: TextIO | None = None) -> None:
        disable = None if show else True
        file = sys.stderr if file is None else file
        self._bar = tqdm(total=total, unit="columns", disable=disable, file=file)
        self._lock, self._ended = Lock(), Event()
        self._before, self._columns, self._solves, self._solved = 0, 0, 1, 0
        self._compiling = 0
        self._thread = Thread(target=self._draw, name="abi-operator-progress", daemon=True)

    def __enter__(self) -> Self:
        if not self._bar.disable:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        if not self._bar.disable:
            self._thread.join()
        self._bar.close()

    def begin(self, columns: int, programs: int) -> None:
        """A block begins, of so many columns that so many programs solve one after the other."""
        with self._lock:
            self._columns, self._solves, self._solved = columns, columns * max(programs, 1), 0

    def end(self) -> None:
        """The block has been written, with all its columns, also those that nobody solves."""
        with self._lock:
            self._before += self._columns
            self._columns = 0
            self._move()

    def solved(self, columns: int) -> None:
        """So many columns more have been solved by one of the programs."""
        with self._lock:
            self._solved = min(self._solved + columns, self._solves)
            self._move()

    def compiling(self, begins: bool) -> None:
        """A program begins to be compiled, or has been."""
        with self._lock:
            self._compiling += 1 if begins else -1
            self._bar.set_description_str("compiling" if self._compiling else "", refresh=False)

    def _move(self) -> None:
        self._bar.n = self._before + self._columns * self._solved // max(self._solves, 1)

    def _draw(self) -> None:
        while not self._ended.wait(_INTERVAL):
            self._bar.refresh()
