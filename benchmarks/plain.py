"""What plain calls reach: `solver.py --plain`.

A user's script, in a process of its own and without any setting but float64, beside the same
columns under `jax.jit` in a process that is tuned by hand (`workload.use_all_cores`: a CPU device
for each core, the widest vectors, threads that keep to their cores), and nanodisort. The columns
are the same and differ from round to round, in which each has its turn.

    python benchmarks/plain.py script|tuned

is such a process: it reads streams, columns, layers and a seed, and prints seconds.
"""

import json
import os
import statistics
import subprocess
import sys
import time

import jax
import jax.numpy as jnp
import numpy as np
import workload
from rounds import AGREE, digits, table

from abi_operator.solver import on_double_gauss, toa_brf

STREAMS, COLUMNS = (4, 8, 16), 2048
ROUNDS_OF_BATCHES = 5
ROUNDS = 15  # after a pause a call of milliseconds takes half as long again every now and then
SHARE = 0.9  # of the tuned rate
LARGE_BATCH, GROWTH = 1000, 1.15  # flat in batch from
JUDGED = {  # what the script calls: what it is beside
    "value": "value",
    "value and `jax.vjp`": "value + gradient",
    "`jax.value_and_grad` of the sum": "value + gradient",
}
UNJUDGED = "value, doublings chosen"  # from the thickest layer: right to 1e-8 where 1e-5 is asked


def script_programs(num_streams):
    """As a user writes them: no `jax.jit`, NumPy in and out."""
    number = workload.num_doublings(num_streams)

    def brf(*arrays, num_doublings=number):
        phase = arrays[7]
        return toa_brf(
            *arrays[:7],
            phase_function=phase,
            num_streams=num_streams,
            num_doublings=num_doublings,
        )

    def by_vjp(*arrays):
        value, pull_back = jax.vjp(brf, *arrays)
        slopes = pull_back(jnp.ones_like(value))
        return value, slopes

    def by_grad(*arrays):
        return jax.value_and_grad(lambda *x: brf(*x).sum(), argnums=range(8))(*arrays)

    return dict(zip(JUDGED, (brf, by_vjp, by_grad), strict=True)) | {
        UNJUDGED: lambda *arrays: brf(*arrays, num_doublings=None)
    }


def tuned_programs(num_streams):
    options = {"num_streams": num_streams, "num_doublings": workload.num_doublings(num_streams)}
    value = jax.jit(lambda arrays: workload.solve(*arrays, **options))
    return {
        "value": lambda *arrays: value(arrays),
        "value + gradient": workload.gradient(options),
    }


def serve(kind):
    """Answer each line of the input with one of seconds and the brf."""
    if kind == "tuned":
        workload.use_all_cores()
    else:
        jax.config.update("jax_enable_x64", True)
    programs = {}
    with on_double_gauss():
        for line in sys.stdin:
            name, num_streams, count, layers, seed = json.loads(line)
            if num_streams not in programs:
                programs[num_streams] = (tuned_programs if kind == "tuned" else script_programs)(
                    num_streams
                )
            given = workload.columns(count, layers, seed)
            arrays = workload.arguments(given, num_streams)
            start = time.perf_counter()
            result = jax.tree.map(np.asarray, programs[num_streams][name](*arrays))
            seconds = time.perf_counter() - start
            brf = result[0] if isinstance(result, tuple) else result
            print(json.dumps([seconds, brf.tolist()]), flush=True)


class Process:
    """A process that serves, in an environment without settings of JAX or XLA."""

    def __init__(self, kind):
        self._process = subprocess.Popen(
            [sys.executable, "-P", __file__, kind],
            env=without_settings() | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.stdin.close()
        self._process.wait()

    def solve(self, *request):
        """Seconds, and brf."""
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        seconds, brf = json.loads(self._process.stdout.readline())
        return seconds, np.array(brf)


def without_settings():
    """The environment without anything that JAX or XLA reads."""
    return {k: v for k, v in os.environ.items() if k != "XLA_FLAGS" and not k.startswith("JAX_")}


def plain(peers, options, bars):
    """The table of plain calls."""
    rows = []
    with Process("script") as script, Process("tuned") as tuned:
        for n in options.streams:
            rows += rows_of(n, script, tuned, peers, options, bars)
    head = ["streams", "plain call", "microseconds a column", "range", "columns / s"]
    head += ["tuned", "tuned columns / s", "plain / tuned", "x nanodisort", "from nanodisort"]
    table([*head, "first call [s]"], rows)


def rows_of(num_streams, script, tuned, peers, options, bars):
    """All programs at a number of streams, round by round."""
    programs = [(script, name) for name in (*JUDGED, UNJUDGED)]
    programs += [(tuned, name) for name in sorted(set(JUDGED.values()))]
    order = [*programs, None]
    first, seconds, error = {}, {program: [] for program in order}, dict.fromkeys(programs, 0.0)
    for turn in range(options.repeats + 1):
        peers.put(workload.columns(options.columns, options.layers, turn))
        brf = {}
        for program in order[turn % len(order) :] + order[: turn % len(order)]:
            if program is None:
                start = time.perf_counter()
                expected = peers.solve("nanodisort", num_streams, options.columns)[0]
                spent = time.perf_counter() - start
            else:
                process, name = program
                shape = options.columns, options.layers, turn
                spent, brf[program] = process.solve(name, num_streams, *shape)
            if turn:
                seconds[program].append(spent)
            else:
                first[program] = spent
        for program, found in brf.items():
            # Where there is only the sum, of that; NumPy's largest, which no NaN passes.
            wanted = expected if found.ndim else expected.sum()
            error[program] = np.maximum(error[program], np.max(np.abs(found / wanted - 1)))
    return judged(num_streams, programs, first, seconds, error, (script, tuned), options, bars)


def batches(peers, options, sizes, bars):
    """Cost a column from batch to batch, of a value and of a value with all slopes (`--sweep`)."""
    names = list(JUDGED)[:2]
    with Process("script") as script:
        for n in options.sweep_streams:
            print(f"Batches in plain calls, {n} streams, {options.layers} layers:\n")
            rows, found = [], {}
            for count in sizes:
                seconds, error = of_batch(script, peers, n, count, names, options.layers)
                row = [count]
                for name in names:
                    micro = sorted(1e6 * x / count for x in seconds[name])
                    found[count, name] = statistics.median(micro)
                    row += [digits(found[count, name])]
                    row += [f"{digits(micro[0])}-{digits(micro[-1])}"]
                row.append(f"{found[count, names[1]] / found[count, names[0]]:.2f}")
                rows.append([*row, *(f"{error[name]:.0e}" for name in names)])
                worst = max(error.values())
                bars.judge(worst <= AGREE, f"{count} columns at {n}: {worst:.0e} apart")
            head = ["columns", "value [us a column]", "range", "+ `jax.vjp`", "range", "ratio"]
            table([*head, "value from nanodisort's", "gradient program's"], rows)
            for name in names:
                large = [found[k, name] for k in sizes if k >= LARGE_BATCH]
                growth = max(large, default=1) / min(large, default=1)
                text = f"plain {name} at {n}: {growth:.2f} from batch to batch"
                bars.judge(growth <= GROWTH, text)


def of_batch(script, peers, num_streams, count, names, layers):
    """Seconds of each call but the first, and the largest error of what nanodisort solves."""
    seconds, error = {name: [] for name in names}, dict.fromkeys(names, 0.0)
    for turn in range(ROUNDS_OF_BATCHES + 1):
        judged = min(count, peers.capacity)
        peers.put(workload.columns(count, layers, turn).first(judged))
        expected = peers.solve("nanodisort", num_streams, judged)[0]
        for name in names[turn % 2 :] + names[: turn % 2]:
            spent, brf = script.solve(name, num_streams, count, layers, turn)
            error[name] = np.maximum(error[name], np.max(np.abs(brf[:judged] / expected - 1)))
            if turn:
                seconds[name].append(spent)
    return seconds, error


def judged(num_streams, programs, first, seconds, error, processes, options, bars):
    script, tuned = processes
    micro = {k: 1e6 * statistics.median(x) / options.columns for k, x in seconds.items()}
    rows = []
    for program in (x for x in programs if x[0] is script):
        name, t = program[1], micro[program]
        low, high = (1e6 * f(seconds[program]) / options.columns for f in (min, max))
        row = [num_streams, name, digits(t), f"{digits(low)}-{digits(high)}", f"{1e6 / t:,.0f}"]
        beside = JUDGED.get(name)
        if beside is None:
            row += ["", "", ""]
        else:
            of_tuned = micro[tuned, beside]
            share = of_tuned / t
            row += [beside, f"{1e6 / of_tuned:,.0f}", f"{share:.0%}"]
            bars.judge(
                share >= SHARE, f"plain {name} at {num_streams}: {share:.0%} of the tuned rate"
            )
        row += [f"{micro[None] / t:.2f}", f"{error[program]:.0e}"]
        rows.append([*row, f"{first[program]:.1f}"])
        bars.judge(error[program] <= AGREE, f"{name} at {num_streams}: {error[program]:.0e} apart")
    return rows


if __name__ == "__main__":
    serve(sys.argv[1])
