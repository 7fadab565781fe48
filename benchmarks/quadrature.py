"""The solver's nodes beside Gauss's: what streams leave of the error with each.

    python benchmarks/quadrature.py [--workloads W1 W2] [--columns 40]

prints, for workloads of `pareto_columns` and numbers of streams, the median and the 99th percentile
of the relative error of brf with nothing skipped, against 64 streams of Gauss's nodes, over columns
of the seeds 100 to 104, which `pareto` does not time. The time is the same with either.
"""

import argparse

import jax
import numpy as np
import pareto_ours as ours
from pareto_streams import SEEDS, drawn
from rounds import table

from abi_operator.solver import on_double_gauss

STREAMS = (4, 6, 8, 10, 16)


def errors(samples, true, num_streams):
    found = [ours.truth(x, num_streams=num_streams) for x in samples]
    each = [ours.relative_error(x, y) for x, y in zip(found, true, strict=True)]
    return [f"{x:.1e}" for x in np.percentile(np.concatenate(each), (50, 99))]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--workloads", nargs="+", default=["W1", "W2"])
    parser.add_argument("--columns", type=int, default=40, help="of each seed")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    rows = []
    for workload in options.workloads:
        samples = [drawn(workload, seed, options.columns) for seed in SEEDS]
        with on_double_gauss():
            true = [ours.truth(x) for x in samples]
            gauss = [errors(samples, true, n) for n in STREAMS]
        own = [errors(samples, true, n) for n in STREAMS]
        rows += [[workload, n, *x, *y] for n, x, y in zip(STREAMS, gauss, own, strict=True)]
    table(["workload", "streams", "Gauss: median", "p99", "ours: median", "p99"], rows)


if __name__ == "__main__":
    main()
