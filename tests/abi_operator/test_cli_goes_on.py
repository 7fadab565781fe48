"""The command line after a run that ended early."""

import errno
import os

from demonstration import SIZE

from abi_operator import simulation
from abi_operator.files import Parts


def test_a_demonstration_that_ended_early_goes_on(invoke, tmp_path, monkeypatch):
    """Its blocks are kept, and the same command takes them and leaves nothing else behind."""
    monkeypatch.setattr(simulation, "_BLOCK_COLUMNS", 3 * SIZE)
    keep, kept = Parts.keep, []

    def keep_two(self, name, arrays):
        if len(kept) == 2:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        kept.append(name)
        keep(self, name, arrays)

    words = "demo", "--size", SIZE, "--out", tmp_path / "demo"
    with monkeypatch.context() as full:
        full.setattr(Parts, "keep", keep_two)
        outcome = invoke(*words)
    assert outcome.exit_code == 2
    assert "what was simulated is kept in" in outcome.stderr
    assert "and the same command goes on" in outcome.stderr
    outcome = invoke(*words)
    assert outcome.exit_code == 0, outcome.output
    assert "simulated before, by a run that had ended early: 2 blocks" in outcome.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["demo"]
