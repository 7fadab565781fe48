"""What settles how fast JAX is, in processes of their own, and the folder of compiled programs."""

import os
import subprocess
import sys
import warnings

import jax
import pytest
from jax_settings import settings

from abi_operator.machine import processor, speed

SETTLED = ("XLA_FLAGS", "JAX_NUM_CPU_DEVICES", "JAX_COMPILATION_CACHE_DIR")

# Nothing but JAX's own start may be between a process and what it sets.
FULL_SPEED = """
import os, warnings
import jax
import abi_operator
from abi_operator.machine.processor import usable_cores, vector_bits
assert jax.config.jax_num_cpu_devices == -1 and "XLA_FLAGS" not in os.environ
assert jax.config.jax_compilation_cache_dir is None
found = abi_operator.use_full_speed()
assert found == (usable_cores(), vector_bits()), found
assert jax.local_device_count() == usable_cores()
flags = os.environ["XLA_FLAGS"].split()
if vector_bits() is not None:
    assert flags.pop(0) == f"--xla_cpu_prefer_vector_width={vector_bits()}"
assert [flag.partition("=")[0] for flag in flags] == [
    "--xla_backend_optimization_level", "--xla_backend_extra_options"
]
warnings.simplefilter("error")
assert abi_operator.use_full_speed() == found
print(found)
"""
USERS_CHOICE = """
import os
import jax
from abi_operator import use_full_speed
flags = os.environ["XLA_FLAGS"]
assert use_full_speed() == (3, 256)
assert os.environ["XLA_FLAGS"] == flags and jax.local_device_count() == 3
"""
TOO_LATE = """
import os, warnings
import jax
from abi_operator import use_full_speed
from abi_operator.machine import processor
processor.usable_cores.__globals__["os"].sched_getaffinity = lambda _: range(5)
jax.numpy.zeros(1)
with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    assert use_full_speed() == (1, None)
(warning,) = caught
assert "right after the imports. Programs under jax.jit run on 1 core," in str(warning.message)
assert warning.filename == "<string>" and "XLA_FLAGS" not in os.environ
"""
# A solve's smallest kernel is a primitive of this package, which JAX's keys know nothing of.
KEEPING = """
import sys
import jax, jax.numpy as jnp
from abi_operator import use_compilation_cache
from abi_operator.machine.kernels import one_kernel
found = []
jax.monitoring.register_event_listener(lambda name, **_: found.append(name.rsplit("/", 1)[1]))
folder = use_compilation_cache(sys.argv[1])
assert use_compilation_cache() == folder

@jax.custom_jvp
def squares(x):
    return one_kernel(lambda y: jnp.sin(y @ y) + 1.0, 4)(x)

squares.defjvp(lambda x, t: (squares(*x), 2 * t[0]))
print(jax.jit(jax.value_and_grad(lambda x: squares(x).sum()))(jnp.ones((4, 4)))[0])
requests = found.count("compile_requests_use_cache")
print(requests, found.count("cache_hits"), found.count("cache_misses"))
"""


def start(code, *arguments, **settings):
    """A child that runs `code` with these settings and none of ours."""
    ours = {k: v for k, v in os.environ.items() if k not in SETTLED}
    paths = os.pathsep.join(p for p in sys.path if p)
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        env=ours | {"JAX_PLATFORMS": "cpu", "PYTHONPATH": paths} | settings,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def finish(*children):
    """What children print; none may fail, nor say anything beside it."""
    found = []
    for child in children:
        output, errors = child.communicate()
        assert child.returncode == 0 and not errors, errors
        found.append(output)
    return found


def test_full_speed_is_what_nobody_has_chosen_otherwise():
    flags = (
        "--xla_cpu_prefer_vector_width=256 --xla_backend_extra_options=xla_one=two "
        "--xla_backend_optimization_level=2"
    )
    with_devices = f"{flags} --xla_force_host_platform_device_count=3"
    by_flags = start(USERS_CHOICE, XLA_FLAGS=with_devices)
    (sentence,) = finish(start(FULL_SPEED))
    assert sentence.startswith("Programs under jax.jit run on ") and sentence.endswith(".\n")
    by_name = start(USERS_CHOICE, XLA_FLAGS=flags, JAX_NUM_CPU_DEVICES="3")
    finish(by_flags, by_name)


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="no affinity to pretend")
def test_what_comes_too_late_is_said():
    finish(start(TOO_LATE))


def test_compiled_programs_are_kept_for_other_processes(tmp_path):
    """Two at once, and a third that compiles nothing and says nothing about what it loads.

    A fourth finds half of each, as a process that is killed leaves them, compiles and is as quiet.
    """
    both = [start(KEEPING, tmp_path, JAX_ENABLE_X64="1") for _ in range(2)]
    values = {output.splitlines()[0] for output in finish(*both)}
    (folder,) = tmp_path.iterdir()
    assert folder.name == processor.processor_key() and folder.stat().st_mode & 0o777 == 0o700
    (third,) = finish(start(KEEPING, tmp_path, JAX_ENABLE_X64="1"))
    value, counts = third.splitlines()
    requests, hits, misses = map(int, counts.split())
    assert values == {value} and requests == hits > 0 and misses == 0
    for program in folder.glob("*-cache"):
        program.write_bytes(program.read_bytes()[: program.stat().st_size // 2])
    (fourth,) = finish(start(KEEPING, tmp_path, JAX_ENABLE_X64="1"))
    value, counts = fourth.splitlines()
    requests, hits, _ = map(int, counts.split())
    assert values == {value} and requests > hits == 0


def test_a_folder_that_cannot_be_written_is_one_warning(monkeypatch, tmp_path):
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
    (tmp_path / "file").touch()
    with settings(jax_compilation_cache_dir=None):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            assert speed.use_compilation_cache(tmp_path / "file" / "folder") is None
        assert jax.config.jax_compilation_cache_dir is None
    (warning,) = caught
    assert "compiled programs are not kept: " in str(warning.message)


def test_a_users_folder_stays(monkeypatch, tmp_path):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "mine")
    with settings(jax_compilation_cache_dir="mine"):  # as JAX does where it is imported
        assert str(speed.use_compilation_cache(tmp_path)) == "mine"
    with settings(jax_enable_compilation_cache=False):
        assert speed.use_compilation_cache(tmp_path) is None
    assert not any(tmp_path.iterdir())


def test_the_default_folder_is_the_users(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert speed.default_cache_folder() == tmp_path / "abi-operator" / "compiled"
    monkeypatch.setenv("XDG_CACHE_HOME", "not/absolute")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert speed.default_cache_folder() == tmp_path / ".cache" / "abi-operator" / "compiled"


def test_what_was_not_used_for_longest_goes(tmp_path):
    (tmp_path / "one-processor").mkdir()
    names = [f"jit_program-{number:064x}-cache" for number in range(4)]
    for age, name in enumerate(names):
        path = tmp_path / "one-processor" / name
        path.write_bytes(bytes(100_000))
        os.utime(path, (1e9 - age, 1e9 - age))
    others = tmp_path / "one-processor" / "not-a-cache"
    others.write_bytes(bytes(100_000))
    os.utime(others, (1, 1))
    speed._forget_oldest(tmp_path, kept=250_000)
    left = sorted(path.name for path in (tmp_path / "one-processor").iterdir())
    assert left == sorted([*names[:2], "not-a-cache"])


@pytest.mark.parametrize(
    ("files", "cores"),
    [
        ({"cpu.max": "150000 100000\n"}, 2),
        ({"cpu.max": "20000 100000\n"}, 1),
        ({"cpu.max": "max 100000\n"}, 8),
        ({"cpu/cpu.cfs_quota_us": "300000\n", "cpu/cpu.cfs_period_us": "100000\n"}, 3),
        ({"cpu/cpu.cfs_quota_us": "-1\n", "cpu/cpu.cfs_period_us": "100000\n"}, 8),
        ({}, 8),
    ],
)
def test_a_quota_of_the_cgroup_counts(monkeypatch, tmp_path, files, cores):
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(processor, "_CGROUP", tmp_path)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(8), raising=False)
    processor._quota.cache_clear()
    try:
        assert speed.usable_cores() == cores
    finally:
        processor._quota.cache_clear()
