"""Precision, strictness and compiler under which tests run.

Compiling takes most of a test's time, and most tests ask a program for a few columns once. So
where no long study is among them, programs are compiled without most of XLA's and LLVM's
optimisations (`_OPTIMISED`, JAX's own switch, left alone where it is set). Studies, the tests of
single precision and those with the lowest versions see programs as users do, and so does the guard
on every Jacobian: `.ci/run` has all of them.
"""

import gc
import os
import shutil
import tempfile

import jax
import pytest

if "JAX_ENABLE_X64" not in os.environ:
    jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_dtype_promotion", "strict")

# As in the commands: tracing makes many small objects that stay.
gc.freeze()
gc.set_threshold(50_000)

# What one worker compiled the others read, and the processes that tests start. [s]
_CACHE, _SHORTEST_COMPILATION = "JAX_COMPILATION_CACHE_DIR", 0.0

# As the commands have it (`abi_operator.machine.compiler`, which must not be imported here: what is
# imported before pytest is ready is not checked for shapes). All of XLA's flags must begin with two
# dashes: those behind one that does not are passed over.
_EXTRA = "--xla_backend_extra_options"
_LEAN = f"--xla_backend_optimization_level=1 {_EXTRA}=xla_cpu_disable_new_fusion_emitters=true"

_OPTIMISED = "JAX_DISABLE_MOST_OPTIMIZATIONS"


def pytest_configure(config):
    """One cache of compiled programs for all workers of a run, emptied at its end."""
    flags = os.environ.get("XLA_FLAGS", "")
    if _EXTRA not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} {_LEAN}".strip()
    if _CACHE not in os.environ:
        config.own_cache = tempfile.mkdtemp(prefix="abi-operator-tests-")
        os.environ[_CACHE] = config.own_cache
    jax.config.update("jax_compilation_cache_dir", os.environ[_CACHE])
    jax.config.update("jax_persistent_cache_min_compile_time_secs", _SHORTEST_COMPILATION)


def pytest_unconfigure(config):
    """Remove it, in the process that made it."""
    if hasattr(config, "own_cache"):
        shutil.rmtree(config.own_cache, ignore_errors=True)
        os.environ.pop(_CACHE, None)


def pytest_addoption(parser):
    parser.addoption(
        "--scale", type=float, default=1.0, help="share of a slow study's full counts to run"
    )
    parser.addoption(
        "--every", type=int, default=1, metavar="N", help="of the slow studies run one in N"
    )
    parser.addoption(
        "--first", type=int, default=0, metavar="K", help="the first of those, modulo N"
    )


def pytest_report_header(config):
    """Which of the slow studies are drawn, so that the same can be drawn again."""
    every = config.getoption("--every")
    if every > 1:
        return f"slow studies: one in {every}, from {config.getoption('--first') % every} on"


def pytest_collection_modifyitems(config, items):
    """One in so many of the slow studies, in their order: what they take is compiling.

    From another one on with every change of the package (`.ci/run`): in time all of them run.
    """
    slow = [item for item in items if item.get_closest_marker("slow")]
    every = config.getoption("--every")
    left_out = set(slow) - set(slow[config.getoption("--first") % every :: every])
    if left_out:
        config.hook.pytest_deselected(items=list(left_out))
        items[:] = [item for item in items if item not in left_out]


def pytest_collection_finish(session):
    """Compile for a single call, in this process and in those that tests start."""
    studies = any(item.get_closest_marker("slow") for item in session.items)
    if _OPTIMISED not in os.environ and not studies:
        os.environ[_OPTIMISED] = "1"
        jax.config.update(_OPTIMISED.lower(), True)


@pytest.fixture
def scale(request):
    """Share of a long study's full counts."""
    return request.config.getoption("--scale")
