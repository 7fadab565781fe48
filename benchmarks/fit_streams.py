"""What so many streams leave of the error, by what is in a column: the table of `scene.streams`.

    python benchmarks/fit_streams.py [--columns 500] [--seeds 2] [--double-gauss]

Columns are those of `truth_columns`, of seeds that `truth.py` does not use, in seven bands, against
64 streams with 65 moments and 32 azimuth modes. Printed is the 99th percentile of the error by
kind of column, as `scene.streams.kinds_of` tells them apart by what is in them, and streams, in per
cent: the larger of that of all seeds together and of the mean of the seeds' own. `--double-gauss`
solves on Gauss's nodes instead of the solver's.
"""

import argparse
from contextlib import nullcontext

import jax
import numpy as np
from rounds import table
from truth import relative_error, solved
from truth_columns import make_states

from abi_operator import use_compilation_cache
from abi_operator.atmosphere import LIQUID_OPTICS
from abi_operator.scene.streams import KINDS, STREAMS, kinds_of
from abi_operator.solver import on_double_gauss

FIRST_SEED = 100


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--columns", type=int, default=500)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--double-gauss", action="store_true")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    use_compilation_cache()
    with on_double_gauss() if options.double_gauss else nullcontext():
        fit(options)


def fit(options):
    found = {}
    for seed in range(FIRST_SEED, FIRST_SEED + options.seeds):
        states, _ = make_states(options.columns, seed, LIQUID_OPTICS[0])
        kinds = kinds_of(states.atmosphere)
        truth = solved(states, num_streams=64, num_modes=32)
        for streams in STREAMS:
            error = relative_error(solved(states, num_streams=streams), truth, states)
            for kind in KINDS:
                found.setdefault((kind, streams), []).append(error[kinds == kind].ravel())
    rows = []
    for kind in KINDS:
        cells = []
        for streams in STREAMS:
            errors = found[kind, streams]
            alone = np.mean([np.percentile(e, 99) for e in errors])
            cells.append(f"{100 * max(alone, np.percentile(np.concatenate(errors), 99)):.2g}")
        rows.append([kind, *cells])
    table(["kind", *(f"{streams} streams" for streams in STREAMS)], rows)


if __name__ == "__main__":
    main()
