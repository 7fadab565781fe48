"""Which shares of an error budget keep it: the fit behind `abi_operator/solver/skipping/budget.py`.

    python benchmarks/fit_budget.py [--shares OF_MERGING=0.5,OF_MODES=0.5 OF_MERGING=0.25 ...]

Every set of shares in its turn (those not named stay as they are; a first row has them all as they
are), on the columns of `pareto_columns` of seeds below `skipping.FIRST_SEED`, from which on
`skipping.py` judges. Of each seed the 99th percentile of the error of brf and its largest, and of
the first seed's slopes the 99th percentile; the table has the worst seed's, as parts of what is
allowed: the budget, ten times it, and 1 %. Beside them stand processor microseconds a column, of
both cores together. A set is kept whose worst part leaves room, as seeds differ by a third.
"""

import argparse
import time
from contextlib import contextmanager
from typing import Any

import jax
import numpy as np
from pareto_columns import columns
from skipping import FIRST_SEED, GRADIENT_BUDGET, errors, gradient, value

from abi_operator.solver.skipping import budget

SEEDS = range(5)
NUM_LAYERS = 36
CASES = (("W1", 8), ("W1", 20), ("W2", 8), ("W2", 12), ("W2", 24), ("W3", 4), ("W4", 12))
SETS = (
    "OF_MERGING=0.5",
    "OF_MERGING=0.2",
    "OF_MODES=0.5",
    "OF_MODES=0.1",
    "OF_MODES_OF_SLOPES=1e-3",
    "OF_MODES_OF_SLOPES=1e-4",
    "DECAY=0.15",
    "OF_FAINT=1.4",
    "OF_FAINT=0.35",
)


@contextmanager
def standing_in(module: Any, given: dict[str, float]):
    """In this block a module has these numbers, and so have programs that are traced meanwhile."""
    before = {name: getattr(module, name) for name in given}
    for name, number in given.items():
        setattr(module, name, number)
    try:
        yield
    finally:
        for name, number in before.items():
            setattr(module, name, number)


def read(text):
    """Names and shares of `NAME=0.1,NAME=0.2`."""
    pairs = [x.split("=") for x in text.split(",") if x]
    return {name: float(share) for name, share in pairs}


def row(cases, exact, options):
    """Worst part of what is allowed: of values, of the largest, of slopes; and microseconds."""
    tail, largest = 0.0, 0.0
    for given, whole in zip(cases, exact["value"], strict=True):
        wrong = errors(value(**options)(given), whole)
        # NumPy's larger of two, which no NaN passes.
        tail = np.maximum(tail, np.quantile(wrong, 0.99) / options["error_budget"])
        largest = np.maximum(largest, wrong.max() / options["error_budget"] / 10)
    start = time.process_time()
    value(**options)(cases[0])
    micros = 1e6 * (time.process_time() - start) / len(cases[0]["mu0"])
    wrong = errors(gradient(**options)(cases[0]), exact["slopes"])
    slopes = float(np.quantile(wrong, 0.99)) / max(GRADIENT_BUDGET, options["error_budget"])
    return tail, largest, slopes, micros


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--shares", nargs="+", default=list(SETS))
    parser.add_argument("--columns", type=int, default=1024)
    parser.add_argument("--budget", type=float, default=1e-3)
    parser.add_argument("--cases", nargs="+", default=[f"{w}:{s}" for w, s in CASES])
    args = parser.parse_args()
    assert max(SEEDS) < FIRST_SEED
    jax.config.update("jax_enable_x64", True)
    print(f"budget {args.budget:g}, {len(SEEDS)} seeds of {args.columns} columns\n")
    print("| workload | streams | shares | value p99 | largest | slopes p99 | value [cpu us] |")
    print("| --- " * 7 + "|")
    for case in args.cases:
        workload, streams = case.split(":")
        drawn = [columns(workload, args.columns, s, num_layers=NUM_LAYERS) for s in SEEDS]
        given = [x.arguments(int(streams)) for x in drawn]
        whole = {"num_streams": int(streams)}
        exact = {
            "value": [value(**whole)(x) for x in given],
            "slopes": gradient(**whole)(given[0]),
        }
        for k, text in enumerate(["", *args.shares]):
            # Budgets that differ in their last digits are compiled apart.
            options = whole | {"error_budget": args.budget * (1 + 1e-9 * k)}
            with standing_in(budget, read(text)):
                tail, largest, slopes, micros = row(given, exact, options)
            cells = f"{text or 'as they are'} | {tail:.2f} | {largest:.2f} | {slopes:.2f}"
            print(f"| {workload} | {streams} | {cells} | {micros:.1f} |", flush=True)


if __name__ == "__main__":
    main()
