"""What a scene costs from a thousand columns to a million: a user's command, as a whole process.

    python benchmarks/scene_sizes.py [--sizes 32 100 316 1000] [--check]

draws the demonstration's coast in ever more rows and columns and runs `abi-operator simulate` on
it, in six bands with gases, at its defaults: streams, error budget, files written. Each size is
run twice in processes of their own, so that no program is compiled the second time; the table has
the second. A process takes seconds before it solves anything: a column and band costs what it takes
more than that of the scene before. `--check` exits with 1 where that grows from the second size to
the last (of the first it is mostly noise), or where a process takes more than 3 GiB.
"""

import argparse
import os
import platform
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from plain import without_settings
from rounds import Bars, table

from abi_operator import __version__
from abi_operator.demo import DemoInputs
from abi_operator.machine.processor import usable_cores

SIZES = (32, 100, 316, 1000)
BANDS = ("C01", "C02", "C03", "C04", "C05", "C06")
MOST_MEMORY = 3 * 2**30  # bytes
GROWTH = 1.15  # of what a column and band costs
RUNS = 2
_KIB = 1 if sys.platform == "darwin" else 1024  # the unit of ru_maxrss


def drawn(folder, size):
    """Files of a scene, from a process of its own: Linux counts the most that this one has ever had
    as the most of those that it begins.
    """
    call = "import sys; from abi_operator.demo import write_demo; "
    call += "print(*write_demo(sys.argv[1], size=int(sys.argv[2])), sep='\\n')"
    words = [sys.executable, "-P", "-c", call, str(folder / "inputs"), str(size)]
    found = subprocess.run(words, env=settings(folder), capture_output=True, check=True, text=True)
    return DemoInputs(*map(Path, found.stdout.split("\n")[:4]))


def settings(folder):
    """Surroundings of a process: no setting of JAX or XLA, and a folder for compiled programs."""
    own = {"XDG_CACHE_HOME": str(folder / "cache")}
    return without_settings() | own | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


def simulated(folder, inputs):
    """Seconds and most bytes of a process that simulates a scene."""
    words = [sys.executable, "-P", "-m", "abi_operator", "simulate", str(inputs.wrf)]
    words += ["--albedo", str(inputs.albedo), "--ocean-albedo", "0.03"]
    words += ["--plume", str(inputs.plume), "--bands", ",".join(BANDS)]
    words += ["--out", str(folder / "result")]
    start = time.perf_counter()
    process = subprocess.Popen(
        words, env=settings(folder), stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    output = process.stdout.read().decode()
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(f"`{' '.join(words[3:])}` failed:\n{output}")
    return seconds, usage.ru_maxrss * _KIB


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES)
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    bars, rows, costs, before = Bars(), [], [], (0, 0.0)
    for size in sorted(options.sizes):
        # Every scene in a folder that is gone before the next: files of a million are gigabytes.
        with tempfile.TemporaryDirectory() as name:
            inputs = drawn(Path(name), size)
            seconds, memory = [simulated(Path(name), inputs) for _ in range(RUNS)][-1]
        count = size * size * len(BANDS)
        costs.append((seconds - before[1]) / (count - before[0]))
        row = [f"{size * size:,}", f"{seconds:.1f}", f"{memory / 2**30:.2f}"]
        rows.append([*row, f"{costs[-1] * 1e6:.1f}" if before[0] else ""])
        bars.judge(memory <= MOST_MEMORY, f"{size * size:,} columns: {memory / 2**30:.2f} GiB")
        before = count, seconds
    for fewer, cost in zip(costs[2:], costs[3:], strict=False):
        bars.judge(cost <= GROWTH * fewer, f"a column costs {cost / fewer:.2f} of one of fewer")
    print(f"abi-operator {__version__}, {platform.machine()}, {usable_cores()} cores")
    print(f"bands {', '.join(BANDS)}\n")
    head = ["columns", "seconds", "most memory [GiB]", "microseconds a column and band"]
    table(head, rows)
    print()
    bars.report()
    sys.exit(1 if options.check and bars.failed else 0)


if __name__ == "__main__":
    main()
