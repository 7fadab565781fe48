"""How a process of our own ends where it is told to: soon, in one line, with nothing left behind.

Python hears of a signal in its main thread alone, and there between two instructions, not while a
program is compiled, which is most of a short run. And where Python ends while another thread
compiles, it waits for that, or crashes. So a thread of its own waits for the numbers of signals
(`signal.set_wakeup_fd`), removes what is unfinished, says why, and ends the process as it stands.
The main thread stops where the signal reaches it, and writes no more.

This module is imported before all others of the package, and where the process is our command
(`_is_our_command`) it is in force before JAX is imported, which takes a second. Elsewhere nothing
is done on import: signals are the business of whoever imports us.
"""

import os
import shutil
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path
from threading import Lock, Thread, current_thread, main_thread
from typing import Any

_WORDS = {"SIGINT": "interrupted", "SIGTERM": "terminated", "SIGHUP": "its terminal has gone"}

# How long another thread may go on to write into what is to be removed. [s]
_PATIENCE = 5.0

_unfinished: dict[Path, Callable[[Path], str] | None] = {}
_putting_in_place = Lock()
_told = False
_watching = False


@contextmanager
def unfinished(path: Path, clear: Callable[[Path], str] | None = None) -> Iterator[None]:
    """A file or folder that is to be removed where the process ends in this block.

    Parameters
    ----------
    path
        Which.
    clear
        Removes it, or all but what is to stay, of which it tells in words to end a sentence with;
        `OSError` where it is to be called again.
    """
    _unfinished[path] = clear
    try:
        yield
    finally:
        _unfinished.pop(path, None)


@contextmanager
def undisturbed() -> Iterator[None]:
    """The process does not end in this block, which is short and must be done whole."""
    with _putting_in_place:
        yield
    if _told:
        _stand_still()


def end_at_signals() -> None:
    """From now on end this process as this module says; signals that are ignored stay ignored."""
    global _watching
    if _watching or current_thread() is not main_thread():
        return
    names = [name for name in _WORDS if hasattr(signal, name)]  # Windows has no SIGHUP
    numbers = {int(getattr(signal, name)): name for name in names}
    heard = [n for n in numbers if signal.getsignal(n) not in (signal.SIG_IGN, None)]
    inner, outer = socket.socketpair()
    inner.setblocking(False)
    Thread(
        target=_watch, args=(outer, inner, numbers), name="abi-operator-end", daemon=True
    ).start()
    signal.set_wakeup_fd(inner.fileno(), warn_on_full_buffer=False)
    for number in heard:
        signal.signal(number, _hear)
    _watching = True


def _watch(outer: socket.socket, inner: socket.socket, numbers: dict[int, str]) -> None:
    """Wait for one of the signals; `inner` is kept open, too."""
    name = None
    while name is None:
        name = numbers.get(outer.recv(1)[0])
    with _putting_in_place:
        line = f"abi-operator: {_WORDS[name]}{_remove_unfinished()}.\n"
        with suppress(OSError):
            os.write(2, (b"\n" if os.isatty(2) else b"") + line.encode())  # behind a progress bar
        os._exit(128 + int(getattr(signal, name)))


def _remove_unfinished() -> str:
    """Remove it, again where something was being written, and say so."""
    paths, end, kept = dict(_unfinished), time.monotonic() + _PATIENCE, ""
    for path, clear in paths.items():
        while os.path.lexists(path):
            with suppress(OSError):
                if clear is not None and (stays := clear(path)):
                    kept += stays
                    break
                if clear is None:
                    path.unlink() if path.is_file() else shutil.rmtree(path)
            if time.monotonic() > end:
                return f"; {path} could not be removed"
    return "; what was unfinished has been removed" + kept if paths else ""


def _hear(number: int, frame: Any) -> None:
    """What the main thread does at a signal."""
    global _told
    _told = True
    if not _putting_in_place.locked():
        _stand_still()


def _stand_still() -> None:
    while True:
        time.sleep(60)


def _is_our_command() -> bool:
    """Whether this process is ``abi-operator`` or ``python -m abi_operator``."""
    package = __name__.partition(".")[0]
    first = Path(next(iter(getattr(sys, "argv", [])), "")).name
    if first == "-m":  # Python has not yet found what it is to run
        words = sys.orig_argv
        return f"-m{package}" in words or ("-m", package) in pairwise(words)
    return first in ("abi-operator", "abi-operator.exe")


if _is_our_command():
    end_at_signals()
