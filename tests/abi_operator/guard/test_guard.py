"""Files, tolerances, tables and commands of the guard, on two columns that are solved at once."""

import importlib
import inspect
import json
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr
from guarded import BANDS, SETTINGS, two_columns
from typer.testing import CliRunner

from abi_operator import brf, guard
from abi_operator.cli import make_app
from abi_operator.files import InputError
from abi_operator.guard import evaluation

PROGRAM = importlib.import_module("abi_operator.solver.program")
ALL_MODES = importlib.import_module("abi_operator.solver.all_modes")
SCENARIO = f"{Path(sys.modules['guarded'].__file__)}:two_columns"


@pytest.fixture(scope="module")
def evaluated():
    return guard.evaluate(two_columns(), BANDS, **SETTINGS)


def moved_by(of, factor, column="dark", entry=None, more=0.0):
    """The evaluation with one number multiplied, and `more` of a slope."""
    i = of.columns.index(column)
    value, jacobian = of.value.copy(), of.jacobian.copy()
    if entry is None:
        value[i] *= factor
    else:
        k = of.inputs.index(entry)
        jacobian[i, :, k] = factor * jacobian[i, :, k] + more
    return of._replace(value=value, jacobian=jacobian)


def test_values_and_jacobians_are_those_of_the_operator(evaluated):
    """Against `brf` itself, with its own number of doublings, and its differences."""
    steps = {"atmosphere.pressure[2]": 10.0, "albedo.C02": 1e-4, "geometry.view_zenith": 1e-4}
    moved = list(two_columns().values())
    for name, step in steps.items():
        for sign in (1, -1):
            for state in two_columns().values():
                leaves, tree = jax.tree.flatten(state)
                numbers, k = np.concatenate([np.ravel(x) for x in leaves]), 0
                numbers[evaluated.inputs.index(name)] += sign * step
                for i, leaf in enumerate(leaves):
                    leaves[i] = numbers[k : k + leaf.size].reshape(leaf.shape)
                    k += leaf.size
                moved.append(jax.tree.unflatten(tree, leaves))
    batch = jax.tree.map(lambda *x: np.stack(x), *moved)
    value, *ends = np.asarray(brf(batch, BANDS, **SETTINGS)).reshape(-1, 2)
    np.testing.assert_allclose(evaluated.value[:, 0], value, rtol=1e-12)
    for k, (name, step) in enumerate(steps.items()):
        slope = (ends[2 * k] - ends[2 * k + 1]) / (2 * step)
        place = evaluated.inputs.index(name)
        np.testing.assert_allclose(evaluated.jacobian[:, 0, place], slope, rtol=1e-5, err_msg=name)
    assert (evaluated.quantity == "brf").all()
    units = dict(zip(evaluated.inputs, evaluated.units, strict=True))
    assert units["atmosphere.pressure[1]"] == "Pa"
    assert units["albedo.C02"] == "1"
    assert units["atmosphere.liquid.number_path[0]"] == "m-2"


@pytest.mark.slow
def test_doublings_are_enough(evaluated):
    """The number that the guard takes, against the one for any layer at all."""
    many = guard.evaluate(two_columns(), BANDS, num_doublings=14, **SETTINGS)
    assert guard.excess(evaluated, many) < 1e-3


def test_a_scaled_solver(evaluated, monkeypatch):
    """All light 1.001 times too bright."""
    once, more = PROGRAM.seen_at_once, ALL_MODES.mode_sum
    monkeypatch.setattr(PROGRAM, "seen_at_once", lambda *x: 1.001 * once(*x))
    monkeypatch.setattr(ALL_MODES, "mode_sum", lambda *x: 1.001 * more(*x))
    # A number of doublings of its own, more than enough, so that no other test gets this program.
    now = guard.evaluate(two_columns(), BANDS, num_doublings=11, **SETTINGS)
    caught = guard.compare(evaluated, now).moved
    assert {entry.column for entry in caught} == {"dark", "bright"}
    assert {entry.entry for entry in caught} >= {"", "albedo.C02", "geometry.view_zenith"}


def test_a_batch_is_its_columns(evaluated):
    batch = jax.tree.map(lambda *x: jnp.stack(x), *two_columns().values())
    together = guard.evaluate(batch, BANDS, **SETTINGS)
    assert together.columns == ("0", "1")
    np.testing.assert_array_equal(together.jacobian, evaluated.jacobian)
    with pytest.raises(ValueError, match="'dark' is a batch"):
        guard.evaluate({"dark": batch}, BANDS, **SETTINGS)


def test_round_trip(evaluated, tmp_path):
    """All digits, names, units and settings come back; attributes say how it was made."""
    path = tmp_path / "new" / "base.nc"
    line = guard.baseline.history_line("saved")
    guard.write_baseline(path, guard.Baseline(evaluated, "two", {}, (line,)))
    back = guard.read_baseline(path)
    assert back.history == (line,)
    assert back.versions["jax"] == jax.__version__
    for written, read in (
        (evaluated._replace(outputs=None), back.jacobians._replace(outputs=None)),
        (evaluated.outputs, back.jacobians.outputs),
    ):
        for name, old, new in zip(written._fields, written, read, strict=True):
            if isinstance(old, np.ndarray):
                np.testing.assert_array_equal(old, new, err_msg=name)
            else:
                assert old == new, name
    with xr.open_dataset(path) as file:
        assert file.attrs["dtype"] == "float64"
        assert json.loads(file.attrs["settings"])["num_streams"] == 2
        assert file["jacobian"].dims == ("column", "band", "input")
    assert not guard.compare(evaluated, back.jacobians)
    assert [x.name for x in path.parent.iterdir()] == ["base.nc"]


def test_tolerance_of_an_entry(evaluated):
    """1e-5 of max(|K|, 1e-6 E / |x|), E the largest |K x|; each side of it."""
    i = evaluated.columns.index("dark")
    elasticity = np.abs(evaluated.jacobian[i, 0] * evaluated.state[i])
    for entry, size in (("albedo.C02", 0.05), ("atmosphere.height[1]", 5e3)):
        k = evaluated.inputs.index(entry)
        slope = evaluated.jacobian[i, 0, k]
        tolerance = 1e-5 * max(abs(slope), 1e-6 * np.nanmax(elasticity) / size)
        for share, caught in ((0.9, False), (1.1, True)):
            jacobian = evaluated.jacobian.copy()
            jacobian[i, 0, k] += share * tolerance
            found = guard.compare(evaluated, evaluated._replace(jacobian=jacobian))
            assert bool(found) is caught, (entry, share)
            if caught:
                np.testing.assert_allclose(found.moved[0].tolerance, tolerance)
                np.testing.assert_allclose(found.moved[0].excess, share, rtol=1e-4)
    for factor, caught in ((1 + 2e-11, True), (1 + 2e-13, False)):
        assert bool(guard.compare(evaluated, moved_by(evaluated, factor))) is caught


def test_what_is_absent_has_a_finite_tolerance(evaluated):
    """No droplets at all: their derivative is 0 and must stay so, in units of 1 kg m-2."""
    moved = evaluated.jacobian.copy()
    k = evaluated.inputs.index("atmosphere.liquid.mass_path[1]")
    assert (moved[..., k] == 0).all()
    moved[..., k] = 1e-10
    assert len(guard.compare(evaluated, evaluated._replace(jacobian=moved)).moved) == 2


def test_not_a_number_where_there_was_one(evaluated):
    value = np.where([[True], [False]], np.nan, evaluated.value)
    found = guard.compare(evaluated, evaluated._replace(value=value))
    assert [m.excess for m in found.moved] == [np.inf]
    night = evaluated._replace(value=value)
    assert not guard.compare(night, night)


def test_changed_defaults(evaluated, monkeypatch):
    """Of the operator: a setting that was not asked for. Of a builder: numbers of the state."""
    signature = inspect.signature(brf)
    parameters = [
        x.replace(default=1) if x.name == "num_modes" else x for x in signature.parameters.values()
    ]
    monkeypatch.setattr(brf, "__signature__", signature.replace(parameters=parameters))
    found = guard.compare(evaluated, evaluated._replace(settings=evaluation.resolved(SETTINGS)))
    assert found.changed == ["setting num_modes is {'brf': 1, 'radiance': None}, was None."]
    state = evaluated.state * (1 + 1e-11)
    found = guard.compare(evaluated, evaluated._replace(state=state))
    assert {m.entry for m in found.moved} >= {"albedo.C02", "atmosphere.pressure[1]"}
    assert all(m.quantity == "state" for m in found.moved)


def test_names_that_came_and_went(evaluated):
    fewer = guard.select(evaluated, ["bright"], BANDS, evaluated.inputs[1:])
    gone = guard.compare(evaluated, fewer).changed
    assert gone == ["column dark is gone.", "input atmosphere.pressure[0] is gone."]
    new = guard.compare(fewer, evaluated).changed
    assert new == ["column dark is new.", "input atmosphere.pressure[0] is new."]


def test_table(evaluated):
    """One row a field: which, from what, to what, by how much, against what; then the rest."""
    assert guard.report(guard.compare(evaluated, evaluated)).startswith("nothing moved in ")
    now = moved_by(evaluated, 1.0, entry="atmosphere.pressure[1]", more=1e-16)
    now = moved_by(moved_by(now, 0.99, entry="atmosphere.pressure[2]"), 1.1, "bright")
    text = guard.report(guard.compare(evaluated, now))
    header, value, slope, last = text.splitlines()
    assert header.split() == "column band entry stored now change tolerance moved".split()
    assert value.split()[:3] == ["bright", "C02", "brf"]
    assert slope.startswith("dark    C02   d brf / d atmosphere.pressure[2]")
    assert slope.split()[-1] == "2"
    assert last.startswith("3 of ")
    short = guard.report(guard.compare(evaluated, now), num_rows=1)
    assert short.splitlines()[2] == "... and 1 more rows."


def run(*arguments):
    return CliRunner().invoke(make_app(), ["jacobian", *map(str, arguments)])


@pytest.fixture
def saved(tmp_path, evaluated):
    path = tmp_path / "base.nc"
    found = run("save", path, "--scenario", SCENARIO, "--bands", "C02", "--num-streams", 2)
    assert found.exit_code == 0, found.output
    assert "2 columns, 1 bands" in found.output
    return path


def test_commands(saved, evaluated, monkeypatch):
    """Saved, checked, moved, accepted, checked again; the reason stays in the file."""
    where = ("--scenario", SCENARIO)
    same = run("check", saved, *where)
    assert same.exit_code == 0, same.output
    assert "nothing moved" in same.output
    same = run("accept", saved, "--reason", "none", *where)
    assert "stays as it is" in same.output
    now = moved_by(evaluated, 1.001)
    monkeypatch.setattr(guard.workflow, "evaluate", lambda *_, **__: now)
    moved = run("check", saved, *where)
    assert moved.exit_code == 1
    assert "dark" in moved.output
    assert f"abi-operator jacobian accept {saved} --scenario {SCENARIO} --reason" in moved.output
    assert run("accept", saved, *where, "--reason", " ").exit_code == 2
    accepted = run("accept", saved, *where, "--reason", "a better sun")
    assert accepted.exit_code == 0
    assert run("check", saved, *where).exit_code == 0
    history = guard.read_baseline(saved).history
    assert len(history) == 2
    assert "accepted: a better sun; 1 of " in history[1]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["check", "none.nc"], "none.nc does not exist"),
        (["check", __file__], "cannot be read as NetCDF"),
        (["save", "x.nc", "--scenario", "two_columns"], "names no function"),
        (["save", "x.nc", "--scenario", "nowhere.py:f"], "nowhere.py does not exist"),
        (["save", "x.nc", "--scenario", "no.such.module:f"], "does not load (ModuleNotFoundError"),
        (["save", "x.nc", "--scenario", "guarded:f"], "guarded has no function 'f'"),
        (["save", "x.nc", "--scenario", "guarded:nothing"], "returned NoneType where states"),
        (["save", "x.nc", "--scenario", "guarded:broken"], "failed (RuntimeError: no levels)"),
        (["save", "x.nc", "--scenario", "guarded:two_columns", "--bands", "C09"], "'C09'"),
        (["save", "x.nc", "--scenario", "guarded:two_columns", "--bands", "C07"],
         "no state is specified for C07"),
        (["save", ".", "--scenario", "guarded:two_columns", "--bands", "C02", "--num-streams", 2],
         ". is a folder"),
    ],
)  # fmt: skip
def test_bad_input_is_one_sentence(arguments, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = run(*arguments)
    assert found.exit_code == 2, found.output
    assert sentence in found.output
    assert "Traceback" not in found.output
    assert found.output.startswith("abi-operator: ")
    assert len(found.output.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_a_file_runs_no_code_of_its_choice(saved):
    found = run("check", saved)
    assert found.exit_code == 2
    assert "say with --scenario where that is now" in found.output


def test_a_file_that_is_no_baseline(tmp_path):
    path = tmp_path / "other.nc"
    xr.Dataset({"x": 1.0}).to_netcdf(path)
    with pytest.raises(InputError, match="is no baseline"):
        guard.read_baseline(path)


def test_states_of_the_fixture(tmp_path, evaluated):
    """No file: says how to write it; another setting than in the file: says so."""
    path, states = tmp_path / "base.nc", two_columns()
    assert "does not exist; write it with pytest --jacobian-accept" in guard.guard_states(
        path, states, BANDS, **SETTINGS
    )
    assert not path.exists()
    assert guard.guard_states(path, states, BANDS, reason="first", **SETTINGS) == ""
    assert guard.guard_states(path, states, BANDS, **SETTINGS) == ""
    other = guard.guard_states(path, states, BANDS, num_doublings=14, **SETTINGS)
    assert "setting num_doublings is 14, was 8." in other
    assert guard.guard_states(path, states, BANDS, reason="y", num_doublings=14, **SETTINGS) == ""
    assert [line.split(": ")[1][0] for line in guard.read_baseline(path).history] == ["f", "y"]
