"""Other solvers on the columns of `pareto_columns`: their settings, and the cheapest that suffice.

A peer may be set in three ways: its streams, from two or the fewest that it takes on; with or
without an exact single scattering (the DISORTs' correction of Nakajima and Tanaka, sasktran2's own
integral), by so many moments as the phase functions have; and when CDISORT ends its azimuth series.
Given merged layers, neighbouring layers of one optics are one to it, and a column that comes twice
is solved once; merging is not part of its time.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import blake2b
from itertools import product

import numpy as np
import pareto_ours as ours
from pareto_columns import Columns
from peers import AXES, PEERS, Peers, planck_temperature

STREAMS = (2, 4, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64)
STOPS = (0.0, 1e-5, 1e-4, 1e-3, 1e-2)
DISORTS = ("nanodisort", "disortpp")  # those that end early, and may be given merged layers
PLAIN = (*DISORTS, "sasktran2")
ONE_GEOMETRY = 0.6, 0.65, 1.6  # cosines of sun and view, azimuth [rad], for all columns
LONGEST_SERIES = 385  # moments
SERIES_END = 1e-3  # (2l + 1) chi_l of the last moment of a series
SAME = 1e-12  # optics of two layers that are one
SEARCH_SECONDS = 5.0  # of a call of the search at most, roughly
FEWEST = 64  # columns of such a call
BRIEF = 2.0  # calls that take less are timed twice there [s]


@dataclass(frozen=True)
class Setting:
    """How a peer is called."""

    peer: str
    num_streams: int
    corrected: bool = False
    early_stop: float = 0.0
    merged: bool = False

    def __str__(self):
        words = [f"{self.num_streams} streams", "corrected" if self.corrected else "delta-M"]
        words += [f"stop at {self.early_stop:.0e}"] if self.early_stop else []
        return ", ".join(words + ["merged"] if self.merged else words)


@dataclass(frozen=True)
class Trial:
    """What a setting reached on the columns of the search."""

    setting: Setting
    microseconds: float
    errors: np.ndarray

    @property
    def p99(self):
        return np.percentile(self.errors, 99)


def series_length(columns: Sequence[Columns]):
    """Moments that the phase functions have: so many that the rest changes nothing."""
    needed = max(STREAMS) + 1
    for some in columns:
        moments = some.moments(LONGEST_SERIES)
        scatters = (some.tau * some.ssa > 1e-4)[..., None]
        size = ((2 * np.arange(LONGEST_SERIES) + 1) * moments * scatters).max(axis=(0, 1))
        needed = max(needed, np.flatnonzero(size > SERIES_END).max(initial=0) + 2)
    return int(min(needed, LONGEST_SERIES))


def scaled(tau, ssa, moments):
    """Layers of which what the series does not reach goes on: delta-M at the last moment.

    The correction sums the series, and one that is cut off far from its end, as those of drops and
    crystals are, swings about the phase function by more than that: so the second half of it fades
    out as well. Delta-M at fewer moments, as a solver does it, gives the same afterwards as before.
    """
    f, length = moments[..., -1], moments.shape[-1] - 1
    if length < LONGEST_SERIES:  # it has an end
        return tau, ssa, moments[..., :-1]
    fade = np.clip(2 * np.arange(length) / length - 1, 0, 1)
    window = 0.5 * (1 + np.cos(np.pi * fade))
    kept = 1 - ssa * f
    left = (moments[..., :-1] - f[..., None]) / (1 - f)[..., None]
    return kept * tau, (1 - f) * ssa / kept, window * left


def arrays_of(columns: Columns, num_moments):
    """Columns by the names of `peers.AXES`, with temperatures where they emit."""
    arrays = scaled(columns.tau, columns.ssa, columns.moments(num_moments + 1))
    arrays += (columns.albedo, columns.mu0, columns.mu, columns.relative_azimuth)
    found = dict(zip(AXES, arrays, strict=True))
    if columns.planck_levels is not None:
        # The ground of the peers emits 1 - albedo of a black one.
        ground = columns.surface_emission / (1 - columns.albedo)
        found["temperature"] = planck_temperature(columns.planck_levels)
        found["ground_temperature"] = planck_temperature(ground)
        found["irradiance"] = np.where(columns.emits, columns.solar_irradiance, 0.0)
    return found


def merge(arrays):
    """Layers of one optics as one: the arrays, and how many layers each column has left.

    Layers of columns that emit stay, as the Planck function is linear in each.
    """
    tau, ssa, moments = (arrays[k] for k in ("tau", "ssa", "moments"))
    rows = np.arange(len(tau))[:, None]
    same = np.abs(np.diff(ssa, axis=1)) <= SAME
    same &= np.abs(np.diff(moments, axis=1)).max(axis=2) <= SAME
    if "irradiance" in arrays:
        same &= arrays["irradiance"][:, None] == 0
    place = np.concatenate([np.zeros((len(tau), 1), int), np.cumsum(~same, axis=1)], axis=1)
    used = place[:, -1] + 1
    merged = {
        k: np.zeros((len(tau), used.max(), *x.shape[2:]))
        for k, x in arrays.items()
        if k in ("tau", "ssa", "moments")
    }
    np.add.at(merged["tau"], (rows, place), tau)
    merged["ssa"][rows, place], merged["moments"][rows, place] = ssa, moments
    if "temperature" in arrays:
        merged["temperature"] = arrays["temperature"][:, : used.max() + 1]
    return arrays | merged, used


def without_duplicates(arrays):
    """Rows that no earlier row equals, and for every row which of them it is."""
    seen: dict[bytes, int] = {}
    of_row = []
    for i in range(len(arrays["tau"])):
        digest = blake2b()
        for x in arrays.values():
            digest.update(np.ascontiguousarray(x[i]))
        of_row.append(seen.setdefault(digest.digest(), len(seen)))
    return np.unique(of_row, return_index=True)[1], np.array(of_row)


class Runner:
    """Peers of one workload, with the columns in each form that they take."""

    def __init__(self, num_processes, capacity, num_layers, num_moments, emission):
        self.num_moments = num_moments
        self.peers = Peers(num_processes, capacity, num_layers, num_moments, emission)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.peers.__exit__()

    def take(self, columns: Sequence[Columns]):
        """Columns of the following calls, one form of which is put when it is called for."""
        parts = [arrays_of(x, self.num_moments) for x in columns]
        own = {k: np.concatenate([x[k] for x in parts]) for k in parts[0]}
        rows, self.of_row = without_duplicates(own)
        geometry = dict(zip(("mu0", "mu", "azimuth"), ONE_GEOMETRY, strict=True))
        one = own | {k: np.full(len(own[k]), x) for k, x in geometry.items()}
        merged, used = merge({k: x[rows] for k, x in own.items()})
        self.forms = {"own": (own, None), "one": (one, None), "merged": (merged, used)}
        self.put = None

    @property
    def layers_left(self):
        """Layers of a column on average once those of one optics are merged."""
        return self.forms["merged"][1].mean()

    def solve(self, setting: Setting, count):
        """brf of the first columns, and seconds."""
        form = "one" if PEERS[setting.peer].one_geometry else "own"
        form = "merged" if setting.merged else form
        if form != self.put:
            self.peers.put_arrays(*self.forms[form])
            self.put = form
        solved = self.of_row[:count].max() + 1 if setting.merged else count
        n = setting.num_streams
        length = max(self.num_moments, n + 1) if setting.corrected else n + 1
        options = {"corrected": setting.corrected, "num_moments": length}
        if setting.peer in DISORTS:
            options["early_stop"] = setting.early_stop
        start = time.perf_counter()
        brf = self.peers.solve(setting.peer, setting.num_streams, solved, **options)[0]
        seconds = time.perf_counter() - start
        return (brf[self.of_row[:count]] if setting.merged else brf), seconds

    def affordable(self, setting: Setting, microseconds, most_seconds, fewest, most):
        """Columns of a call that lasts so long at most; few columns are slower than many."""
        count = int(np.clip(1e6 * most_seconds / microseconds, fewest, most))
        spent = self.solve(setting, count)[1]
        return int(np.clip(count * most_seconds / spent, fewest, most))


def search(runner: Runner, peer, true_brf, budgets, careful):
    """Trials of a peer from few streams on, until more of them cannot be cheaper.

    `careful`: with merged layers, and all ways to end early.
    """
    fewest = max(PEERS[peer].fewest_streams, min(STREAMS))
    runner.solve(Setting(peer, fewest), 4)  # processes load the package at its first call
    trials: list[Trial] = []
    rate = np.inf
    for n in (x for x in STREAMS if x >= fewest):
        guess = rate * SEARCH_SECONDS
        count = int(np.clip(guess, min(FEWEST, len(true_brf)), len(true_brf)))
        seconds = []
        for corrected in (True, False):
            for stop in STOPS if careful else (0.0,):
                setting = Setting(peer, n, corrected, stop, careful)
                trial = tried(runner, setting, true_brf[:count])
                seconds.append(trial.microseconds / 1e6)
                open_budgets = [b for b in budgets if could_be_cheapest(trial, trials, b)]
                trials.append(trial)
                # A series that ends earlier still leaves no less.
                if trial.p99 > max(open_budgets, default=0):
                    break
        rate = 1 / max(seconds) / 4  # the next number of streams may cost four times as much
        met = [sufficient(trials, b) for b in budgets]
        if all(met) and min(seconds) * 1e6 > max(x[0].microseconds for x in met):
            break
    return trials


def tried(runner: Runner, setting, true_brf):
    count = len(true_brf)
    brf, spent = runner.solve(setting, count)
    if spent < BRIEF:  # a call may be held up by something else
        spent = min(spent, runner.solve(setting, count)[1])
    return Trial(setting, 1e6 * spent / count, ours.relative_error(brf, true_brf))


def could_be_cheapest(trial, trials, budget):
    """Whether nothing that meets an error is cheaper, unless by much: an early end saves half."""
    met = sufficient(trials, budget)
    return not met or trial.microseconds < 2 * met[0].microseconds


def sufficient(trials, budget):
    """Trials that meet an error, the cheapest first."""
    return sorted((x for x in trials if x.p99 <= budget), key=lambda x: x.microseconds)


def searches(runner, true_own, true_one, budgets):
    """Trials by peer and whether they are careful."""
    found = {}
    for peer, careful in product(PLAIN, (False, True)):
        if careful and peer not in DISORTS:
            continue
        true_brf = true_one if PEERS[peer].one_geometry else true_own
        found[peer, careful] = search(runner, peer, true_brf, budgets, careful)
    return found
