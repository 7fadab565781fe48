"""Who wants to know how far columns are hears it here, from whichever thread solves them."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Listener(Protocol):
    """Whoever wants to know; any thread may tell."""

    def compiling(self, begins: bool) -> None:
        """A program begins to be compiled, or to be read from the disk, or has been."""
        ...

    def solved(self, columns: int) -> None:
        """So many columns more have been solved."""
        ...


_listener: Listener | None = None


@contextmanager
def listening(listener: Listener | None) -> Iterator[None]:
    """Tell someone of all that is compiled and solved in this block."""
    global _listener
    before, _listener = _listener, listener
    try:
        yield
    finally:
        _listener = before


def is_heard() -> bool:
    """Whether anybody wants to know."""
    return _listener is not None


def tell_solved(columns: int) -> None:
    """So many columns more have been solved."""
    if _listener is not None:
        _listener.solved(columns)


@contextmanager
def compiling() -> Iterator[None]:
    """In this block a program is compiled."""
    listener = _listener
    if listener is not None:
        listener.compiling(True)
    try:
        yield
    finally:
        if listener is not None:
            listener.compiling(False)
