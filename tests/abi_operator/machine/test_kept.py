"""Programs on disk: found again without a trace, and by nobody who needs another one."""

import os
import subprocess
import sys
import threading

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax_settings import settings

from abi_operator.machine import compiler, door, kept, speed
from abi_operator.machine.door import _wanted
from abi_operator.solver import toa_brf

MINE = """
import jax, jax.numpy as jnp

def factor(scale, x):
    return {"root": jnp.linalg.cholesky(scale * x), "name": (x[0], None)}
"""

# A process of its own: what it prints are results, and what was traced for them.
SOLVE = """
import sys
from pathlib import Path
import jax, numpy as np
from abi_operator.machine import kept
from abi_operator.solver import toa_brf
from mine.work import factor
kept.use(Path(sys.argv[1]))
program = kept.Kept(factor)
traced = []
jax.monitoring.register_event_duration_secs_listener(
    lambda name, _, **more: traced.append(more) if name.endswith("jaxpr_trace_duration") else None
)
with jax.enable_x64(True):
    tau, moments = np.linspace(0.1, 1, 8).reshape(4, 2), np.full((2, 3), 0.7 ** np.arange(3))
    brf = toa_brf(tau, np.full(2, 0.9), moments, 0.2, 0.6, 0.8, 0.5, num_streams=2, num_modes=1)
    found = program(2.0, np.eye(3) + 0.5)
    assert found["name"][1] is None
    print(np.asarray(brf).tobytes().hex(), np.asarray(found["root"]).tobytes().hex())
print([x["fun_name"] for x in traced if x["fun_name"] != "nothing"])
"""


def start(folder, place, **environment):
    paths = os.pathsep.join([str(place), *filter(None, sys.path)])
    ours = {k: v for k, v in os.environ.items() if k != "JAX_COMPILATION_CACHE_DIR"}
    return subprocess.Popen(
        [sys.executable, "-c", SOLVE, str(folder)],
        env=ours | {"PYTHONPATH": paths, "JAX_PLATFORMS": "cpu"} | environment,
        stdout=subprocess.PIPE,
        text=True,
    )


def finish(process):
    output, _ = process.communicate()
    assert process.returncode == 0
    return output.splitlines()


def test_other_processes_trace_nothing(tmp_path):
    """Not even where LAPACK is called, which JAX looks for where it lowers such a call."""
    folder, place = tmp_path / "kept", tmp_path / "packages"
    (place / "mine").mkdir(parents=True)
    folder.mkdir()
    (place / "mine" / "__init__.py").touch()
    (place / "mine" / "work.py").write_text(MINE)
    first = finish(start(folder, place))
    files = set(folder.iterdir())
    assert len(files) == 2 and all(path.stat().st_mode & 0o777 == 0o600 for path in files)
    (broken,) = sorted(files)[:1]
    broken.write_bytes(broken.read_bytes()[:1000])
    running = start(folder, place, XLA_FLAGS=f"{os.environ['XLA_FLAGS']} --xla_dump_to=")
    second = finish(start(folder, place))
    other_flags = finish(running)
    third = finish(start(folder, place))
    assert first[0] == second[0] == third[0] == other_flags[0]
    assert first[1] != third[1] == "['cholesky']"
    assert len(set(folder.iterdir())) == 4  # two for other flags
    (place / "mine" / "work.py").write_text(MINE.replace("scale * x", "scale * x + 0.0"))
    os.utime(place / "mine" / "work.py", (1e9, 1e9))
    fourth = finish(start(folder, place))
    assert fourth[0] == first[0] and "flat" in fourth[1]
    assert len(set(folder.iterdir())) == 5


def named(fixed, *shapes, function=_wanted, options=None):
    arrays = [np.zeros(shape) for shape in shapes]
    leaves, structure = jax.tree.flatten(arrays)
    return kept._name(function, (options, (fixed, structure, tuple(x.shape for x in leaves))))


def test_a_name_is_of_all_that_a_program_depends_on(monkeypatch):
    name = named(("C01", 0.5), (3,))
    assert name == named(("".join(["C", "01"]), 0.5), (3,)) and name.startswith("columns-")
    others = {
        named(("C02", 0.5), (3,)),
        named(("C01", 0.25), (3,)),
        named(("C01", 0.5), (4,)),
        named(("C01", 0.5), (3,), (3,)),
        named(("C01", 0.5), (3,), options={"xla_cpu_prefer_vector_width": 128}),
    }
    with settings(jax_default_matmul_precision="float32"):
        others.add(named(("C01", 0.5), (3,)))
    monkeypatch.setenv("XLA_FLAGS", "--xla_dump_to=")
    others.add(named(("C01", 0.5), (3,)))
    assert len(others) == 7 and name not in others and None not in others


def test_what_cannot_be_told_apart_has_no_name(monkeypatch):
    """Made inside a function, of an object without a value, or of files newer than the process."""
    assert named((), (3,), function=lambda fixed, x: x) is None
    assert named((lambda: 0,), (3,)) is None
    assert named((threading.Lock(),), (3,)) is None
    kept._digest.cache_clear()
    monkeypatch.setattr(kept, "_began", 0.0)
    try:
        assert named((), (3,)) is None
    finally:
        kept._digest.cache_clear()


@pytest.fixture
def no_folder(monkeypatch):
    monkeypatch.setattr(kept, "_folder", None)


def doubled(count, x):
    return [count * x]


def test_without_a_folder_it_is_a_jit(no_folder):
    program = speed.Kept(doubled)
    program.prepare(2, jnp.arange(3.0))
    assert program._jitted._cache_size() == 1
    np.testing.assert_array_equal(program(2, jnp.arange(3.0))[0], [0, 2, 4])
    assert program._jitted._cache_size() == 1


def test_it_is_traced_and_compiled_with_the_compilers_options(no_folder, monkeypatch):
    """For short loops where they ask for the first level; and what XLA does not know is refused."""
    seen = []

    def anew(count, x):
        seen.append(compiler.shortest_loop())
        return count * x

    monkeypatch.setattr(compiler, "_chosen_level", lambda: None)
    monkeypatch.setattr(compiler, "options", lambda recorded: {compiler._LEVEL: 1})
    np.testing.assert_array_equal(kept.Kept(anew)(2, jnp.arange(3.0)), [0, 2, 4])
    assert seen == [compiler.SHORTEST] and compiler.shortest_loop() == 2 * compiler.SHORTEST
    monkeypatch.setattr(compiler, "options", lambda recorded: {"xla_no_such_option": recorded})
    with pytest.raises(jax.errors.JaxRuntimeError, match="xla_no_such_option"):
        kept.Kept(anew)(2, jnp.arange(3.0))


def test_a_function_of_no_package_is_a_jit_as_well(monkeypatch, tmp_path):
    monkeypatch.setattr(kept, "_folder", tmp_path)
    program = speed.Kept(lambda count, x: count * x)
    np.testing.assert_array_equal(program(2, jnp.arange(3.0)), [0, 2, 4])
    assert program._jitted._cache_size() == 1 and not any(tmp_path.iterdir())


def test_what_was_written_is_read(monkeypatch, tmp_path):
    """In one process: a second `Kept` finds what the first one wrote, and a third a broken file."""
    monkeypatch.setattr(kept, "_folder", tmp_path)
    tau, moments = np.linspace(0.1, 1, 6).reshape(3, 2), np.full((2, 3), 0.7 ** np.arange(3))
    found, written = [], []
    for content in (None, None, b"broken"):
        program = speed.Kept(_wanted)
        monkeypatch.setattr(door, "_alone", lambda program=program: program)
        if content is not None:
            next(tmp_path.iterdir()).write_bytes(content)
        options = {"num_streams": 2, "num_modes": 1}
        of_others = program._jitted._cache_size()  # those of a function share what they compile
        found.append(toa_brf(tau, np.full(2, 0.9), moments, 0.2, 0.6, 0.8, 0.5, **options))
        (path,) = tmp_path.iterdir()
        assert path.stat().st_size > 1000 and program._jitted._cache_size() == of_others
        written.append(path.stat().st_ino)
    assert written[0] == written[1] != written[2]
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


@pytest.mark.slow
def test_what_is_kept_has_been_compiled_and_not_read_from_jax(tmp_path):
    """XLA writes programs that it has read, as after an update of the package, without kernels."""
    place = tmp_path / "packages"
    (place / "mine").mkdir(parents=True)
    (place / "mine" / "__init__.py").touch()
    (place / "mine" / "work.py").write_text(MINE)
    caches = {"JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}
    found = []
    for name in ("before", "after", "after"):
        (tmp_path / name).mkdir(exist_ok=True)
        process = start(
            tmp_path / name, place, JAX_COMPILATION_CACHE_DIR=str(tmp_path / "jax"), **caches
        )
        found.append(finish(process))
    assert found[0][0] == found[1][0] == found[2][0]
    assert found[0][1].count("flat_") == found[1][1].count("flat_") == 2
    assert found[2][1] == "['cholesky']"
