"""How far off the defaults are: columns of every kind against many streams, kind by kind.

    python benchmarks/truth.py [--columns 1000] [--truth-streams 64] [--truth-modes 32] [--check]

Columns are those of `truth_columns`: clear, smoke, ash, dust, liquid, ice, mixed, snow ground, sea
and fire, as many of each, in seven bands with all gases, sun to 78 and view to 73 degrees from the
zenith. What a scene gives of them by default (`radiance`: sunlight, and emission in C07 and where
there are fires) stands beside the same optics at many streams, with phase functions of Mie theory
for droplets: their moments as many as streams need, and exact single scattering of the
whole phase function; then the same with `--cloud-optics mitchell`, against the same truth.

Errors are relative, in C01-C06 to no less than what a ground of albedo `FLOOR` would send up. Per
cent: median, 99th percentile, largest. `--check` exits with 1 where the goals are missed: 99 of 100
within 0.5 %, of columns with ice within 1 %. `--truth-error` says how good the truth is itself, on
columns of its own: against fewer streams and more azimuth modes. The last table has the errors of
other numbers of streams (`--streams`), with processor seconds of all columns and bands, and of as
many as columns need for 1 and 0.5 % (`scene.streams`).
"""

import argparse
import platform
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import jax
import numpy as np
from rounds import Bars, table
from truth_columns import BANDS, KINDS, make_states

from abi_operator import __version__, radiance, use_compilation_cache
from abi_operator.atmosphere import LIQUID_OPTICS
from abi_operator.machine.speed import usable_cores
from abi_operator.satellites import solar_irradiance
from abi_operator.scene.streams import streams_of

SEED = 20250821
FLOOR = 0.01
GOAL, GOAL_ICE = 5e-3, 1e-2
ICY = ("ice", "mixed")
# Columns of one call: the same for all, so that there is one program.
BLOCK = 16


def solved(states, **how):
    """Radiance (column, band), blocks of columns by as many threads as there are cores."""
    count = len(states.geometry.solar_zenith)
    starts = range(0, count, BLOCK)

    def block(start):
        rows = np.arange(start, start + BLOCK).clip(max=count - 1)
        found = radiance(jax.tree.map(lambda x: np.asarray(x)[rows], states), BANDS, **how)
        return np.asarray(found)[: count - start]

    first = block(0)  # compiled once, and not by every thread
    with ThreadPoolExecutor(usable_cores()) as threads:
        return np.concatenate([first, *threads.map(block, starts[1:])])


def relative_error(found, truth, states):
    """Error (column, band) of radiances; see the head of this file."""
    sun = np.cos(states.geometry.solar_zenith)[:, None] / np.pi
    floor = FLOOR * sun * np.array([solar_irradiance(band) for band in BANDS])
    floor[:, BANDS.index("C07")] = 0
    return np.abs(found - truth) / np.maximum(truth, floor)


def cell(errors):
    """Median, 99th percentile and largest, in per cent."""
    return " ".join(f"{100 * x:.2g}" for x in (*np.percentile(errors, (50, 99)), errors.max()))


def report(title, error, kinds):
    print(f"{title}; median, 99th percentile, largest in per cent:\n")
    rows = [[kind, *(cell(e) for e in error[kinds == kind].T)] for kind in KINDS]
    rows += [["all", *(cell(e) for e in error.T)]]
    for row, chosen in zip(rows, [*(kinds == k for k in KINDS), kinds != ""], strict=True):
        row.append(cell(error[chosen].ravel()))
    table(["kind", *BANDS, "all bands"], rows)


def truth_error(options):
    """How far the truth is from one of fewer streams and from one of twice the modes."""
    states, kinds = make_states(options.truth_error, SEED + 1, LIQUID_OPTICS[0])
    streams, modes = options.truth_streams, options.truth_modes
    truth = solved(states, num_streams=streams, num_modes=modes)
    for name, how in (
        (f"{streams // 2} streams", {"num_streams": streams // 2, "num_modes": modes}),
        (f"{2 * modes} modes", {"num_streams": streams, "num_modes": 2 * modes}),
    ):
        error = relative_error(solved(states, **how), truth, states)
        report(f"The truth beside {name}, {len(kinds)} columns", error, kinds)


def by_streams(states, kinds, truth, numbers):
    """Errors of columns without and with ice by streams, and what they cost."""
    icy, rows = np.isin(kinds, ICY), []
    for number in numbers:
        solved(jax.tree.map(lambda x: x[:BLOCK], states), num_streams=number)  # compiled apart
        start = time.process_time()
        error = relative_error(solved(states, num_streams=number), truth, states)
        seconds = time.process_time() - start
        rows.append([str(number), cell(error[~icy].ravel()), cell(error[icy].ravel())])
        rows[-1].append(f"{seconds:.1f}")
    for goal in (GOAL_ICE, GOAL):
        chosen = streams_of(states.atmosphere, goal)
        found = np.empty_like(truth)
        for number in np.unique(chosen):
            some = jax.tree.map(lambda x, rows=chosen == number: np.asarray(x)[rows], states)
            found[chosen == number] = solved(some, num_streams=int(number))
        error = relative_error(found, truth, states)
        rows.append([f"{100 * goal:g} %", cell(error[~icy].ravel()), cell(error[icy].ravel()), ""])
    print("Errors by streams; median, 99th percentile, largest in per cent:\n")
    table(["streams", "without ice", "with ice", "processor time [s]"], rows)


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--columns", type=int, default=1000)
    parser.add_argument("--truth-streams", type=int, default=64)
    parser.add_argument("--truth-modes", type=int, default=32)
    parser.add_argument("--streams", type=int, nargs="*", default=[8, 10, 12, 16])
    parser.add_argument("--truth-error", type=int, metavar="COLUMNS", default=0)
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    use_compilation_cache()  # a program of 64 streams compiles for a minute or two
    print(
        f"abi-operator {__version__}, jax {jax.__version__}, {jax.devices()[0].platform}, ", end=""
    )
    print(f"{platform.machine()}, {usable_cores()} cores, Python {sys.version.split()[0]}, float64")
    print(f"{options.columns} columns x {len(BANDS)} bands against ", end="")
    print(f"{options.truth_streams} streams, {options.truth_modes} azimuth modes\n", flush=True)
    if options.truth_error:
        truth_error(options)
        return
    bars, started = Bars(), time.perf_counter()
    new, old = LIQUID_OPTICS
    states, kinds = make_states(options.columns, SEED, new)
    truth = solved(states, num_streams=options.truth_streams, num_modes=options.truth_modes)
    for title, optics in (
        (f"Defaults (cloud optics {new})", new),
        (f"With `--cloud-optics {old}`", old),
    ):
        given, _ = make_states(options.columns, SEED, optics)
        error = relative_error(solved(given), truth, states)
        report(title, error, kinds)
        if optics == new:
            for goal, of, name in (
                (GOAL, ~np.isin(kinds, ICY), "columns without ice"),
                (GOAL_ICE, np.isin(kinds, ICY), "columns with ice"),
            ):
                p99 = np.percentile(error[of], 99)
                bars.judge(p99 <= goal, f"{name}: p99 {100 * p99:.2g} %, goal {100 * goal:g} %")
    by_streams(states, kinds, truth, options.streams)
    print(f"{time.perf_counter() - started:.0f} s\n")
    bars.report()
    sys.exit(1 if options.check and bars.failed else 0)


if __name__ == "__main__":
    main()
