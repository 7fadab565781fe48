"""The solver on a GPU, beside the cores: the same plain calls, in both precisions.

    python benchmarks/devices.py [--workloads W1 W2] [--columns 100000] [--cores 2]

times `toa_brf` and its gradient in every argument on the columns of `pareto_columns`, for an error
of 1 % (streams and budget of `pareto_ours`), from NumPy to NumPy, on every device that JAX finds,
in float64 and in float32; `in place` is from arrays that JAX has on the device to such arrays,
which are not moved. Beside the time stands the difference from what this processor gives in double
precision with nothing skipped, at the 99th percentile: of brf relative to max(brf, 0.01), of slopes
to the largest of that argument in the column, or to a thousandth of the largest in all
columns. Streams' own error (`pareto.py`) is not in it. Without a GPU the rows of the cores alone
are printed.

Each case is a process of its own (`devices_case`). All are started together, for compiling takes
most of the time, and they are timed one after the other, when nobody compiles any more; memory is
the most that was in use on the GPU. Of the cores there are, `--cores` are used. `--tile` takes so
many columns at a time on the GPU instead of what `abi_operator.machine.sizes` has for it.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import asdict
from itertools import product
from pathlib import Path

import numpy as np
from devices_case import Case
from rounds import digits, table

HERE = Path(__file__).parent
ERROR = 1e-2
SEED = 1000


def draw(workload, count, folder):
    """Write the arguments of the solver; a process of its own, since JAX is on the CPU in it."""
    import jax
    import pareto_columns
    import pareto_ours as ours

    jax.config.update("jax_enable_x64", True)
    columns = pareto_columns.columns(workload, count, SEED)
    num_streams = ours.STREAMS[workload][ERROR][0]
    np.savez(folder / f"{workload}.npz", **columns.arguments(num_streams))


def on_cores(cores):
    """Environment of a process that has JAX on the CPU alone, and what begins its command."""
    usable = ",".join(str(x) for x in sorted(os.sched_getaffinity(0))[:cores])
    return os.environ | {"JAX_PLATFORMS": "cpu"}, ["taskset", "-c", usable]


def started(case, folder, cores):
    """The process of a case, which says when it has compiled, and is timed when told."""
    environment, before = dict(os.environ), []
    if case.device == "cpu":
        environment, before = on_cores(cores if case.repeats else None)
    else:  # all processes are on it together
        environment["XLA_PYTHON_CLIENT_PREALLOCATE"] = "false"
    command = [*before, sys.executable, str(HERE / "devices_case.py")]
    return subprocess.Popen(
        [*command, json.dumps(asdict(case)), str(folder)],
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def has_gpu():
    """Whether JAX finds one, asked in a process of its own."""
    code = "import jax; print(jax.default_backend())"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return found.stdout.split()[-1] != "cpu"


def error_of(found, expected, kind):
    """99th percentiles of the differences of brf, and of slopes in that argument where it is
    largest."""
    brf, true_brf = found["brf"], expected["brf"]
    values = np.percentile(np.abs(brf - true_brf) / np.maximum(true_brf, 0.01), 99)
    if kind == "value":
        return values, None
    slopes = []
    for name in expected.files:
        if name == "brf":
            continue
        true = expected[name].reshape(len(true_brf), -1)
        largest = np.abs(true).max(axis=1)
        apart = np.abs(found[name].reshape(true.shape) - true).max(axis=1)
        slopes.append(apart / np.maximum(largest, 1e-3 * largest.max()))
    return values, np.percentile(slopes, 99, axis=1).max()


def parsed():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--workloads", nargs="+", default=["W1", "W2"])
    parser.add_argument("--columns", type=int, default=100_000)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--cores", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--kinds", nargs="+", default=["value", "gradient"])
    parser.add_argument("--dtypes", nargs="+", default=["float64", "float32"])
    parser.add_argument("--devices", nargs="+", default=["cpu", "gpu"], choices=["cpu", "gpu"])
    parser.add_argument("--tile", type=int, nargs="+", default=[0])
    return parser.parse_args()


def main():
    options = parsed()
    devices = [x for x in options.devices if x == "cpu" or has_gpu()]
    cases = [
        Case(workload, device, dtype, kind, options.repeats, tile)
        for workload, kind, device, dtype in product(
            options.workloads, options.kinds, devices, options.dtypes
        )
        for tile in (options.tile if device == "gpu" else [0])
    ]
    exact = [
        Case(workload, "cpu", "float64", kind, 0, 0)
        for workload, kind in product(options.workloads, options.kinds)
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        environment, _ = on_cores(None)
        for workload in options.workloads:
            code = f"import devices, pathlib; devices.draw({workload!r}, {options.columns}, "
            code += f"pathlib.Path({name!r}))"
            subprocess.run([sys.executable, "-c", code], env=environment, cwd=HERE, check=True)
        processes = {case: started(case, folder, options.cores) for case in [*exact, *cases]}
        about = {case: process.stdout.readline() for case, process in processes.items()}
        if not all(about[case] for case in exact):
            sys.exit("The columns could not be solved on the cores: see above.")
        rows = []
        for case in cases:
            process = processes[case]
            answer = process.communicate("go\n")[0]
            if not about[case] or not answer:
                rows.append([*case.label(), "failed"])
                continue
            (seconds, staying), first = json.loads(answer), json.loads(about[case])
            found = np.load(folder / f"{case.name}.npz")
            reference = Case(case.workload, "cpu", "float64", case.kind, 0, 0)
            expected = np.load(folder / f"{reference.name}.npz")
            values, slopes = error_of(found, expected, case.kind)
            micro = [1e6 * x / options.columns for x in seconds]
            row = [*case.label(), first["device"], digits(np.median(micro))]
            row += [f"{digits(min(micro))}-{digits(max(micro))}"]
            row += [digits(1e6 * np.median(staying) / options.columns), f"{first['seconds']:.0f}"]
            row.append(f"{first['memory'] / options.columns / 1e3:.1f}" if first["memory"] else "")
            rows.append([*row, f"{values:.0e}", "" if slopes is None else f"{slopes:.0e}"])
            print(rows[-1], file=sys.stderr, flush=True)
    print(f"{options.columns} columns in a call, {options.cores} cores, {options.repeats} calls\n")
    heads = ["workload", "what", "precision", "tile", "device", "microseconds a column", "range"]
    heads += ["in place", "first call [s]", "memory [kB a column]", "brf (p99)", "slopes (p99)"]
    table(heads, rows)


if __name__ == "__main__":
    main()
