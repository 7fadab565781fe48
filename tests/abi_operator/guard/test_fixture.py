"""The pytest fixture, as a user's project has it: in another process, found by its entry point."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from guarded import two_columns

from abi_operator import guard

TEST = """
import sys

LOADED = [name for name in ("jax", "abi_operator", "xarray") if name in sys.modules]

from guarded import two_columns


def test_start_up():
    assert LOADED == []


def test_columns(jacobian_guard):
    jacobian_guard("two", two_columns(), bands=("C02",), num_streams=2)
"""


PATH = os.environ.get("PYTHONPATH", "").split(os.pathsep)


@pytest.fixture
def project(tmp_path):
    (tmp_path / "test_mine.py").write_text(TEST)
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    return tmp_path


def run(project, *arguments):
    helpers = Path(sys.modules[two_columns.__module__].__file__).parent
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(helpers), *filter(None, PATH)]),
        # States are made in the precision that the tests run in.
        "JAX_ENABLE_X64": "1",
        # What this process compiles need not be compiled again (JAX_COMPILATION_CACHE_DIR is set).
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
    }
    return subprocess.run(
        command,
        cwd=project,
        env=environment,
        capture_output=True,
        text=True,
    )


@pytest.mark.slow
def test_moved_then_accepted(project):
    """A baseline of something else: the test fails with the table, then accepts, with a reason."""
    file = project / "baselines" / "two.nc"
    now = guard.evaluate(two_columns(), ("C02",), num_streams=2)
    older = now._replace(value=1.001 * now.value)
    guard.write_baseline(file, guard.Baseline(older, "two", {}, ("made up",)))
    failed = run(project)
    assert failed.returncode == 1, failed.stdout + failed.stderr
    assert "1 failed, 1 passed" in failed.stdout
    assert "dark    C02   brf" in failed.stdout
    assert "pytest --jacobian-accept" in failed.stdout
    accepted = run(project, "--jacobian-accept", "they were too bright")
    assert accepted.returncode == 0, accepted.stdout + accepted.stderr
    stored = guard.read_baseline(file)
    assert "accepted: they were too bright; 2 of" in stored.history[1]
    assert not guard.compare(stored.jacobians, now)
