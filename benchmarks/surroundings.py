"""What it saves to solve layers that stay once, and those that change alone.

    python benchmarks/surroundings.py [--columns 10000] [--streams 8] [--changing 2]

Columns of 24 layers of smoke and ash (W1 of `pareto_columns`), of which some in the middle change
and all others stay: microseconds a column of `toa_brf` of all layers and of `Surroundings.brf` of
those that change, of the value, and of value and slopes in the layers that change (by `toa_brf` in
all layers), with nothing left out and within an error budget of 0.1 %; how far the two are apart;
and after how many solutions what stays is paid for. Float64, medians of interleaved rounds,
compiling apart.
"""

import argparse
import time

import jax
import jax.numpy as jnp
import numpy as np
from pareto_columns import columns
from rounds import table

from abi_operator import __version__
from abi_operator.solver import surroundings, toa_brf

SEED = 1000
BUDGETS = {"nothing left out": None, "budget 0.1 %": 1e-3}
LAYERS = ("tau", "ssa", "moments", "phase_function")


def apart(given, changing):
    """Arguments of the layers that stay, and of those that change; how many lie above."""
    first = (given["tau"].shape[1] - changing) // 2
    some = np.s_[first : first + changing]
    stay = {k: np.delete(x, some, axis=1) if k in LAYERS else x for k, x in given.items()}
    return stay, {k: given[k][:, some] for k in LAYERS}, first


def with_slopes(function):
    return jax.value_and_grad(lambda layers: jnp.sum(function(layers)))


def medians(programs, count, repeats):
    """Microseconds a column of each program, called in turns after once."""
    seconds = {name: [] for name in programs}
    for turn in range(repeats + 1):
        for name, program in programs.items():
            start = time.perf_counter()
            jax.block_until_ready(program())
            if turn:
                seconds[name].append(time.perf_counter() - start)
    return {name: 1e6 / count * float(np.median(x)) for name, x in seconds.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--columns", type=int, default=10_000)
    parser.add_argument("--streams", type=int, default=8)
    parser.add_argument("--changing", type=int, default=2, help="layers")
    parser.add_argument("--repeats", type=int, default=3)
    args = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    print(f"abi-operator {__version__}, jax {jax.__version__}, {jax.default_backend()}, float64\n")
    given = columns("W1", args.columns, SEED).arguments(args.streams)
    stay, layers, num_above = apart(given, args.changing)
    own = {k: x for k, x in given.items() if k not in LAYERS}
    of_all = {k: given[k] for k in LAYERS}

    def solved():
        return surroundings(**stay, num_above=num_above, num_streams=args.streams)

    kept, programs, off = solved(), {"stays": solved}, {}
    for name, budget in BUDGETS.items():

        def whole(x, budget=budget):
            return toa_brf(**x, **own, num_streams=args.streams, error_budget=budget)

        def between(x, budget=budget):
            return kept.brf(**x, error_budget=budget)

        of = whole(of_all)
        off[name] = float(jnp.max(jnp.abs(between(layers) - of) / jnp.maximum(of, 0.01)))
        whole_slopes, own_slopes = with_slopes(whole), with_slopes(between)
        programs |= {
            (name, "value", "all"): lambda f=whole: f(of_all),
            (name, "value", "some"): lambda f=between: f(layers),
            (name, "value and slopes", "all"): lambda f=whole_slopes: f(of_all),
            (name, "value and slopes", "some"): lambda f=own_slopes: f(layers),
        }
    micros = medians(programs, args.columns, args.repeats)
    print(
        f"{args.columns} columns of {given['tau'].shape[1]} layers, {args.changing} of which ",
        end="",
    )
    print(f"change, {args.streams} streams; what stays: {micros['stays']:.1f} us a column\n")
    rows = []
    for name in BUDGETS:
        for what in ("value", "value and slopes"):
            whole, some = (micros[name, what, which] for which in ("all", "some"))
            after = micros["stays"] / (whole - some) if whole > some else np.inf
            cells = [f"{whole:.1f}", f"{some:.1f}", f"{whole / some:.1f}", f"{after:.0f}"]
            rows.append([name, what, *cells, f"{off[name]:.0e}"])
    head = ["solved", "what", "whole columns [us]", "layers that change [us]", "times"]
    table([*head, "paid for after", "apart, at most"], rows)


if __name__ == "__main__":
    main()
