"""The command line as a process, and what other packages add to it."""

import os
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import jax.numpy as jnp
import pytest
from demonstration import SIZE

from abi_operator import __version__, cli
from abi_operator.machine.speed import default_cache_folder


def test_other_packages_add_commands_and_finish_the_demo(invoke, tmp_path, capsys):
    module = f"{__name__}:"
    entries = [
        EntryPoint("greet", module + "greet", "abi_operator.commands"),
        EntryPoint("demo", module + "finish_demo", "abi_operator.commands"),
        EntryPoint("broken", "no_such_module_anywhere:command", "abi_operator.commands"),
    ]
    outcome = invoke("greet", entries=entries)
    assert outcome.exit_code == 0 and outcome.stdout == "float64\n"
    assert capsys.readouterr().err == (
        "note: broken of no_such_module_anywhere is not available "
        "(No module named 'no_such_module_anywhere')\n"
    )
    outcome = invoke("demo", "--size", SIZE, "--out", tmp_path / "demo", entries=entries)
    assert outcome.exit_code == 0, outcome.output
    assert outcome.stdout.endswith(
        "finished with ['inputs', 'natural_color_2007-10-23T180000.png', 'result.nc']\n"
    )


def test_every_command_may_keep_what_it_compiles(monkeypatch, capsys):
    """Also those of other packages, unless told otherwise before or behind their names."""
    entry = EntryPoint("greet", f"{__name__}:greet", "abi_operator.commands")
    monkeypatch.setattr(cli, "entry_points", lambda group, name=None: [entry])
    kept = []
    monkeypatch.setattr(cli, "_prepare_process", kept.append)
    for words in (["greet"], ["--no-cache", "greet"], ["greet", "--no-cache"], ["--help"]):
        monkeypatch.setattr(sys, "argv", ["abi-operator", *words])
        with pytest.raises(SystemExit) as end:
            cli.main()
        assert end.value.code == 0
    assert kept == [True, False, False]
    text = capsys.readouterr().out
    assert text.startswith(3 * "float64\n")
    assert str(default_cache_folder()) in text and "--no-cache" in text


def test_it_says_its_version_and_helps(invoke):
    assert invoke("--version").stdout == f"abi-operator {__version__}\n"
    for words in (["-h"], ["simulate", "-h"], ["jacobian", "check", "-h"]):
        outcome = invoke(*words)
        assert outcome.exit_code == 0 and outcome.stdout.startswith("Usage: "), outcome.output
    assert "what other packages add" not in invoke("demo", "-h").stdout
    words = [sys.executable, "-P", "-m", "abi_operator", "simulate", "-h"]
    found = subprocess.run(words, capture_output=True, text=True, check=True)
    assert found.stdout.startswith("Usage: python -m abi_operator simulate ")


PROCESS = """
import os, sys
import jax
from abi_operator import cli
from abi_operator.machine import kept, processor
sys.argv = ["abi-operator", *sys.argv[1:]]
try:
    cli.main()
except SystemExit as end:
    assert end.code == 2
bits = processor.vector_bits()
assert bits is None or f"--xla_cpu_prefer_vector_width={bits} " in os.environ["XLA_FLAGS"]
assert "--xla_backend_extra_options=" in os.environ["XLA_FLAGS"]
assert jax.config.jax_num_cpu_devices == -1
folder = jax.config.jax_compilation_cache_dir
assert str(kept._folder) == str(folder)
print(folder)
"""


@pytest.mark.parametrize("options", [[], ["--no-cache"]])
def test_a_process_is_prepared_before_its_command(tmp_path, options):
    ours = {k: v for k, v in os.environ.items() if k != "XLA_FLAGS" and not k.startswith("JAX_")}
    paths = os.pathsep.join(p for p in sys.path if p)
    outcome = subprocess.run(
        [sys.executable, "-c", PROCESS, "jacobian", "check", tmp_path / "nothing", *options],
        env=ours | {"XDG_CACHE_HOME": str(tmp_path), "PYTHONPATH": paths},
        capture_output=True,
        text=True,
    )
    assert outcome.returncode == 0 and "nothing" in outcome.stderr, outcome.stderr
    folder = tmp_path / "abi-operator" / "compiled"
    assert outcome.stdout.startswith("None" if options else str(folder))
    assert folder.exists() == (not options)


def greet() -> None:
    """A command of another package."""
    print(jnp.ones(1).dtype)


def finish_demo(folder: Path) -> None:
    """Another package's last step of the demonstration."""
    print("finished with", sorted(path.name for path in folder.iterdir()))
