"""Run time against error, of this solver and of others, on columns that scenes hold.

    python benchmarks/pareto.py [--workloads W1 W2 W3 W4] [--columns 10000] [--budgets 1e-2 1e-3]

The columns are those of `pareto_columns`. A solver meets an error where the 99th percentile of
|difference of brf| / max(brf, 0.01) does, against 64 streams with every layer, every mode and the
whole phase function: this solver with nothing skipped, which nanodisort checks in the same run.
Where phase functions are peaked, as those of droplets, it says how far 128 streams are from it.
Other solvers have the cheapest setting that meets it on
these very columns (`pareto_peers`), this one streams fixed beforehand (`pareto_ours.STREAMS`).
Times are from NumPy to NumPy in float64, compiling apart, by medians of rounds in which each has
its turn. Three comparisons stand side by side: (a) nothing is skipped by anybody, (b) this solver
skips what the error allows, which is what is judged, and (c) others skip too, by merged layers and
an early end of the azimuth series. Gradients are those of this solver in everything, of others in
tau, ssa and albedo: sasktran2's own, or differences of a DISORT, whose time is that of its plain
call times so many runs; the error beside them is that of the value (slopes are judged by
`skipping.py`). No number of ours was fitted on these columns, whose seeds begin at `SEED`.
sasktran2 has one sun and view a call, so it is given one, without emission; PythonicDISORT is left
out, as the slowest by far. `--check` exits with 1 on a miss.
"""

import argparse
import os
import platform
import sys
import time
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import jax
import numpy as np
import pareto_columns
import pareto_ours as ours
from pareto_columns import ITERATES, WORKLOADS, Columns
from pareto_peers import (
    DISORTS,
    ONE_GEOMETRY,
    PLAIN,
    Runner,
    Setting,
    searches,
    series_length,
    sufficient,
)
from pareto_report import Line, Report
from peers import PEERS, peer_version
from plain import without_settings
from rounds import Timed
from skipping import FIRST_SEED

from abi_operator import __version__
from abi_operator.machine.speed import usable_cores

FORWARD, GRADIENT = ("W1", "W2", "W3"), ("W1", "W2", "W4")
CAPACITY = 3000  # most columns of a peer's call
CHECKED = 48  # columns on which nanodisort checks the truth
SEED = 2000  # of the first round; shares of budgets and streams were fitted on others
TWICE = 24  # with a peak, that are solved by 128 streams as well
DERIVATIVES = "sasktran2 + derivatives"


@dataclass(frozen=True)
class Turn:
    """Columns of one round: images, and of one of them a random sample for the peers.

    The first `judged` columns of the sample are those whose truth is known.
    """

    images: list[Columns]
    chosen: int
    order: np.ndarray
    judged: int

    @cached_property
    def sample(self):
        return self.images[self.chosen].rows(self.order[:CAPACITY])

    @cached_property
    def true_own(self):
        return ours.truth(self.sample.first(self.judged))

    @cached_property
    def true_one(self):
        """The truth under one sun and view, without emission."""
        moved = self.sample.first(self.judged).with_geometry(*ONE_GEOMETRY)
        return ours.truth(moved, emission=False)

    def error(self, brf):
        """Of all columns of all images, where the truth is known."""
        start = sum(x.count for x in self.images[: self.chosen])
        return ours.relative_error(brf[start + self.order[: self.judged]], self.true_own)


def drawn(workload, turn, options, num_layers=None):
    """Columns of a round; those of W4 are all iterates, each of a tenth of the columns."""
    make = partial(pareto_columns.columns, workload, seed=options.seed + turn)
    make = partial(make, num_layers=num_layers)
    if workload == "W4":
        few = max(options.columns // ITERATES, 1)
        images = [make(few, iterate=k) for k in range(ITERATES)]
    else:
        images = [make(options.columns)]
    chosen = turn % len(images)
    order = np.random.default_rng(turn).permutation(images[chosen].count)
    return Turn(images, chosen, order, min(options.truth, len(order)))


def our_programs(workload, budgets):
    """Each of our programs by kind, error and whether it skips: how it is called."""
    kinds = [k for k, known in (("forward", FORWARD), ("gradient", GRADIENT)) if workload in known]
    return {
        (kind, budget, skipping): (
            ours.gradient if kind == "gradient" else ours.value,
            ours.options_of(workload, budget, skipping),
        )
        for kind in kinds
        for budget in budgets
        for skipping in (False, True)
    }


class Timing:
    """Rounds in which every program has its turn; errors are those of the timed calls."""

    def __init__(self, turns, runner: Runner, programs, counts):
        self.turns, self.runner, self.programs = turns, runner, programs
        self.timed = {key: Timed(sum(x.count for x in turns[0].images)) for key in programs}
        self.timed |= {key: Timed(count) for key, count in counts.items()}
        self.layers_left = []
        self.errors = {key: [] for key in self.timed}

    def run(self):
        for key in self.programs:
            self.timed[key].first = self._ours(key, self.turns[0])[1]
        for number, turn in enumerate(self.turns):
            self.runner.take([turn.sample])
            self.layers_left.append(self.runner.layers_left)
            order = list(self.timed)
            start = number * 5 % len(order)
            for key in order[start:] + order[:start]:
                if key in self.programs:
                    brf, seconds = self._ours(key, turn)
                    error = turn.error(brf)
                else:
                    brf, seconds = self.runner.solve(key, self.timed[key].count)
                    one = PEERS[key.peer].one_geometry
                    true_brf = turn.true_one if one else turn.true_own
                    error = ours.relative_error(brf[: turn.judged], true_brf[: len(brf)])
                self.timed[key].seconds.append(seconds)
                self.errors[key].append(error)

    def _ours(self, key, turn):
        call, options = self.programs[key]
        parts = [ours.parts_of(x, options["num_streams"]) for x in turn.images]
        start = time.perf_counter()
        light = [call(x, options) for x in parts]
        seconds = time.perf_counter() - start
        brf = [ours.as_brf(p, x) for p, x in zip(parts, light, strict=True)]
        return np.concatenate(brf), seconds

    def line(self, key, workload, kind, budget, solver, rows, factor=1.0, label=None):
        timed = self.timed[key]
        micro = [factor * 1e6 * x / timed.count for x in timed.seconds]
        label = label or str(key)
        errors = np.concatenate(self.errors[key])
        return Line(workload, kind, budget, rows, solver, label, timed.count, micro, errors)


def checked(runner, turns, report, workload):
    """The truth beside nanodisort at as many streams, and twice as many where there is a peak.

    There series are cut off for nanodisort, so that solvers are compared by delta-M alone.
    """
    sample = turns[0].sample.first(turns[0].judged)
    peaked = np.flatnonzero(ours.peaked(sample))
    some = sample.first(CHECKED)
    own = ours.without_correction(some) if len(peaked) else turns[0].true_own[:CHECKED]
    setting = Setting("nanodisort", ours.TRUE_STREAMS, corrected=not len(peaked))
    apart = ours.relative_error(runner.solve(setting, len(own))[0], own)
    report.check_truth(workload, len(own), apart.max())
    if len(peaked):
        twice = ours.truth(sample.rows(peaked[:TWICE]), num_streams=2 * ours.TRUE_STREAMS)
        own = turns[0].true_own[peaked[:TWICE]]
        report.twice(len(own), ours.relative_error(own, twice))


def chosen(trials_of, budgets):
    """Setting of each peer, by error and whether it skips; None where none of them suffices."""
    found = {}
    for (peer, careful), trials in trials_of.items():
        for budget in budgets:
            met = sufficient(trials, budget)
            found[peer, careful, budget] = met[0] if met else None
    return found


def measured(workload, options, report: Report):
    """All of a workload: truth, searches, rounds."""
    first = drawn(workload, 0, options)
    num_layers = first.sample.tau.shape[1]
    turns = [first, *(drawn(workload, t, options, num_layers) for t in range(1, options.repeats))]
    samples = [x.sample.first(x.judged) for x in turns]
    num_moments = series_length(samples)
    emission = bool(WORKLOADS[workload].emitting)
    judged = sum(x.judged for x in turns)
    capacity = max(judged, first.sample.count)
    report.about(workload, num_layers, num_moments, judged)
    with Runner(options.cores, capacity, num_layers, num_moments, emission) as runner:
        runner.take(samples)
        checked(runner, turns, report, workload)
        true_own, true_one = (
            np.concatenate([getattr(x, k) for x in turns]) for k in ("true_own", "true_one")
        )
        trials_of = searches(runner, true_own, true_one, options.budgets)
        report.trials(workload, trials_of)
        found = chosen(trials_of, options.budgets)
        counts = {x.setting: x.microseconds for x in found.values() if x}
        if workload in GRADIENT:
            own = {s: t for s, t in counts.items() if s.peer == "sasktran2"}
            counts |= {replace(s, peer=DERIVATIVES): 5 * t for s, t in own.items()}
        most = first.sample.count
        runner.take([first.sample])
        counts = {
            setting: runner.affordable(setting, micro, options.seconds, first.judged, most)
            for setting, micro in counts.items()
        }
        timing = Timing(turns, runner, our_programs(workload, options.budgets), counts)
        timing.run()
    report.lines += lines_of(workload, timing, found, num_layers)


def lines_of(workload, timing: Timing, found, num_layers):
    """What stands in the table: ours and, for each kind and error, each peer's."""
    lines = []
    for key, (_, options) in timing.programs.items():
        kind, budget, skipping = key
        label = ", ".join(f"{k} {x}" for k, x in options.items())
        rows = "bc" if skipping else "a"
        lines.append(timing.line(key, workload, kind, budget, "ours", rows, label=label))
    kinds = {kind for kind, _, _ in timing.programs}
    for (peer, careful, budget), trial in found.items():
        if trial is None:
            continue
        # What cannot skip takes part in (c) as it is.
        rows = "c" if careful else ("ab" if peer in DISORTS else "abc")
        setting = trial.setting
        line = partial(timing.line, workload=workload, budget=budget, rows=rows)
        if "forward" in kinds:
            lines.append(line(setting, kind="forward", solver=peer))
        if "gradient" not in kinds:
            continue
        if peer in DISORTS:
            layers = np.mean(timing.layers_left) if careful else num_layers
            more = {"factor": 2 * layers + 2, "label": f"{setting}, {2 * layers + 2:.0f} runs"}
            lines.append(line(setting, kind="gradient", solver=f"{peer}, differences", **more))
        elif peer == "sasktran2":
            own = replace(setting, peer=DERIVATIVES)
            lines.append(line(own, kind="gradient", solver=DERIVATIVES))
    return lines


def parsed():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--workloads", nargs="+", default=list(WORKLOADS), choices=WORKLOADS)
    parser.add_argument("--columns", type=int, default=10_000)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--budgets", type=float, nargs="+", default=[1e-2, 1e-3])
    parser.add_argument("--truth", type=int, default=100, help="columns a round with 64 streams")
    parser.add_argument("--seconds", type=float, default=2.0, help="most of a slow peer's call")
    parser.add_argument("--seed", type=int, default=SEED, help="of the first round")
    parser.add_argument("--picture", metavar="PATH")
    parser.add_argument("--check", action="store_true")
    return parser.parse_args()


def processor():
    """Name of the processor, where Linux says it."""
    path = Path("/proc/cpuinfo")
    lines = path.read_text().splitlines() if path.exists() else []
    names = [x.split(":")[1].strip() for x in lines if x.startswith("model name")]
    return names[0] if names else jax.devices()[0].device_kind


def main():
    options = parsed()
    if os.environ != without_settings():  # a plain process has none
        os.execve(sys.executable, sys.orig_argv, without_settings())
    if options.seed < FIRST_SEED:
        sys.exit(f"shares of the budget were fitted on seeds below {FIRST_SEED}; give another.")
    if not set(options.budgets) <= set(ours.STREAMS["W1"]):
        sys.exit(f"streams are known for errors of {list(ours.STREAMS['W1'])} only.")
    jax.config.update("jax_enable_x64", True)
    options.cores = usable_cores()
    found = {name: peer_version(name) for name in PLAIN}
    if None in found.values():
        sys.exit('Peers are missing: pip install "abi-operator[benchmark]".')
    versions = ", ".join(f"{name} {x}" for name, x in found.items())
    print(f"abi-operator {__version__}, jax {jax.__version__}, {versions}")
    print(f"{processor()}, {platform.machine()}, {options.cores} cores and processes, Python")
    print(f"{sys.version.split()[0]}, NumPy {np.__version__}, float64, {options.columns} columns")
    print(f"in a call of ours, {options.repeats} rounds\n", flush=True)
    report = Report(options)
    for workload in options.workloads:
        measured(workload, options, report)
        report.table(workload)
    report.summary()
    if options.picture:
        from pareto_picture import draw

        draw(report, options.picture)
    sys.exit(1 if options.check and report.bars.failed else 0)


if __name__ == "__main__":
    main()
