"""Do long runs end well? Kills, full disks, two runs at once, memory, threads and processes.

    python benchmarks/long_runs.py [--kills 20] [--rounds 5] [--blocks 4000] [--seed 7]
        [--only killed,memory] [--folder F]

One row a check: how often it was tried, how often it failed, and what happened. Commands run in
processes of their own, on a small series of the demonstration's scene (`long_runs_commands`); the
steps of a writer on the disk are `long_runs_steps`', memory `long_runs_memory`'s, threads and
processes `long_runs_operator`'s. Disks are mounted where root runs it; elsewhere full and
read-only ones are not tried, but for the size that a file may have.

Exits with 1 where a check failed.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import long_runs_commands as commands
from long_runs_commands import Found, Place
from long_runs_files import ROOT
from long_runs_operator import COUNT, KINDS

NAMES = ("simulate", "retrieve", "observe")
HANGS = "fork"  # after JAX has begun, as README says
PATIENCE = 120.0  # [s]
# HDF5 keeps what it knows of an open file's chunks in a cache, some 4 kB for each block, until that
# is full, before the second third of thousands of blocks begins.
FLAT = 1.0  # [kB a block]


def script(name, *words, cache, timeout=None):
    """What one of the scripts beside this prints; None where it does not end in time."""
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = os.environ | {"PYTHONPATH": path, "JAX_COMPILATION_CACHE_DIR": str(cache)}
    place = Path(__file__).with_name(f"long_runs_{name}.py")
    # A group of its own: what hangs has children.
    process = subprocess.Popen(
        [sys.executable, "-P", str(place), *map(str, words)],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        said, error = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, 9)
        process.communicate()
        return None
    assert process.returncode == 0, error
    return json.loads(said)


def steps(folder, cache):
    """Every step of a writer on the disk."""
    tried, found = script("steps", folder, cache=cache)
    failed = [f"step {k}: {v}" for k, v in found.items()]
    return Found(tried, failed, "killed at every step, then written again")


def memory(folder, blocks, cache):
    """Memory of a long run."""
    count, first, last, slope, error = script("memory", folder, blocks, cache=cache)
    said = f"{first} MB after a third, {last} MB at the end; {slope:.2f} ± {error:.2f} kB a block"
    return Found(count, [said] if slope > FLAT else [], said)


def same_numbers(kind, cache):
    """Values and gradients in a pool."""
    found = script("operator", kind, cache=cache, timeout=PATIENCE)
    if found is None:
        said = f"no answer within {PATIENCE:.0f} s"
        return Found(COUNT, [] if kind == HANGS else [said], said + ", as README says")
    same, number, _ = found
    failed = [f"{number - same} other"] * (number - same)
    return Found(number, failed, f"{same} of {number} values and gradients the same, bit by bit")


def worker_dies(cache):
    """A process of a pool is killed, as by a system out of memory."""
    same, before, error = script("operator", "dies", cache=cache, timeout=PATIENCE)
    said = f'{before} answered, then "{error}"; all others by a new pool'
    return Found(COUNT, [f"{COUNT - same} other"] * (COUNT - same), said)


def dask_worker_dies(cache):
    """The same of dask, which gives to others what a worker leaves."""
    if find_spec("distributed") is None:
        return Found(0, [], "not tried: dask's `distributed` is not installed")
    same, died, _ = script("operator", "dask", cache=cache, timeout=PATIENCE)
    failed = [f"{COUNT - same} other"] * (COUNT - same) + ["no worker died"] * (not died)
    return Found(COUNT, failed, f"{died} of 2 workers killed, {same} of {COUNT} answers the same")


def checks(folder, arguments):
    """Names, and what makes the rows."""
    place, cache = Place(folder), folder / "programs-of-scripts"
    for name in NAMES:
        once = partial(commands.killed, place, name, arguments.kills, arguments.seed)
        yield f"killed: {name}", once
    yield "killed: steps on the disk", partial(steps, _made(folder / "steps"), cache)
    yield "told to end", partial(commands.kept_when_told_to_end, place)
    for name in NAMES:
        yield f"room: file of {name}", partial(commands.out_of_room, place, name)
        if os.geteuid() == 0:
            yield f"room: disk of {name}", partial(commands.full_disk, place, name)
            yield f"read-only: {name}", partial(commands.read_only, place, name)
    yield "two at once", partial(commands.at_once, place, arguments.rounds)
    yield "memory", partial(memory, _made(folder / "memory"), arguments.blocks, cache)
    for kind in KINDS:
        yield f"numbers: {kind}", partial(same_numbers, kind, cache)
    yield "numbers: a worker that dies", partial(worker_dies, cache)
    yield "numbers: a worker of dask that dies", partial(dask_worker_dies, cache)


def _made(folder):
    folder.mkdir(exist_ok=True)
    return folder


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--blocks", type=int, default=4000)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--only", default="", help="beginnings of names, separated by commas")
    parser.add_argument("--folder", type=Path)
    arguments = parser.parse_args()
    chosen = tuple(arguments.only.split(","))
    failed = 0
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary) if arguments.folder is None else arguments.folder
        print("| check | tried | failed | what happened |\n| --- | --- | --- | --- |", flush=True)
        for name, check in checks(folder, arguments):
            if not name.startswith(chosen):
                continue
            found = check()
            failed += len(found.failed)
            print(
                f"| {name} | {found.tried} | {len(found.failed)} | {found.happened} |", flush=True
            )
            for words in found.failed:
                print(f"{name}: {words}", file=sys.stderr)
    return min(failed, 1)


if __name__ == "__main__":
    sys.exit(main())
