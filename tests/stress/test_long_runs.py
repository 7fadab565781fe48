"""Long runs end well: samples of `benchmarks/long_runs.py`, which tries more, and more often."""

import os

import pytest
from long_runs import worker_dies
from long_runs_commands import Place, killed
from long_runs_operator import COUNT, answer, answers, same


@pytest.mark.slow
def test_threads_get_the_numbers_of_one():
    """Values and gradients of the operator, of calls with other numbers of columns at once."""
    found = answers("threads")
    assert all(same(found[number], answer(number)) for number in range(COUNT))


@pytest.mark.slow
def test_spawned_processes_get_the_same_and_one_that_dies_spoils_no_other(tmp_path):
    """A forked one would wait for ever, as README says."""
    found = worker_dies(os.environ.get("JAX_COMPILATION_CACHE_DIR", tmp_path))
    assert not found.failed and "terminated abruptly" in found.happened


@pytest.mark.slow
def test_a_series_that_is_killed_goes_on_to_the_same_bytes(tmp_path, scale):
    found = killed(Place(tmp_path), "simulate", max(2, round(20 * scale)), seed=7)
    assert not found.failed, found.failed
