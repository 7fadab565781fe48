"""What an error budget leaves out of the solver's work, what that saves, and what it costs.

    python benchmarks/skipping.py [--columns 4096] [--budget 1e-3] [--workloads W1 W2 W4]

Columns of `pareto_columns`, at 8 streams unless told otherwise: microseconds a column of the value
and of value and gradient, with nothing left out, with each kind of skipping alone, and with all of
them; beside it the error |brf - all of it| / max(all of it, 0.01) at equal streams and that of the
gradient (of the column's slopes in all its arguments, norm of the difference over the norm): p50,
p99, largest. The shares of the budget (`abi_operator/solver/skipping/budget.py`) were fitted on
seeds below `FIRST_SEED`; this script draws from there on. `--workloads C07` has those columns of W3
that emit, whose errors are those of pi L / (mu0 F0). Float64, NumPy to NumPy, medians of
interleaved rounds, compiling apart. `--check` exits with 1 where the budget is not kept: p99 within
it, the largest below ten times it, the gradient's p99 within 1 %.
"""

import argparse
import sys
import time
from collections.abc import Callable
from contextlib import contextmanager
from typing import Any

import jax
import numpy as np
from pareto_columns import columns

from abi_operator import __version__
from abi_operator.solver import toa_brf, toa_radiance
from abi_operator.solver.skipping import budget, company

FIRST_SEED = 1000
GRADIENT_BUDGET = 1e-2
LEAST_BRF = 0.01
EMITTING = "C07"
# Shares of the budget, and the least of it, with which a kind of skipping leaves nothing out.
NOTHING = {
    "OF_MERGING": -1.0,
    "OF_MODES": 1e-12,
    "OF_NO_MODES": -1.0,
    "OF_MODES_OF_SLOPES": 1e-12,
    "OF_DOUBLINGS": 1e-6,
    "OF_DOUBLINGS_WARM": 1e-6,
    "OF_FAINT": -1.0,
    "SINGLE_FROM": np.inf,
}
MODES = {"OF_MODES", "OF_NO_MODES", "OF_MODES_OF_SLOPES"}
DOUBLINGS = {"OF_DOUBLINGS", "OF_DOUBLINGS_WARM"}

# What each row does without.
ROWS = {
    "nothing left out": None,
    "layers that are alike": {*MODES, *DOUBLINGS, "OF_FAINT", "SINGLE_FROM"},
    "azimuth modes": {"OF_MERGING", *DOUBLINGS, "OF_FAINT", "SINGLE_FROM"},
    "doublings": {"OF_MERGING", *MODES, "OF_FAINT", "SINGLE_FROM"},
    "faint columns": {"OF_MERGING", *MODES, *DOUBLINGS, "SINGLE_FROM"},
    "single precision": {"OF_MERGING", *MODES, *DOUBLINGS, "OF_FAINT"},
    "all, columns as they come": {"order"},
    "all": set(),
}


@contextmanager
def without(kinds):
    """Nothing of these kinds is skipped by programs that are traced meanwhile."""
    shares = {k: getattr(budget, k) for k in kinds - {"order"}}
    for name in shares:
        setattr(budget, name, NOTHING[name])
    sorted_from = company.SORTED_FROM
    if "order" in kinds:
        company.SORTED_FROM = sys.maxsize
    try:
        yield
    finally:
        company.SORTED_FROM = sorted_from
        for name, share in shares.items():
            setattr(budget, name, share)


def drawn(name, args):
    """Arguments of columns of a workload, or of those of W3 that emit."""
    if name != EMITTING:
        return columns(name, args.columns, args.seed).arguments(args.streams)
    given = columns("W3", 3 * args.columns, args.seed)
    given = given.rows(np.flatnonzero(given.emits)[: args.columns])
    return given.arguments(args.streams, emits=True)


def door(given):
    return toa_radiance if "solar_irradiance" in given else toa_brf


def value(**how) -> Callable[[dict], np.ndarray]:
    return lambda given: np.asarray(door(given)(**given, **how))


def gradient(**how) -> Callable[[dict], Any]:
    """Slopes of the sum, of which each column's are its own."""
    slopes = jax.grad(lambda given: door(given)(**given, **how).sum())
    return lambda given: jax.tree.map(np.asarray, slopes(given))


def flat(slopes):
    count = len(slopes["mu0"])
    return np.concatenate([x.reshape(count, -1) for x in slopes.values()], axis=1)


def dark(given):
    """The least light that an error is compared with."""
    if "solar_irradiance" not in given:
        return LEAST_BRF
    return LEAST_BRF * given["solar_irradiance"] * given["mu0"] / np.pi


def errors(found, exact, least=LEAST_BRF):
    if isinstance(exact, dict):
        found, exact = flat(found), flat(exact)
        return np.linalg.norm(found - exact, axis=1) / np.linalg.norm(exact, axis=1)
    return np.abs(found - exact) / np.maximum(exact, least)


def measured(programs, given, repeats):
    """Results, and median microseconds a column, of programs called in turns."""
    results, seconds = {}, {name: [] for name in programs}
    for name, (kinds, program) in programs.items():
        with without(kinds):
            results[name] = program(given)
    for _ in range(repeats):
        for name, (kinds, program) in programs.items():
            with without(kinds):  # chunks of columns in order are others
                start = time.perf_counter()
                program(given)
                seconds[name].append(time.perf_counter() - start)
    scale = 1e6 / len(given["mu0"])
    return results, {name: scale * float(np.median(x)) for name, x in seconds.items()}


def programs(make, num_streams, error_budget):
    """One a row: budgets differ in their last digits, so that each is compiled by itself."""
    made = {}
    for k, (name, kinds) in enumerate(ROWS.items()):
        own = None if kinds is None else error_budget * (1 + 1e-9 * k)
        made[name] = kinds or set(), make(num_streams=num_streams, error_budget=own)
    return made


def study(name, given, args):
    """Rows of one workload, for values and for gradients; whether the budget is kept."""
    head = f"{name}, {given['tau'].shape[1]} layers, {args.columns} columns, {args.streams} streams"
    print(f"{head}, budget {args.budget:g}\n")
    print(
        "| solved | value [us] | times | p50 | p99 | largest | with gradient [us] | times ", end=""
    )
    print("| p50 | p99 |\n" + "| --- " * 10 + "|")
    tables = [
        measured(programs(make, args.streams, args.budget), given, args.repeats)
        for make in (value, gradient)
    ]
    kept = True
    for row in ROWS:
        cells = []
        for (results, micros), is_value in zip(tables, (True, False), strict=True):
            first = next(iter(ROWS))
            wrong = errors(results[row], results[first], dark(given))
            p50, p99, largest = np.median(wrong), np.quantile(wrong, 0.99), wrong.max()
            cells += [f"{micros[row]:.2f}", f"{micros[first] / micros[row]:.1f}"]
            cells += [f"{x:.0e}" for x in ((p50, p99, largest) if is_value else (p50, p99))]
            if is_value:
                kept &= bool(p99 <= args.budget and largest <= 10 * args.budget)
            else:
                kept &= bool(p99 <= max(GRADIENT_BUDGET, args.budget))
        print(f"| {row} | {' | '.join(cells)} |")
    print()
    return kept


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--columns", type=int, default=4096)
    parser.add_argument("--streams", type=int, default=8)
    parser.add_argument("--budget", type=float, default=1e-3)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--workloads", nargs="+", default=["W1", "W2", "W4"])
    parser.add_argument("--seed", type=int, default=FIRST_SEED)
    parser.add_argument("--check", action="store_true")
    args = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    print(f"abi-operator {__version__}, jax {jax.__version__}, {jax.default_backend()}, float64\n")
    kept = [study(name, drawn(name, args), args) for name in args.workloads]
    if args.check and not all(kept):
        sys.exit("the budget is not kept")


if __name__ == "__main__":
    main()
