"""The bar of a simulation: it moves within a block, and says what is being done."""

import io
import time

import pytest

from abi_operator.scene import progress as module
from abi_operator.scene.progress import Progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def terminal():
    return Terminal()


@pytest.fixture
def bar(monkeypatch, terminal):
    monkeypatch.setattr(module, "_INTERVAL", 0.01)
    with Progress(300, file=terminal) as bar:
        yield bar


def drawn(terminal):
    """The bar as it is when it has been drawn anew."""
    terminal.seek(0)
    terminal.truncate()
    while terminal.getvalue().count("\r") < 3:
        time.sleep(0.01)
    return terminal.getvalue().split("\r")[2]


def test_it_moves_within_a_block_and_ends_with_it(bar, terminal):
    bar.begin(200, programs=2)
    shown = []
    for columns in (64, 64, 72, 100, 200):
        bar.solved(columns)
        shown.append(bar._bar.n)
    assert shown == [32, 64, 100, 150, 200]
    assert " 200/300 " in drawn(terminal)
    bar.end()
    bar.begin(100, programs=0)  # of columns that nobody solves
    assert bar._bar.n == 200
    bar.end()
    assert bar._bar.n == 300


def test_it_says_that_it_compiles(bar, terminal):
    bar.compiling(True)
    bar.compiling(True)
    bar.compiling(False)
    assert drawn(terminal).startswith("compiling: ")
    bar.compiling(False)
    assert "compiling" not in drawn(terminal)


def test_where_no_terminal_looks_on_nothing_is_shown():
    file = io.StringIO()
    with Progress(10, file=file) as bar:
        bar.begin(10, programs=1)
        bar.solved(10)
        bar.end()
    assert file.getvalue() == "" and not bar._thread.is_alive()
