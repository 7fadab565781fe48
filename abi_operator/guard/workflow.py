"""Save, check and accept a baseline: evaluation, file and comparison put together."""

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from ..atmosphere import State
from ..files import InputError
from .baseline import Baseline, history_line, read_baseline, versions, write_baseline
from .comparison import Comparison, compare
from .evaluation import Jacobians, evaluate
from .report import report
from .scenario import STANDARD, states_of

FilePath = str | PathLike[str]
States = State | Mapping[str, State]


def save(
    path: FilePath,
    scenario: str,
    bands: Sequence[str] | None = None,
    **settings: Any,
) -> Baseline:
    """Evaluate a scenario and write its baseline.

    Parameters
    ----------
    path
        File to write or to replace.
    scenario
        What is evaluated; see `load_scenario`.
    bands, settings
        As in `evaluate`.

    Raises
    ------
    InputError
        Where the scenario, a band, a setting or the file is not what it should be.
    """
    jacobians = _evaluated(states_of(scenario), bands, settings)
    baseline = Baseline(jacobians, scenario, versions(), (history_line("saved"),))
    write_baseline(path, baseline)
    return baseline


def check(path: FilePath, scenario: str | None = None) -> Comparison:
    """Evaluate what a baseline is of, with the settings asked for then, and compare.

    Parameters
    ----------
    path
        The baseline.
    scenario
        Where the states are from; None for the project's own columns.

    Raises
    ------
    InputError
        As `read_baseline` and `save`, and where a file of another scenario is checked without it.
    """
    comparison, _, _ = _compared(path, scenario)
    return comparison


def accept(path: FilePath, reason: str, scenario: str | None = None) -> Comparison:
    """Replace a baseline by what is computed now, and add the reason to its history.

    A baseline in which nothing moved stays as it is, unless it is from before outputs were kept.

    Parameters
    ----------
    path, scenario
        As in `check`.
    reason
        Why it moved, for the history: one line.

    Returns
    -------
    What moved.

    Raises
    ------
    InputError
        As `check`, and where there is no reason.
    """
    reason = _one_line(reason)
    comparison, stored, jacobians = _compared(path, scenario)
    if comparison or comparison.to_keep:
        stored = stored._replace(scenario=scenario or stored.scenario)
        _accept(path, stored, jacobians, comparison, reason)
    return comparison


def _compared(path: FilePath, scenario: str | None) -> tuple[Comparison, Baseline, Jacobians]:
    stored = read_baseline(path)
    # A file does not choose what code is run: one that names a function is told it again.
    if scenario is None and stored.scenario != STANDARD:
        raise InputError(
            f"{path} is of {stored.scenario!r}; say with --scenario where that is now."
        )
    request = stored.jacobians.request
    jacobians = _evaluated(states_of(scenario or STANDARD), request.bands, request.settings)
    return compare(stored.jacobians, jacobians), stored, jacobians


def _accept(
    path: FilePath, stored: Baseline, jacobians: Jacobians, comparison: Comparison, reason: str
) -> None:
    moved = f"{len(comparison.moved)} of {comparison.num_compared} numbers moved"
    other = f"{len(comparison.changed)} other changes"
    line = history_line(f"accepted: {_one_line(reason)}; {moved}, {other}")
    write_baseline(path, stored._replace(jacobians=jacobians, history=(*stored.history, line)))


def _one_line(reason: str) -> str:
    reason = " ".join(reason.split())
    if not reason:
        raise InputError("a change is accepted with a reason; give one in a few words.")
    return reason


def _evaluated(
    states: States, bands: Sequence[str] | None, settings: Mapping[str, Any]
) -> Jacobians:
    try:
        return evaluate(states, bands, **settings)
    except (ValueError, TypeError) as error:
        raise InputError(str(error)) from error


def guard_states(
    path: FilePath,
    states: States,
    bands: Sequence[str] | None = None,
    *,
    reason: str | None = None,
    **settings: Any,
) -> str:
    """Compare states at hand with their baseline, as the pytest fixture does.

    Parameters
    ----------
    path
        The baseline.
    states, bands, settings
        As in `evaluate`. What the file was written with counts for nothing: it differs where the
        caller asks for something else.
    reason
        Why changes are accepted, and a missing file written; None to accept none.

    Returns
    -------
    What moved and what to do about it; empty where nothing did or all was accepted.
    """
    how = 'pytest --jacobian-accept "what changed, and why"'
    jacobians = _evaluated(states, bands, settings)
    scenario = f"jacobian_guard({Path(path).stem!r})"
    if not Path(path).exists():
        if reason is None:
            return f"{path} does not exist; write it with {how}"
        line = history_line(f"saved: {_one_line(reason)}")
        write_baseline(path, Baseline(jacobians, scenario, versions(), (line,)))
        return ""
    stored = read_baseline(path)
    comparison = compare(stored.jacobians, jacobians)
    if (comparison or comparison.to_keep) and reason is not None:
        _accept(path, stored, jacobians, comparison, reason)
    elif comparison:
        return f"{path}: {report(comparison)}\nIf that is wanted, accept it with {how}"
    return ""
