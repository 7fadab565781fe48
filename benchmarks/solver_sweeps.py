"""Sweeps of `solver.py`: cost against size, precision, memory, compiling, and other derivatives.

    python benchmarks/solver_sweeps.py PROGRAM STREAMS COLUMNS LAYERS

is what the sweeps of memory and compiling run in a process of its own, to print seconds and memory.
"""

import json
import subprocess
import sys
import time

import jax
import numpy as np
import workload
from peers import Peers, peak_memory, usable_peers
from plain import GROWTH, LARGE_BATCH
from rounds import AGREE, Program, Rounds, apart, digits, table

from abi_operator.solver.method.doublings import sufficient_doublings

BATCHES = (1, 10, 100, 1000, 10_000, 100_000, 1_000_000)
LAYERS = (1, 2, 5, 10, 20, 40, 60)
STREAMS = (2, 4, 6, 8, 12, 16, 24, 32)
USUAL_STREAMS = (8, 16)
BATCHES_OF_MEMORY = (1000, 10_000, 100_000)
FEW_LAYERS = 20  # linear in layers from
FLOAT32_STREAMS, FLOAT32_GAIN = (8, 16), 1.6
MAPPED_SHARE = 0.7  # of the built-in batch's speed
JACOBIAN_COST = 1.3  # times value + gradient of the same columns
UNNAMED_COST = 1.1  # of a call that names no number of doublings, times the best that does
COMPILE_STREAMS, COMPILE_SECONDS = 16, {"value": 20, "value + gradient": 40}
# Copies of what goes in and comes out that may live at a time: the argument on the device, with its
# columns last, in tiles, and as much of derivatives again.
COPIES = 6


def both(num_streams, num_doublings):
    settings = {"num_streams": num_streams, "num_doublings": num_doublings}
    return {
        "value": Program(workload.value(settings)),
        "value + gradient": Program(workload.gradient(settings)),
    }


def sweep(rounds: Rounds, label, cases, bars, more=0):
    """One row a case (label, streams, layers, columns, dtype); returns microseconds a column.

    `more`: doublings beyond those of the main table.
    """
    found, rows = {}, []
    for case, n, layers, count, dtype in cases:
        num_doublings = workload.num_doublings(n) + more
        programs = both(n, num_doublings)
        t = rounds.run(programs, n, layers, count, ["nanodisort"], dtype=dtype)
        row, error = [case, num_doublings], {}
        for name in ("value", "value + gradient"):
            row += [digits(t[name].microseconds), t[name].spread]
            error[name] = apart(t[name].brf, t["nanodisort"].brf)
            found[case, name] = t[name].microseconds
            if dtype == np.float64:
                bars.judge(error[name] <= AGREE, f"{name}, {label} {case}: {error[name]:.0e} apart")
        row += [f"{t['value + gradient'].microseconds / t['value'].microseconds:.2f}"]
        row += [digits(t["nanodisort"].microseconds), t["nanodisort"].count]
        rows.append([*row, *(f"{x:.0e}" for x in error.values())])
    head = [label, "doublings", "value [us a column]", "range", "+ gradient", "range", "ratio"]
    head += ["nanodisort", "its columns", "value from nanodisort's", "gradient program's"]
    table(head, rows)
    return found


def batch(rounds, options, bars):
    for n in options.sweep_streams or USUAL_STREAMS:
        print(f"Batch, {n} streams, {options.layers} layers:\n")
        sizes = [k for k in BATCHES if k <= options.largest]
        found = sweep(
            rounds, "columns", [(k, n, options.layers, k, np.float64) for k in sizes], bars
        )
        for name in ("value", "value + gradient"):
            large = [found[k, name] for k in sizes if k >= LARGE_BATCH]
            if len(large) > 1:
                growth = max(large) / min(large)
                bars.judge(growth <= GROWTH, f"{name} at {n}: {growth:.2f} from batch to batch")


def layers(rounds, options, bars):
    """With a doubling more: the fewer the layers, the more the thick one's error weighs."""
    for n in options.sweep_streams or USUAL_STREAMS:
        print(f"Layers, {n} streams, {options.columns} columns:\n")
        cases = [(k, n, k, options.columns, np.float64) for k in LAYERS]
        found = sweep(rounds, "layers", cases, bars, more=1)
        for name in ("value", "value + gradient"):
            growth = max(found[k, name] / k for k in LAYERS if k > FEW_LAYERS)
            growth /= found[FEW_LAYERS, name] / FEW_LAYERS
            text = f"{name} at {n}: a layer of many costs {growth:.2f} of one of {FEW_LAYERS}"
            bars.judge(growth <= GROWTH, text)


def streams(rounds, options, bars):
    print(f"Streams, {options.columns} columns:\n")
    cases = [
        (n, n, options.layers, options.columns, np.float64)
        for n in (options.sweep_streams or STREAMS)
    ]
    sweep(rounds, "streams", cases, bars)


def dtype(rounds, options, bars):
    print(f"Precision, {options.columns} columns (error against nanodisort in float64):\n")
    kinds = (np.float64, np.float32)
    cases = [
        (f"{n} {kind.__name__}", n, options.layers, options.columns, kind)
        for n in (options.sweep_streams or USUAL_STREAMS)
        for kind in kinds
    ]
    found = sweep(rounds, "streams", cases, bars)
    for n in options.sweep_streams or USUAL_STREAMS:
        gain = found[f"{n} float64", "value"] / found[f"{n} float32", "value"]
        if n in FLOAT32_STREAMS:
            bars.judge(gain >= FLOAT32_GAIN, f"float32 at {n} streams: {gain:.2f} x float64")


def derivatives(rounds, options, bars):
    """`jax.vmap` of the call for one column, several views, and retrievals' Jacobians."""
    count = options.columns - options.columns % workload.NUM_BANDS
    for n in options.sweep_streams or USUAL_STREAMS:
        settings = {"num_streams": n, "num_doublings": workload.num_doublings(n)}

        def whole(given, _):
            return (given,)

        programs = both(n, workload.num_doublings(n)) | {
            "value, vmapped": Program(workload.mapped_value(settings)),
            "value + gradient, vmapped": Program(workload.mapped_gradient(settings)),
            "value of 3 views": Program(workload.view_value(settings), workload.view_arguments),
            "Jacobian of 3 views": Program(
                workload.view_jacobian(settings), workload.view_arguments
            ),
        }
        for transform in (jax.jacfwd, jax.jacrev):
            call = workload.state_jacobian(settings, transform, options.layers)
            programs[f"3 bands by 10 states, {transform.__name__}"] = Program(call, whole)
        timed = rounds.run(programs, n, options.layers, count, ["nanodisort"])
        value, slope = (timed[x].microseconds for x in ("value", "value + gradient"))
        rows = []
        for name, t in timed.items():
            error = apart(t.brf, timed["nanodisort"].brf)
            row = [name, digits(t.microseconds), t.spread, f"{t.microseconds / value:.2f}"]
            rows.append([*row, f"{t.microseconds / slope:.2f}", f"{error:.0e}", f"{t.first:.1f}"])
            bars.judge(error <= AGREE, f"{name} at {n}: {error:.0e} from nanodisort")
            if "vmapped" in name:
                share = timed[name.removesuffix(", vmapped")].microseconds / t.microseconds
                bars.judge(share >= MAPPED_SHARE, f"{name} at {n}: {share:.0%} of the batch")
            if "states" in name:
                cost = t.microseconds / slope
                bars.judge(cost <= JACOBIAN_COST, f"{name} at {n}: {cost:.2f} x value + gradient")
        print(f"Derivatives, {n} streams, {count} columns, {settings['num_doublings']} doublings:")
        print()
        head = ["program", "microseconds a column", "range", "in values", "in value + gradient"]
        table([*head, "from nanodisort", "first call [s]"], rows)
        forward, reverse = (timed[x].slopes for x in programs if "states" in x)
        error = np.max(np.abs(forward - reverse)) / np.max(np.abs(forward))
        print(f"jacfwd and jacrev differ by {error:.0e} of the largest entry\n")
        bars.judge(error <= AGREE, f"jacfwd and jacrev at {n} differ by {error:.0e}")


def doublings(rounds, options, bars):
    """Under a `jax.jit` of the caller's, where nobody reads the layers: no number of doublings
    named, and the numbers that are enough for them, of which slopes have less room to keep."""
    print(f"Doublings of what a caller jits, {options.columns} columns:\n")
    rows, thickest = [], (workload.MAX_TAU, workload.MIN_MU)
    for n in options.sweep_streams or USUAL_STREAMS:
        for kind in (np.float64, np.float32):
            fewest = sufficient_doublings(*thickest, n, kind)
            programs = {}
            for k in (None, fewest, fewest + 1):
                settings = {"num_streams": n, "num_doublings": k}
                programs["value", k] = Program(workload.jitted_value(settings))
                programs["value + gradient", k] = Program(workload.gradient(settings))
            t = rounds.run(programs, n, options.layers, options.columns, [], dtype=kind)
            for name in ("value", "value + gradient"):
                own = t[name, None]
                best = min((fewest, fewest + 1), key=lambda k: t[name, k].microseconds)
                named = t[name, best]
                cost, error = own.microseconds / named.microseconds, apart(own.brf, named.brf)
                row = [f"{n} {kind.__name__}", name, digits(own.microseconds), own.spread]
                row += [best, digits(named.microseconds), named.spread]
                rows.append([*row, f"{cost:.2f}", f"{error:.0e}"])
                text = f"{name} at {n} {kind.__name__} costs {cost:.2f} of doublings that are named"
                bars.judge(cost <= UNNAMED_COST, text)
                bars.judge(error <= AGREE, f"{text}, and is {error:.0e} apart")
    head = ["streams", "program", "none named [us a column]", "range", "best number", "named"]
    table([*head, "range", "none named / named", "apart"], rows)


def child(name, num_streams, count, num_layers):
    """Seconds and memory of one program in a process of its own."""
    command = [sys.executable, __file__, name, *map(str, (num_streams, count, num_layers))]
    return json.loads(subprocess.run(command, capture_output=True, check=True, text=True).stdout)


def compiling(rounds, options, bars):
    rows = []
    for n in options.sweep_streams or STREAMS:
        row = [n]
        for name, most in COMPILE_SECONDS.items():
            found = child(name, n, options.columns, options.layers)
            seconds = found["first"] - found["second"]
            row.append(f"{seconds:.1f}")
            if n == COMPILE_STREAMS:
                bars.judge(seconds <= most, f"{name} at {n} streams compiles {seconds:.0f} s")
        rows.append(row)
    print("Seconds of compiling (first call less second), each in a new process:\n")
    table(["streams", *COMPILE_SECONDS], rows)


def memory(rounds, options, bars):
    """Peak memory above that of a process which holds the arguments alone."""
    rows = []
    sizes = [k for k in BATCHES_OF_MEMORY if k <= options.largest] or [options.largest]
    for n in options.sweep_streams or USUAL_STREAMS:
        for name in COMPILE_SECONDS:
            found = [child(name, n, k, options.layers) for k in sizes]
            for k, x in zip(sizes, found, strict=True):
                rows.append(
                    [name, n, k, *(f"{x[m] / 1e6:.0f}" for m in ("peak", "extra", "moved"))]
                )
            if len(sizes) > 1:
                grown = [found[-1][m] - found[-2][m] for m in ("extra", "moved")]
                copies = grown[0] / grown[1]
                text = f"{name} at {n}: memory grows by {copies:.1f} x its arguments and results"
                bars.judge(copies <= COPIES, text)
    for n in options.sweep_streams or USUAL_STREAMS:
        for name in usable_peers(n):
            count = min(options.columns, 256)
            with Peers(1, count, options.layers) as peers:
                peers.put(workload.columns(count, options.layers, seed=0))
                idle = peers.idle_memory()
                most = peers.solve(name, n, count)[1]
            rows.append([name, n, count, f"{most / 1e6:.0f}", f"{(most - idle) / 1e6:.0f}", ""])
    print("Memory of a process; the other solvers', one process of several, JAX imported:\n")
    head = ["program", "streams", "columns", "peak [MB]", "above idle [MB]"]
    table([*head, "arguments and results [MB]"], rows)


SWEEPS = {
    "batch": batch,
    "layers": layers,
    "streams": streams,
    "dtype": dtype,
    "derivatives": derivatives,
    "doublings": doublings,
    "memory": memory,
    "compile": compiling,
}


def prepared(seed, num_streams, count, num_layers, part=1000):
    """Arguments of many columns, made in parts so that nothing larger has lived before."""
    filled = []
    for start in range(0, count, part):
        some = workload.columns(min(part, count - start), num_layers, seed=(seed, start))
        arrays = workload.arguments(some, num_streams)
        filled = filled or [np.empty((count, *x.shape[1:])) for x in arrays]
        for whole, x in zip(filled, arrays, strict=True):
            whole[start : start + part] = x
    return filled


def main():
    name, *sizes = sys.argv[1:]
    num_streams, count, num_layers = map(int, sizes)
    workload.use_all_cores()
    program, seconds = both(num_streams, workload.num_doublings(num_streams))[name].call, []
    # The second call's peak counts: with the first one's arguments gone, and compiled.
    for seed in range(2):
        arrays = prepared(seed, num_streams, count, num_layers)
        idle = peak_memory() if seed == 0 else idle
        start = time.perf_counter()
        result = program(*arrays)
        seconds.append(time.perf_counter() - start)
        moved = sum(x.nbytes for x in jax.tree.leaves((arrays, result)))
        del arrays, result
    found = {"first": seconds[0], "second": seconds[1], "peak": peak_memory()}
    found["extra"] = found["peak"] - idle
    print(json.dumps(found | {"moved": moved}))


if __name__ == "__main__":
    main()
