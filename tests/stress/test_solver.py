"""The columns and checks of `benchmarks/stress.py`, sampled."""

import jax
import numpy as np
import pytest
import stress
import stress_again
import stress_truth
from stress_checks import BUDGET, BUDGET_FLOOR, LIMITS, Judged, refused, value
from stress_code import PACKAGE, sources
from stress_columns import STRATA
from stress_report import failed

# Streams, layers at most and at least, whether they emit, columns: few streams, for a program takes
# longer to compile than its columns to solve.
SUNLIT = (2, 4, 1, False, 204, 1.0)
EMITTING = (2, 4, 1, True, 102, 1.0)
# The full check has thousands of such batches from the command itself.
SAMPLED = [(SUNLIT, "float64"), (SUNLIT, "float32"), (EMITTING, "float64")]


def wrong(group, index, precision):
    """Columns of a batch that fail, by check."""
    batch = stress.columns_of(group, index, precision)
    errors = Judged(batch.columns, batch.further, group[0], [group[0], index]).all()
    found = {}
    for name, error in errors.items():
        rows = np.flatnonzero(failed({name: error}, name, precision))
        if rows.size:
            strata = [list(STRATA)[batch.stratum[i]] for i in rows]
            found[name] = list(zip(rows.tolist(), strata, error[rows].tolist(), strict=True))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(("group", "precision"), SAMPLED)
def test_nothing_fails(group, precision):
    assert wrong(group, 0, precision) == {}


@pytest.mark.parametrize("precision", stress.PRECISIONS)
def test_numbers_out_of_range_are_refused_by_name(precision):
    columns = stress.columns_of(EMITTING, 0, precision).columns
    columns["solar_irradiance"] += 1  # without a sun its place is not asked
    for name, (offered, named) in refused(columns, EMITTING[0]).items():
        assert offered > 1 and named == offered, name


def test_extremes_agree_with_40_digits():
    """A column of every stratum."""
    columns, streams = stress.columns_of(SUNLIT, 0, "float64").columns, SUNLIT[0]
    found = value(columns, num_streams=streams)
    rows = range(1, len(STRATA) + 1)
    assert max(stress_truth.error(columns, i, streams, found[i]) for i in rows) < 1e-10


LOST = {
    "forward peak of g = 0.999": ((8, 16), False, 119, 661),  # modes 3 to 6: -8e-5 to 2e-4 of 7e-3
    "three modes small by chance": ((8, 16), False, 40, 618),  # 3 to 5: 2e-6 to 5e-6 of 0.024
    "backward peak": ((16, 16), True, 39, 109),  # 6 to 8: -1e-3, 3e-4, -1e-4, then 9e-2 of 0.5
    "modes that cancel": ((4, 64), False, 84, 702),  # 0 to 3: 1.26, -1.12, -0.17, 0.03
}


@pytest.mark.slow
@pytest.mark.parametrize(("which", "emits", "index", "row"), LOST.values(), ids=LOST)
def test_columns_of_which_a_budget_once_lost_much(which, emits, index, row):
    (group,) = (g for g in stress.GROUPS if g[:2] == which and g[3] == emits)
    batch = stress.columns_of(group, index, "float64").columns
    one = {name: x[row : row + 1] for name, x in batch.items() if name != "secant"}  # in a plane
    whole, within = (value(one, num_streams=which[0], error_budget=x) for x in (None, BUDGET))
    np.testing.assert_allclose(within, whole, rtol=BUDGET, atol=BUDGET * BUDGET_FLOOR)


def test_signs_that_the_equations_have_are_told_from_those_of_rounding():
    """Two streams and a phase function that no two moments can hold: well below 0 to 40 digits."""
    (group,) = (g for g in stress.GROUPS if g[:2] == (2, 1))
    columns = stress.columns_of(group, 1, "float64").columns
    row = int(np.argmin(np.where(columns["albedo"] == 0, value(columns, num_streams=2), 0)))
    assert stress_truth.falls(columns, row, 2) > 0.2
    assert not stress_truth.falls(stress.columns_of(SUNLIT, 0, "float64").columns, 17, 2)


def test_albedos_that_the_equations_have_are_told_from_those_of_rounding():
    """Of a column that absorbs nearly all, under so few moments; then as much too much of it."""
    (group,) = (g for g in stress.GROUPS if g[:2] == (8, 16) and not g[3])
    rows, place = np.zeros(2, stress.FIELDS), (stress.GROUPS.index(group), 103, 174)
    rows["absorption"] = 1.1e-8, 2.2e-8
    stress_again.without_albedos_of_the_equations(rows, np.array([place, place]), "float64")
    assert np.isnan(rows["absorption"]).tolist() == [True, False]


def test_a_long_run_hangs_on_the_code_that_draws_solves_and_checks():
    """And on nothing else, such as commands: what those files import is among them."""
    found = {x.relative_to(PACKAGE).as_posix() for x in sources() if x.is_relative_to(PACKAGE)}
    assert {"solver/door.py", "machine/told.py", "solver/skipping/one_pass.py"} <= found
    assert {"optics/mie_phase.py", "ranges.py", "satellites.py", "planck.py"} <= found
    assert any(x.startswith("optics/tables/") for x in found)
    others = {"cli.py", "commands.py", "simulation.py", "bands_of_states.py"}
    assert not others & found and not any(x.startswith(("scene/", "guard/")) for x in found)
    assert {x.name for x in sources()} >= {"stress_columns.py", "stress_checks.py"}


def of_many(function):
    """A function of columns by the program of a whole batch: of one column, as often as that has
    columns."""

    def asked(columns, *arguments, **how):
        batch = {name: np.repeat(x, SUNLIT[4], axis=0) for name, x in columns.items()}
        found = function(batch, *arguments, **how)
        return jax.tree.map(lambda x: np.asarray(x)[:1] if np.ndim(x) else x, found)

    return asked


def test_a_longer_step_compares_the_same_slope(monkeypatch):
    """Of one column, as the check does of a batch."""
    for name in ("value", "both"):
        monkeypatch.setattr(stress_again, name, of_many(getattr(stress_again, name)))
    found = stress_again.over_a_longer_step(SUNLIT, 0, 0, "float64")
    # A third derivative times the square of 1e-3.
    assert all(error < 1e-5 for error in found.values()) and found["slope"] > 0


def test_columns_that_absorb_are_not_left_to_energy(monkeypatch):
    """Of three that fail one absorbs nothing; in another the ground does, and in one the air."""
    batch = stress.columns_of(SUNLIT, 0, "float64")
    own = {name: batch.columns[name].copy() for name in ("tau", "ssa", "albedo")}
    own["tau"][:3], own["ssa"][:3], own["albedo"][:3] = 1.0, 1.0, 1.0
    own["albedo"][1], own["ssa"][2, 0] = 1 - 1e-9, 1 - 1e-9
    changed = batch._replace(columns=batch.columns | own)
    monkeypatch.setattr(stress_again, "columns_of", lambda *_: changed)
    rows = np.zeros(4, stress.FIELDS)
    rows["absorption"][:3] = 2 * LIMITS["absorption"][0]
    stress_again.without_what_is_conserved(rows, [(0, 0, row) for row in range(4)], "float64")
    assert np.isnan(rows["absorption"]).tolist() == [True, False, False, False]


def test_columns_follow_from_the_name_of_their_batch():
    """What makes a run that was stopped go on to the same bytes."""
    first, again = (stress.columns_of(SUNLIT, 3, "float64") for _ in range(2))
    jax.tree.map(np.testing.assert_array_equal, first, again)
    other = stress.columns_of(SUNLIT, 4, "float64")
    assert not np.array_equal(first.columns["tau"], other.columns["tau"])


# Batches without a column that is asked with twice the streams, for which programs are compiled.
UNDOUBTED = (0, 4)


def test_a_batch_that_is_there_is_not_made_again(tmp_path):
    names = [stress.place(tmp_path, SUNLIT, i, "float64") for i in UNDOUBTED]
    stress.judge((tmp_path, SUNLIT, UNDOUBTED, "float64"))
    whole = [path.read_bytes() for path in names]
    names[1].unlink()
    _, seconds = stress.judge((tmp_path, SUNLIT, UNDOUBTED, "float64"))
    assert len(seconds) == 1
    assert [path.read_bytes() for path in names] == whole
    assert sorted(tmp_path.iterdir()) == sorted(names)
