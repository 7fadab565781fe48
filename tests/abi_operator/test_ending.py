"""A process that is told to end does so soon, in one line, and leaves nothing behind."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from abi_operator import _ending
from abi_operator.files import Parts, output_folder

ROOT = Path(__file__).parents[2]

# Where tests run in the background SIGINT is ignored, and by their children, too.
HEARING = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"

# Takes hours in C, where Python does not look for signals, as compiling does.
BUSY = 'hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)'

COMMAND = """
import sys
sys.argv = ["abi-operator"]
import abi_operator.cli
"""

UNFINISHED = f"""
import hashlib, sys
sys.argv = ["abi-operator"]
from abi_operator.files import output_folder
with output_folder("out") as folder:
    (folder / "result.nc").write_text("half")
    print("begun", flush=True)
    {BUSY}
"""

# The same of a run that has kept a part.
KEEPING = UNFINISHED.replace('folder("out")', 'folder("out", keeps_parts=True)').replace(
    "    print", '    Parts(folder).keep("first", {})\n    print'
)
KEEPING = KEEPING.replace("import output_folder", "import Parts, output_folder")

# Several seconds of compiling, in a thread of the operator's as in a run.
COMPILING = """
import sys, threading, time
sys.argv = ["abi-operator"]
import jax
import jax.numpy as jnp
from abi_operator.machine.lanes import lanes
from abi_operator.files import output_folder

def many(x):
    for _ in range(300):
        x = jnp.sort(jnp.sin(x) + x[::-1])
    return x

with output_folder("out"):
    program = jax.jit(many).lower(jnp.ones(1000))
    compiling = lanes()[0].submit(program.compile)
    time.sleep(0.5)
    print("begun", flush=True)
    compiling.result()
"""


@contextmanager
def begun(code, folder, path=()):
    """A process that has said that it has begun."""
    paths = [*map(str, path), str(ROOT), *filter(None, sys.path)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    environment.pop("JAX_COMPILATION_CACHE_DIR", None)
    with subprocess.Popen(
        [sys.executable, "-c", HEARING + code],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stdout is not None and process.stderr is not None
            assert process.stdout.readline() == "begun\n", process.stderr.read()
            yield process
        finally:
            process.kill()


def ended(process, number):
    """Exit code and messages of a process that is told to end, which it does in time."""
    start = time.monotonic()
    process.send_signal(number)
    _, messages = process.communicate(timeout=60)
    assert time.monotonic() - start < 20  # on a busy machine
    return process.returncode, messages


@pytest.mark.parametrize(
    ("code", "name", "line"),
    [(UNFINISHED, "SIGINT", "interrupted"), (UNFINISHED, "SIGTERM", "terminated")]
    + [(COMPILING, "SIGINT", "interrupted")],
)
def test_it_ends_with_one_line_and_removes_what_is_unfinished(tmp_path, code, name, line):
    number = getattr(signal, name)
    with begun(code, tmp_path) as process:
        assert [path.name[:5] for path in tmp_path.iterdir()] == [".out-"]
        code, messages = ended(process, number)
    assert code == 128 + number
    assert messages == f"abi-operator: {line}; what was unfinished has been removed.\n"
    assert list(tmp_path.iterdir()) == []


def test_what_a_run_keeps_is_said_and_found_by_the_next(tmp_path):
    with begun(KEEPING, tmp_path) as process:
        code, messages = ended(process, signal.SIGTERM)
    (folder,) = tmp_path.iterdir()
    assert code == 128 + signal.SIGTERM and not (folder / "result.nc").exists()
    assert messages == (
        "abi-operator: terminated; what was unfinished has been removed; what was simulated is "
        f"kept in {folder}, and the same command goes on.\n"
    )
    with output_folder(tmp_path / "out", keeps_parts=True) as again:
        assert again == folder and Parts(again).find("first") == {}


def test_it_ends_with_one_line_while_jax_is_imported(tmp_path):
    (tmp_path / "jax.py").write_text(f"import hashlib\nprint('begun', flush=True)\n{BUSY}\n")
    with begun(COMMAND, tmp_path, [tmp_path]) as process:
        assert ended(process, signal.SIGINT) == (130, "abi-operator: interrupted.\n")


@pytest.mark.parametrize(
    ("argv", "original", "ours"),
    [
        (["/usr/bin/abi-operator", "demo"], ["python", "/usr/bin/abi-operator", "demo"], True),
        (["-m", "demo"], ["python", "-X", "dev", "-m", "abi_operator", "demo"], True),
        (["-m"], ["python", "-mabi_operator"], True),
        (["-m", "abi_operator"], ["python", "-m", "pdb", "abi_operator"], False),
        (["mine.py", "abi-operator"], ["python", "mine.py", "abi-operator"], False),
        ([""], ["python"], False),
    ],
)
def test_our_command_is_known_by_its_name(monkeypatch, argv, original, ours):
    monkeypatch.setattr(sys, "argv", argv)
    monkeypatch.setattr(sys, "orig_argv", original)
    assert _ending._is_our_command() == ours


def test_signals_are_the_business_of_whoever_imports_us(tmp_path):
    code = UNFINISHED.replace('"abi-operator"', '"mine"').replace(
        BUSY, "import time; time.sleep(60)"
    )
    with begun(code, tmp_path) as process:
        code, messages = ended(process, signal.SIGINT)
    assert code == -signal.SIGINT and messages.endswith("\nKeyboardInterrupt\n")
    assert list(tmp_path.iterdir()) == []


class Stopped(Exception):
    """Raised where the main thread would stand still for good."""


def test_the_main_thread_stands_still_but_not_while_results_are_put_in_place(monkeypatch):
    def stop(seconds):
        raise Stopped

    monkeypatch.setattr(_ending, "_told", False)
    monkeypatch.setattr(_ending.time, "sleep", stop)
    with pytest.raises(Stopped):
        _ending._hear(signal.SIGINT, None)
    put = []
    with pytest.raises(Stopped), _ending.undisturbed():
        _ending._hear(signal.SIGINT, None)
        put.append("all")
    assert put == ["all"]


def test_folders_and_files_that_are_unfinished_are_removed(tmp_path, monkeypatch):
    assert _ending._remove_unfinished() == ""
    folder, file = tmp_path / "folder", tmp_path / "file"
    (folder / "below").mkdir(parents=True)
    (folder / "below" / "result.nc").touch()
    file.touch()
    with _ending.unfinished(folder), _ending.unfinished(file):
        assert _ending._remove_unfinished() == "; what was unfinished has been removed"
    assert list(tmp_path.iterdir()) == []
    file.touch()
    monkeypatch.setattr(_ending, "_PATIENCE", 0.0)
    monkeypatch.setattr(Path, "unlink", lambda self: None)  # as if it could not be
    with _ending.unfinished(file):
        assert _ending._remove_unfinished() == f"; {file} could not be removed"


def test_the_next_run_removes_what_a_killed_one_left_and_not_what_a_live_one_writes(tmp_path):
    with begun(UNFINISHED, tmp_path) as alive, begun(UNFINISHED, tmp_path) as killed:
        killed.kill()
        killed.wait()
        assert len(list(tmp_path.iterdir())) == 2
        with output_folder(tmp_path / "out"):
            pass
        (theirs,) = tmp_path.glob(".out-*")
        assert (theirs / "result.nc").read_text() == "half" and alive.poll() is None
    assert theirs.exists()
    with output_folder(tmp_path / "out"):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
