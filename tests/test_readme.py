"""README's code runs, and its test line is the one that the full check runs."""

import re
from pathlib import Path

import numpy as np
import pytest
import stress_columns
from readme import README, run_block

from abi_operator.files.fires import _ALLOWED as FIRES
from abi_operator.ranges import SOLVER, STATE, WEATHER

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
def test_the_operators_blocks_run():
    names = run_block(1)
    slope = names["K"].atmosphere.plumes["smoke"].ssa["C01"]
    assert slope.shape == names["rho"].shape == (7,)
    assert slope[0] > 0 and (slope[1:] == 0).all()
    names = run_block(2, names)
    seen = names["observe_mean"](names["seen"][-1], "C07")
    assert seen.saturated and abs(seen.brightness_temperature - 411.86) < 0.01


@pytest.mark.slow
def test_the_solvers_block_runs():
    names = run_block(3)
    # Two solves of the same columns, in one of which the ground is a closed form.
    np.testing.assert_allclose(names["response"].brf(0.1), names["brf"], rtol=1e-12)
    np.testing.assert_allclose(names["quick"], names["brf"], rtol=1e-3)
    assert 0.4 < names["share"] < 0.7 and names["warm"] > 0


def test_the_test_line_is_the_one_of_the_full_check():
    (line,) = re.findall(r"python (-P -m pytest .*)\n", README)
    assert f'"$python" {line}\n' in (ROOT / ".ci" / "run").read_text()


def test_what_the_full_check_asks_by_name_is_there():
    """A test of another name would be left out without a word."""
    named = set(re.findall(r"\btest_\w+(?:\.py)?", (ROOT / ".ci" / "run").read_text()))
    paths = list((ROOT / "tests").rglob("test_*.py"))
    written = "".join(path.read_text() for path in paths)
    found = {path.name for path in paths} | set(re.findall(r"^def (test_\w+)", written, re.M))
    assert len(named) > 10 and named <= found, named - found


def test_files_and_commands_that_it_names_exist():
    for name in re.findall(r"(?:examples|tests|benchmarks|abi_operator)/[\w/]+\.\w+", README):
        assert (ROOT / name).exists(), name


def test_every_benchmark_is_on_the_page_of_results():
    """Or is a part that another one runs; and every page of results is to be found there."""
    folder = ROOT / "benchmarks"
    page, scripts = (folder / "README.md").read_text(), list(folder.glob("*.py"))
    codes = {path: path.read_text() for path in scripts}
    for path, code in codes.items():
        if "__main__" in code:
            others = (x for other, x in codes.items() if other != path)
            assert path.name in page or any(path.stem in x for x in others), path.name
    linked = set(re.findall(r"\]\((results/\w+\.md|TRIED\.md)\)", page))
    assert linked == {"TRIED.md", *(f"results/{x.name}" for x in (folder / "results").glob("*"))}
    for name in re.findall(r"`(\w+\.py)", page.split("## Scripts")[0]):
        assert (folder / name).exists(), name


def test_its_ranges_are_those_that_are_checked():
    rows = dict(re.findall(r"^\| `(\w+)` \| ([^|]+) \| [^|]+ \|$", README, re.MULTILINE))
    assert {name: rows[name] for name in SOLVER} == {name: x.words for name, x in SOLVER.items()}
    (said,) = re.findall(r"^\| `temperature` of a fire \| ([^|]+) \|", README, re.MULTILINE)
    assert said == FIRES["temperature"].words
    (said,) = re.findall(r"^\| `temperature` of the air \| ([^|]+) \|", README, re.MULTILINE)
    assert said == WEATHER["temperature"].words
    for name in ("surface_temperature", "mass_path", "wind_speed"):
        assert f"| `{name}` | {WEATHER[name].words} |" in README
    assert f"| zenith angles of sun and view | {STATE['solar_zenith'].words} |" in README


def test_columns_reach_what_it_says_was_asked():
    columns = [stress_columns.draw([0, i], 400, 2, 4, 1, True).columns for i in range(3)]
    found = {name: np.concatenate([x[name] for x in columns]) for name in columns[0]}
    tau, ssa = found["tau"], found["ssa"]
    assert tau.max() == 1e5 and {0.0, 1e-15} <= set(tau.ravel())
    assert {0.0, 1e-12, 1 - 1e-15, 1.0} <= set(ssa.ravel())
    np.testing.assert_allclose(found["moments"][..., 1].min(), -0.9)
    np.testing.assert_allclose(found["moments"][..., 1].max(), 0.999)
    for name, (low, high) in {"albedo": (0, 1), "mu0": (1e-3, 1), "mu": (1e-3, 1)}.items():
        assert found[name].min() == low and found[name].max() == high
    assert -np.pi <= found["relative_azimuth"].min() < -3
    assert 6 < found["relative_azimuth"].max() <= 2 * np.pi
    coldest, hottest = stress_columns.black_body(np.array([200.0, 1500.0]))
    for name in ("planck_levels", "surface_emission", "isotropic_top"):
        assert found[name].max() <= hottest
    assert coldest <= found["planck_levels"].min() < 2 * coldest
    assert max(layers for _, layers, *_ in stress_columns.GROUPS) == 200
