"""README's code runs, and its test line is the one that the full check runs."""

import re
from pathlib import Path

import numpy as np
from readme import README, run_block

ROOT = Path(__file__).parents[1]


def test_the_operators_blocks_run():
    names = run_block(1)
    slope = names["K"].atmosphere.plumes["smoke"].ssa["C01"]
    assert slope.shape == names["rho"].shape == (7,)
    assert slope[0] > 0 and (slope[1:] == 0).all()
    names = run_block(2, names)
    seen = names["observe_mean"](names["seen"][-1], "C07")
    assert seen.saturated and abs(seen.brightness_temperature - 411.86) < 0.01


def test_the_solvers_block_runs():
    names = run_block(3)
    # Two solves of the same columns, in one of which the ground is a closed form.
    np.testing.assert_allclose(names["response"].brf(0.1), names["brf"], rtol=1e-12)
    np.testing.assert_allclose(names["quick"], names["brf"], rtol=1e-3)
    assert 0.4 < names["share"] < 0.7 and names["warm"] > 0


def test_the_test_line_is_the_one_of_the_full_check():
    (line,) = re.findall(r"python (-P -m pytest .*)\n", README)
    assert f'"$python" {line}\n' in (ROOT / ".ci" / "run").read_text()


def test_files_and_commands_that_it_names_exist():
    for name in re.findall(r"(?:examples|tests|benchmarks|abi_operator)/[\w/]+\.\w+", README):
        assert (ROOT / name).exists(), name
