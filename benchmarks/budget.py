"""Whether an error budget is kept: columns of scenes and random extremes, in equal shares.

    python benchmarks/budget.py [--columns 100000] [--streams 32] [--only W2 extremes] [--check]

A fifth of the columns each are images of smoke and ash (W1), of clouds (W2), clear and fire pixels
of which C07 emits (W3), a retrieval's (W4), all of `pareto_columns` and of seeds that
`fit_budget.py` does not see, and the random extremes of `stress_columns`. Each is solved within the
budget and with nothing left out, at as many streams; the error is |brf - all of it| / max(all of
it, 0.01), pi L / (mu0 F0) of what emits. Kept is the budget where 99 of 100 columns of a share are
within it, and none is further off than ten times that; `--check` exits with 1 where it is not.
`--truth` columns of each share of scenes are solved by twice the streams as well: what the streams
leave, beside what both leave together.
"""

import argparse
import platform
import sys
import time
from functools import partial

import jax
import numpy as np
import pareto_ours as ours
from pareto_columns import ITERATES, columns
from rounds import table
from stress_columns import draw

from abi_operator import __version__, use_compilation_cache
from abi_operator.machine.speed import usable_cores
from abi_operator.solver import toa_brf

FIRST_SEED = 7000
NUM_LAYERS = 32
CALL = 2000  # columns of a call
SCENES = ("W1", "W2", "W3", "W4")
EXTREMES = "extremes"
SHARES = (*SCENES, EXTREMES)


def scene_calls(workload, count):
    """Columns of a workload, so many a call, of a seed each."""
    for number, start in enumerate(range(0, count, CALL)):
        make = partial(columns, workload, min(CALL, count - start), FIRST_SEED + number)
        iterate = {"iterate": number % ITERATES} if workload == "W4" else {}
        yield make(num_layers=NUM_LAYERS, **iterate)


def of_scene(given, options):
    """brf of columns of a scene."""
    parts = ours.parts_of(given, options["num_streams"])
    return ours.as_brf(parts, ours.value(parts, options))


def scene_errors(workload, count, options, budget, num_true):
    """Errors of one share, and of its first columns beside twice the streams."""
    found, truths = [], None
    for given in scene_calls(workload, count):
        whole = of_scene(given, options)
        within = of_scene(given, options | {"error_budget": budget})
        found.append(ours.relative_error(within, whole))
        if truths is None and num_true:
            some = given.rows(np.linspace(0, given.count - 1, min(num_true, CALL)).astype(int))
            true = of_scene(some, {"num_streams": 2 * options["num_streams"]})
            each = (options, options | {"error_budget": budget})
            truths = [ours.relative_error(of_scene(some, how), true) for how in each]
    return np.concatenate(found), truths


def extreme_errors(count, options, budget):
    """Errors of random extremes without emission."""
    found = []
    for number, start in enumerate(range(0, count, CALL)):
        size, streams = min(CALL, count - start), options["num_streams"]
        given = draw([FIRST_SEED, number], size, streams, NUM_LAYERS, 1, False).columns
        whole = np.asarray(toa_brf(**given, **options))
        within = np.asarray(toa_brf(**given, **options, error_budget=budget))
        found.append(ours.relative_error(within, whole))
    return np.concatenate(found)


def cells(error):
    return [f"{x:.1e}" for x in (*np.quantile(error, (0.5, 0.99, 0.999)), error.max())]


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--columns", type=int, default=100_000)
    parser.add_argument("--streams", type=int, default=32)
    parser.add_argument("--budget", type=float, default=1e-3)
    parser.add_argument("--only", nargs="+", choices=SHARES, default=SHARES, help="shares")
    parser.add_argument("--truth", type=int, default=500, help="columns of a share; 0 for none")
    parser.add_argument("--check", action="store_true")
    args = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    use_compilation_cache()
    print(f"abi-operator {__version__}, jax {jax.__version__}, {platform.machine()}, ", end="")
    print(f"{usable_cores()} cores, float64; {args.columns} columns of {NUM_LAYERS} layers, ")
    print(f"{args.streams} streams, budget {args.budget:g}\n", flush=True)
    share, options, started = args.columns // 5, {"num_streams": args.streams}, time.perf_counter()
    rows, beside, kept = [], [], True
    for name in args.only:
        truths = None
        if name == EXTREMES:
            error = extreme_errors(share, options, args.budget)
        else:
            error, truths = scene_errors(name, share, options, args.budget, args.truth)
        inside = np.quantile(error, 0.99) <= args.budget and error.max() <= 10 * args.budget
        kept &= bool(inside)
        rows.append([name, str(error.size), *cells(error), "yes" if inside else "no"])
        if truths is not None:
            beside.append([name, str(truths[0].size), *cells(truths[0]), *cells(truths[1])])
        print(f"{name}: {time.perf_counter() - started:.0f} s", flush=True)
    quantiles = ["p50", "p99", "p99.9", "largest"]
    print()
    table(["columns of", "columns", *quantiles, "kept"], rows)
    if beside:
        print(
            f"\nBeside {2 * args.streams} streams, with nothing left out and within the budget:\n"
        )
        table(["columns of", "columns", *quantiles, *(f"{x}, budget" for x in quantiles)], beside)
    sys.exit(1 if args.check and not kept else 0)


if __name__ == "__main__":
    main()
