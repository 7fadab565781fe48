"""How far entries scatter over threads and batches, against what the guard allows them to."""

import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import pytest
from guarded import BANDS, SETTINGS, two_columns

from abi_operator import guard

# Rounding may use this much of a tolerance. [-]
SHARE = 0.1

FULL = """
import sys
from abi_operator import guard

guard.save(sys.argv[1], "standard", ("C02",))
"""
SMALL = """
import sys
from abi_operator import guard

guard.save(sys.argv[1], "guarded:two_columns", ("C02",), num_streams=2)
"""


def spread(columns, bands, sizes, settings):
    """Largest excess, by size of the batch, over the columns one after the other in one batch."""
    together = guard.evaluate(columns, bands, **settings)
    found = {}
    for size in sizes:
        batch = [list(columns.values())[k % len(columns)] for k in range(size)]
        now = guard.evaluate(jax.tree.map(lambda *x: jnp.stack(x), *batch), bands, **settings)
        largest = 0.0
        for start in range(0, size, len(columns)):
            numbers = [str(k) for k in range(start, min(start + len(columns), size))]
            names = together.columns[: len(numbers)]
            part = guard.select(now, numbers, bands, together.inputs)._replace(columns=names)
            stored = guard.select(together, names, bands, together.inputs)
            largest = max(largest, guard.excess(stored, part))
        found[f"batch of {size}"] = largest
    return found


def on_threads(number, script, path):
    """What another process gives that may use so many threads."""
    flags = f"--xla_cpu_multi_thread_eigen={'true' if number > 1 else 'false'}"
    environment = os.environ | {
        "XLA_FLAGS": f"{flags} intra_op_parallelism_threads={number}",
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        "JAX_ENABLE_X64": "1",
    }
    subprocess.run([sys.executable, "-c", script, str(path)], check=True, env=environment)
    return guard.read_baseline(path).jacobians


@pytest.mark.slow
def test_batches_and_threads(tmp_path, scale):
    """Columns alone, in batches of 7 and 1000, on one thread and on two.

    At full scale those of the baseline in C02; below, two that take a moment.
    """
    columns, settings, script = two_columns(), SETTINGS, SMALL
    if scale == 1:
        every = guard.standard_columns()
        columns = {name: state for name, state in every.items() if state.fire is not None}
        settings, script = {}, FULL
    found = spread(columns, BANDS, (1, 7, 1000), settings)
    stored = guard.evaluate(columns, BANDS, **settings)
    for number in (1, 2):
        now = on_threads(number, script, tmp_path / f"{number}.nc")
        now = guard.select(now, stored.columns, stored.bands, stored.inputs)
        found[f"{number} threads"] = guard.excess(stored, now)
    for name, largest in found.items():
        print(f"{name}: {largest:.1e} tolerances at most")
    assert max(found.values()) < SHARE
