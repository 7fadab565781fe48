"""Timing in rounds: every program has its turn in each, on columns that no round before had."""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import jax
import numpy as np
import workload

AGREE = 1e-5  # largest relative difference to nanodisort at equal streams


@dataclass
class Bars:
    """What was judged."""

    passed: list[str] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)

    def judge(self, holds, text):
        (self.passed if holds else self.failed).append(text)

    def report(self):
        print(f"{len(self.passed)} bars held, {len(self.failed)} missed")
        for text in self.failed:
            print(f"MISSED: {text}")


@dataclass
class Timed:
    """One program's calls: the first, which compiles, and one in each round."""

    count: int
    first: float = 0.0
    seconds: list[float] = field(default_factory=list)
    brf: list[np.ndarray] = field(default_factory=list)
    slopes: tuple = ()  # of the last round

    @property
    def microseconds(self):
        return statistics.median(self.seconds) / self.count * 1e6

    @property
    def spread(self):
        low, high = (f(self.seconds) / self.count * 1e6 for f in (min, max))
        return f"{digits(low)}-{digits(high)}"


@dataclass(frozen=True)
class Program:
    """Something of ours to time.

    `call` gives brf, or brf and derivatives; `prepare` turns columns and streams into what it
    takes, untimed (None: the arguments of `toa_brf`).
    """

    call: Callable[..., Any]
    prepare: Callable[..., tuple] | None = None


class Rounds:
    """Calls every program once in a round; columns differ from round to round."""

    def __init__(self, peers, repeats, seconds):
        self.peers, self.repeats, self.seconds = peers, repeats, seconds

    def drawn(self, turn, count, num_layers):
        return workload.columns(count, num_layers, seed=turn)

    def run(self, ours, num_streams, num_layers, count, names, dtype=np.float64, series=None):
        """Time `ours`, a `Program` by name, and the peers `names`; round 0 compiles."""
        jax.clear_caches()  # so that the first call compiles whatever ran before
        timed = {name: Timed(count) for name in ours}
        sizes = {}
        for turn in range(self.repeats + 1):
            given = self.drawn(turn, count, num_layers)
            self.peers.put(given.first(min(count, self.peers.capacity)))
            if turn == 0:
                sizes = {k: self._affordable(k, num_streams, count) for k in names}
                timed |= {name: Timed(n) for name, n in sizes.items()}
            arrays = workload.arguments(given, num_streams, dtype, series)
            order = list(timed)
            order = order[turn % len(order) :] + order[: turn % len(order)]
            for name in order:
                program = ours.get(name)
                own = program is not None and program.prepare is not None
                inputs = program.prepare(given, num_streams) if own else arrays
                start = time.perf_counter()
                if program:
                    result = program.call(*inputs)
                else:
                    result = self.peers.solve(name, num_streams, sizes[name])[0]
                seconds = time.perf_counter() - start
                brf, slopes = result if isinstance(result, tuple) else (result, ())
                if turn == 0:
                    timed[name].first = seconds
                else:
                    timed[name].seconds.append(seconds)
                    timed[name].brf.append(brf)
                    timed[name].slopes = slopes
        return timed

    def _affordable(self, name, num_streams, count):
        """Columns a call: all of nanodisort's, which judges ours, and what the time allows."""
        count = min(count, self.peers.capacity)
        few = min(count, 4 * self.peers.num_processes)
        self.peers.solve(name, num_streams, few)
        if name == "nanodisort":
            return count
        start = time.perf_counter()
        self.peers.solve(name, num_streams, few)
        rate = few / (time.perf_counter() - start)
        return int(np.clip(rate * self.seconds, few, count))


def digits(x):
    """A number of microseconds, never with an exponent."""
    return f"{x:,.{2 if x < 100 else 1 if x < 1000 else 0}f}"


def apart(brf, reference):
    """Largest relative difference where both are known, over all rounds."""
    return np.max(relative(brf, reference))  # of NumPy's, which no NaN passes


def relative(brf, truth):
    pairs = [(a.ravel(), b.ravel()) for a, b in zip(brf, truth, strict=True)]
    return np.concatenate([np.abs(a[: len(b)] / b[: len(a)] - 1) for a, b in pairs])


def table(head, rows):
    print(f"| {' | '.join(head)} |\n|{' --- |' * len(head)}")
    for row in rows:
        print(f"| {' | '.join(map(str, row))} |")
    print(flush=True)
