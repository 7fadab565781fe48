"""What streams leave of the error on columns that `pareto` does not time: how its own were fixed.

    python benchmarks/pareto_streams.py [--workloads W1 W2] [--columns 100]

prints, for each workload and number of streams, the 99th percentile and the largest error of brf
with nothing skipped, against 64 streams, over columns of the seeds 100 to 104.
`pareto_ours.STREAMS` has the fewest streams that leave room for skipping.
"""

import argparse

import jax
import numpy as np
import pareto_columns
import pareto_ours as ours
from rounds import table

SEEDS = range(100, 105)
STREAMS = {
    "W1": (8, 10, 12, 16),
    "W2": (8, 10, 12, 16, 20, 24, 28, 32),
    "W3": (2, 4, 6),
    "W4": (8, 10, 12, 16),
}


def drawn(workload, seed, count):
    """A random sample of an image of 40 layers."""
    columns = pareto_columns.columns(workload, 10 * count, seed, shuffled=True, num_layers=40)
    return columns.first(count)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--workloads", nargs="+", default=list(STREAMS), choices=STREAMS)
    parser.add_argument("--columns", type=int, default=100, help="of each seed")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    rows = []
    for workload in options.workloads:
        samples = [drawn(workload, seed, options.columns) for seed in SEEDS]
        true = [ours.truth(x) for x in samples]
        for n in STREAMS[workload]:
            found = [
                ours.relative_error(ours.truth(x, num_streams=n), y)
                for x, y in zip(samples, true, strict=True)
            ]
            p99 = [np.percentile(x, 99) for x in found]
            every = np.concatenate(found)
            row = [workload, n, f"{np.percentile(every, 99):.1e}", f"{min(p99):.1e}-{max(p99):.1e}"]
            rows.append([*row, f"{every.max():.1e}"])
            print(*rows[-1], flush=True)
    table(["workload", "streams", "p99", "p99 of the seeds", "largest"], rows)


if __name__ == "__main__":
    main()
