"""One case of `devices`: a workload on a device, in one precision, value or gradient.

It is a process of its own, for which JAX is set up by the environment. It reads the columns,
compiles, leaves what the solver gives of them beside the columns, says what it ran on, waits for a
line and answers with the seconds of its calls, from NumPy to NumPy and from JAX's arrays to JAX's,
which stay where they are.
"""

import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Case:
    """What is timed; nothing is skipped where there are no `repeats`, which is for the error."""

    workload: str
    device: str
    dtype: str
    kind: str
    repeats: int
    tile: int  # columns at a time, 0 for what the package has

    @property
    def name(self):
        """Of the file of its results."""
        parts = self.workload, self.device, self.dtype, self.kind, self.repeats, self.tile
        return "-".join(str(x) for x in parts)

    def label(self):
        return [self.workload, self.kind, self.dtype, self.tile or "as it comes"]


def main():
    import jax
    import pareto_ours as ours
    from devices import ERROR

    from abi_operator.machine import sizes
    from abi_operator.solver import toa_brf

    case, folder = Case(**json.loads(sys.argv[1])), Path(sys.argv[2])
    jax.config.update("jax_enable_x64", case.dtype == "float64")
    if case.tile:
        sizes._ELSEWHERE, sizes._SOLVER_ELSEWHERE = case.tile, {}
    with np.load(folder / f"{case.workload}.npz") as file:
        columns = {name: file[name].astype(case.dtype) for name in file.files}
    options = ours.options_of(case.workload, ERROR, skipping=case.repeats > 0)

    def total(columns):
        brf = toa_brf(**columns, **options)
        return brf.sum(), brf

    def solve(columns):
        """brf, and slopes by name."""
        if case.kind == "value":
            return toa_brf(**columns, **options), {}
        (_, brf), slopes = jax.value_and_grad(total, has_aux=True)(columns)
        return brf, slopes

    def call():
        return jax.tree.map(np.asarray, solve(columns))

    start = time.perf_counter()
    brf, slopes = call()
    seconds = time.perf_counter() - start
    np.savez(folder / f"{case.name}.npz", brf=brf, **slopes)
    device = jax.devices()[0]
    memory = (device.memory_stats() or {}).get("peak_bytes_in_use", 0)
    about = {"seconds": seconds, "device": device.device_kind, "memory": memory}
    print(json.dumps(about), flush=True)
    sys.stdin.readline()
    if not case.repeats:
        return
    found = [seconds_of(call) for _ in range(case.repeats)]
    there = jax.block_until_ready(jax.device_put(columns))

    def stay():
        jax.block_until_ready(solve(there))

    stay()  # JAX's arrays are cut by a small program of their own
    print(json.dumps([found, [seconds_of(stay) for _ in range(case.repeats)]]), flush=True)


def seconds_of(call):
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


if __name__ == "__main__":
    main()
