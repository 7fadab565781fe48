"""The command line, and the demonstration's files to give to it.

The package is imported by the fixtures: what is imported before pytest is ready is not checked for
shapes.
"""

import shutil
from pathlib import Path

import pytest
from demonstration import SIZE
from typer.testing import CliRunner


@pytest.fixture
def invoke(monkeypatch):
    """A function that runs the command line as if no other package added to it, or these."""
    from abi_operator import cli

    def run(*arguments, entries=()):
        def entry_points(group, name=None):
            assert group == "abi_operator.commands"
            return [entry for entry in entries if name in (None, entry.name)]

        monkeypatch.setattr(cli, "entry_points", entry_points)
        return CliRunner().invoke(cli.make_app(), [str(argument) for argument in arguments])

    return run


@pytest.fixture(scope="module")
def demo_files(tmp_path_factory):
    from abi_operator.demo import write_demo

    return write_demo(tmp_path_factory.mktemp("inputs"), size=SIZE)


@pytest.fixture
def inputs(demo_files, tmp_path):
    """Copies of the demonstration's inputs, to be broken."""
    (tmp_path / "inputs").mkdir()
    return type(demo_files)(*(Path(shutil.copy(path, tmp_path / "inputs")) for path in demo_files))
