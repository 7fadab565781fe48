"""Options of the compiler: those that this version of XLA has, and that nobody has chosen."""

import pytest

from abi_operator.machine import compiler


@pytest.fixture
def without_flags(monkeypatch):
    monkeypatch.delenv("XLA_FLAGS", raising=False)


def test_an_option_that_xla_does_not_know_is_left_out(monkeypatch, without_flags):
    """Versions add and drop options, and a call with one that is not there fails."""
    known = compiler.options()
    monkeypatch.setattr(compiler, "_EMITTERS", "xla_cpu_no_such_option")
    found = compiler.options()
    assert "xla_cpu_no_such_option" not in found
    assert found.items() <= known.items()


def test_what_the_user_has_chosen_stays(monkeypatch, without_flags):
    (name, *_) = compiler.options()
    monkeypatch.setenv("XLA_FLAGS", f"--{name}=true")
    assert name not in compiler.options()


def test_a_gpu_follows_loops_by_itself(monkeypatch):
    monkeypatch.setenv("XLA_FLAGS", "")
    monkeypatch.setattr(compiler, "on_cpu", lambda: False)
    assert list(compiler.options()) == ["xla_gpu_enable_command_buffer"]
    monkeypatch.setenv("XLA_FLAGS", "--xla_gpu_enable_command_buffer=")
    assert compiler.options() == {}


def test_columns_of_the_shortest_loop_are_those_of_the_level_of_optimisation(
    monkeypatch, without_flags
):
    """What is called with values is compiled at a level of ours, a `jax.jit` at the user's."""
    monkeypatch.setattr(compiler, "_chosen_level", lambda: compiler.number_of(compiler._LEVEL))
    own = compiler.options()
    assert compiler.shortest_loop() == 64
    with compiler.traced_for(own):
        assert compiler.shortest_loop() == 32
    for level, columns in ((3, 64), (1, 32)):
        monkeypatch.setenv("XLA_FLAGS", f"--{compiler._LEVEL}={level}")
        assert compiler._LEVEL in own and compiler._LEVEL not in compiler.options()
        with compiler.traced_for(compiler.options()):
            assert compiler.shortest_loop() == columns
