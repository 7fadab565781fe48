"""Does the solver hold at the extremes? Random columns, each asked everything that can be asked.

    python benchmarks/stress.py [--columns 20000] [--precision float64] [--most-streams 64]
        [--judged 300] [--folder F]

Columns are those of `stress_columns`, checks those of `stress_checks`. Streams are 2 to 8 in 95 %
of the columns, 16 in 4.5 %, 32 in 0.45 %, 64 in 0.05 %; layers up to 1, 4, 16, 64 and 200. Each
batch is a file of the folder, made from its name alone: a run that was stopped goes on with what
is missing, and the bytes are the same. The folder has one in it for each state of the code that
figures hang on (`stress_code`). Every core has a process of its own. What fails is
asked once more (`stress_again`); the worst columns are solved with 40 digits (`stress_truth`), and
judged by them.

`--columns 1000000` is the long run; how long it would take is printed, but for compiling, which is
done once. Exits with 1 where a check failed, a worst column is wrong, or a number out of range
passed.
"""

import argparse
import os
import sys
import tempfile
import time
from multiprocessing import get_context
from pathlib import Path

import jax
import numpy as np
import stress_truth
from stress_again import (
    without_albedos_of_the_equations,
    without_the_equations_own,
    without_the_quotients_own,
    without_what_is_conserved,
)
from stress_checks import CHECKS, Judged, refused
from stress_code import state_of_code
from stress_columns import GROUPS, SEED, columns_of
from stress_report import PRECISIONS, by_check, by_stratum, described, failed, worst

from abi_operator import use_compilation_cache
from abi_operator.machine.speed import usable_cores

LONG = 1_000_000
# Batches that a process takes at a time.
PORTION = 40
# Most by which a column may err against 40 digits.
RIGHT = {"float64": 1e-6, "float32": 2e-2}
KNOWN = 0.9  # share of them that must have such a truth
FIELDS = [("stratum", "i2"), ("value", "f8"), ("beyond", "?"), *((name, "f8") for name in CHECKS)]


def batches(group, columns):
    """How many of a group; two at least, the first of which compiles."""
    return max(2, -(-round(columns * group[5]) // group[4]))


def place(folder, group, index, precision):
    kind = "emitting" if group[3] else "sunlit"
    return folder / f"{precision}-{group[0]}-{group[1]}-{kind}-{index:05d}.npy"


def one_core(cores):
    """A process for each core, so that several programs compile at once."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {cores.get()})
    jax.config.update("jax_enable_x64", True)
    use_compilation_cache()


def judge(task):
    """Write what is missing of some batches of a group; seconds that each of them took."""
    folder, group, indices, precision = task
    seconds = []
    for index in indices:
        path = place(folder, group, index, precision)
        if path.exists():
            continue
        started = time.perf_counter()
        batch = columns_of(group, index, precision)
        judged = Judged(batch.columns, batch.further, group[0], [group[0], index])
        errors = judged.all()
        rows = np.zeros(batch.stratum.size, FIELDS)
        rows["stratum"], rows["value"] = batch.stratum, judged.value
        rows["beyond"] = judged.beyond(batch.columns["ssa"])
        for name, found in errors.items():
            rows[name] = found
        handle, part = tempfile.mkstemp(dir=folder, suffix=".part")
        with os.fdopen(handle, "wb") as file:
            np.save(file, rows)
        os.replace(part, path)
        seconds.append(time.perf_counter() - started)
    return group, seconds


def run(folder, columns, precision, groups):
    """All batches of all groups; seconds of each batch by group."""
    tasks = []
    for group in groups:
        number = batches(group, columns)
        for start in range(0, number, PORTION):
            some = range(start, min(start + PORTION, number))
            tasks.append((folder, group, some, precision))
    context = get_context("spawn")
    cores = context.Queue()
    names = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else [0]
    for core in names:
        cores.put(core)
    took = {group: [] for group in groups}
    with context.Pool(len(names), one_core, (cores,)) as pool:
        for group, seconds in pool.imap_unordered(judge, tasks, chunksize=1):
            took[group] += seconds
            print(f"{time.strftime('%X')} {group[:4]} {len(seconds)} batches", file=sys.stderr)
    return took


def read(folder, columns, precision, groups):
    """Everything that the batches hold, with the group and the index of every column's batch."""
    found = []
    for group in groups:
        number = GROUPS.index(group)
        for index in range(batches(group, columns)):
            rows = np.load(place(folder, group, index, precision))
            found.append((rows, np.full((rows.size, 3), (number, index, 0))))
            found[-1][1][:, 2] = np.arange(rows.size)
    rows, where = zip(*found, strict=True)
    return np.concatenate(rows), np.concatenate(where)


def judged(task):
    where, value, precision = task
    number, index, row = where
    group = GROUPS[number]
    batch = columns_of(group, index, precision)
    return stress_truth.error(batch.columns, row, group[0], value)


def beside_truth(rows, where, precision, count, most_streams=16):
    """The worst columns against 40 digits."""
    cheap = [k for k, g in enumerate(GROUPS) if g[0] <= most_streams]
    chosen = np.flatnonzero(np.isin(where[:, 0], cheap) & ~rows["beyond"])
    chosen = chosen[worst(rows[chosen], precision, count)]
    tasks = [(tuple(where[i].tolist()), float(rows["value"][i]), precision) for i in chosen]
    started = time.perf_counter()
    context = get_context("spawn")
    cores = context.Queue()
    for core in sorted(os.sched_getaffinity(0)):
        cores.put(core)
    with context.Pool(usable_cores(), one_core, (cores,)) as pool:
        errors = np.array(pool.map(judged, tasks, chunksize=1))
    known = errors[~np.isnan(errors)]
    print(f"The {chosen.size} worst columns of up to {most_streams} streams ", end="")
    print(f"against 40 digits ({time.perf_counter() - started:.0f} s): ", end="")
    print(f"median {np.median(known):.1e}, worst {known.max():.1e}", end="")
    print(f" ({described(rows, where, chosen[np.nanargmax(errors)])}); ", end="")
    print(f"{np.isnan(errors).sum()} without a truth\n")
    return bool(known.size > KNOWN * errors.size and (known <= RIGHT[precision]).all())


def refusals(precision):
    """Numbers out of range, one at a time among ordinary ones: refused by name, or not."""
    found = {}
    for group in GROUPS:
        if group[0] == 2 or group[3]:
            batch = columns_of(group, 0, precision).columns
            if group[3]:
                batch["solar_irradiance"] += 1  # without a sun its place is not asked
            for name, (offered, named) in refused(batch, group[0]).items():
                before = found.get(name, (0, 0))
                found[name] = before[0] + offered, before[1] + named
    offered, named = np.sum(list(found.values()), axis=0)
    print(f"Numbers out of range: {named} of {offered} refused by name (", end="")
    print(", ".join(f"{name} {a[1]}/{a[0]}" for name, a in found.items()) + ")\n")
    return offered == named


def project(took, columns):
    """How long a run takes once all is compiled, by the fastest batch of each group."""
    if not all(took.values()):
        return
    seconds = [batches(group, LONG) * min(each) for group, each in took.items()]
    hours = sum(seconds) / 3600 / usable_cores()
    print(f"{LONG} columns would take {hours:.1f} h of {usable_cores()} cores (", end="")
    each = [f"{g[0]} x {g[1]}: {s / 60:.0f} min" for g, s in zip(took, seconds, strict=True)]
    print(", ".join(each) + " of one core)\n")


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--columns", type=int, default=20_000)
    parser.add_argument("--precision", choices=PRECISIONS, default="float64")
    parser.add_argument("--most-streams", type=int, default=64, help="leave groups of more out")
    parser.add_argument("--judged", type=int, default=300)
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "stress")
    options = parser.parse_args()
    folder = options.folder / state_of_code()
    folder.mkdir(parents=True, exist_ok=True)
    started = time.perf_counter()
    jax.config.update("jax_enable_x64", True)
    use_compilation_cache()
    print(f"{options.columns} columns, {options.precision}, seed {SEED}, {folder}\n", flush=True)
    groups = [group for group in GROUPS if group[0] <= options.most_streams]
    took = run(folder, options.columns, options.precision, groups)
    rows, where = read(folder, options.columns, options.precision, groups)
    without_the_equations_own(rows, where, options.precision)
    without_what_is_conserved(rows, where, options.precision)
    without_albedos_of_the_equations(rows, where, options.precision)
    without_the_quotients_own(rows, where, options.precision)
    by_stratum(rows, options.precision)
    by_check(rows, where, options.precision)
    right = not options.judged or beside_truth(rows, where, options.precision, options.judged)
    named = refusals(options.precision)
    project(took, options.columns)
    print(f"{time.perf_counter() - started:.0f} s")
    wrong = any(failed(rows, name, options.precision).any() for name in CHECKS)
    sys.exit(1 if wrong or not named or not right else 0)


if __name__ == "__main__":
    main()
