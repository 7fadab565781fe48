"""Tables of `pareto`: every solver's time beside its error, and who is how much faster."""

import math
import statistics
from dataclasses import dataclass, field

import numpy as np
import pareto_ours as ours
from rounds import Bars, digits, table

# Times the fastest other solver, in comparison (b), at every error.
LEAST = {
    ("W1", "forward"): 60,
    ("W2", "forward"): 60,
    ("W3", "forward"): 200,
    ("W1", "gradient"): 100,
    ("W2", "gradient"): 200,
}
TRUE = 1e-4  # most by which nanodisort may differ from the truth
ENOUGH_COLUMNS, ENOUGH_ROUNDS = 10_000, 5


@dataclass(frozen=True)
class Line:
    """One solver in one setting: the comparisons it takes part in, times and errors."""

    workload: str
    kind: str
    budget: float
    rows: str
    solver: str
    setting: str
    count: int
    times: list[float]  # of the rounds [us a column]
    errors: np.ndarray

    @property
    def microseconds(self):
        return statistics.median(self.times)

    @property
    def p99(self):
        return np.percentile(self.errors, 99)


@dataclass
class Report:
    """What was measured, and what was judged."""

    options: object
    bars: Bars = field(default_factory=Bars)
    lines: list[Line] = field(default_factory=list)
    points: list[tuple] = field(default_factory=list)  # workload, peer, careful, trial

    def about(self, workload, num_layers, num_moments, judged):
        streams = ours.STREAMS[workload]
        fixed = "; ".join(
            f"{budget:g}: {n} streams, {spent:g} to be skipped by"
            for budget, (n, spent) in streams.items()
        )
        print(f"## {workload}\n\n{num_layers} layers, {num_moments} moments for the correction of")
        print(f"others, errors over {judged} columns. Ours, fixed beforehand: {fixed}.")
        for door, can in zip(("toa_brf", "toa_radiance"), ours.CAN_SKIP, strict=True):
            if not can:
                print(
                    f"`{door}` has no `error_budget` here: it skips nothing in (b) and (c) either."
                )
        print(flush=True)

    def check_truth(self, workload, count, apart):
        print(f"The truth differs from nanodisort by {apart:.0e} at most, on {count} columns.\n")
        self.bars.judge(apart <= TRUE, f"{workload}: the truth is {apart:.0e} from nanodisort")

    def twice(self, count, apart):
        """Twice the streams of the truth, of columns with a peak."""
        print(
            f"128 streams differ from it by {np.median(apart):.0e} in the median, by "
            f"{np.percentile(apart, 90):.0e} at the 90th percentile and by {apart.max():.0e} at "
            f"most, on {count} columns with peaked phase functions.\n",
            flush=True,
        )

    def trials(self, workload, trials_of):
        for (peer, careful), trials in trials_of.items():
            self.points += [(workload, peer, careful, trial) for trial in trials]

    def table(self, workload):
        rows = []
        own = [x for x in self.lines if x.workload == workload]
        for x in sorted(own, key=lambda x: (x.kind, -x.budget, x.solver != "ours", x.rows)):
            low, high = (digits(f(x.times)) for f in (min, max))
            row = [x.kind, f"{x.budget:g}", ", ".join(x.rows), x.solver, x.setting, x.count]
            row += [digits(x.microseconds), f"{low}-{high}"]
            row += [f"{np.median(x.errors):.1e}", f"{x.p99:.1e}", f"{x.errors.max():.1e}"]
            rows.append(row)
            if x.solver == "ours":
                text = f"{workload} {x.kind} ({x.rows[0]}): error {x.p99:.1e}, not {x.budget:g}"
                self.bars.judge(x.p99 <= x.budget, text)
        head = ["what", "error", "in", "solver", "setting", "columns", "microseconds a column"]
        table([*head, "range", "p50", "p99", "largest"], rows)

    def factor(self, workload, kind, budget, row):
        """How many times the fastest other solver, which that is, or None where none meets it."""
        own = [
            x
            for x in self.lines
            if (x.workload, x.kind, x.budget) == (workload, kind, budget) and row in x.rows
        ]
        mine = next(x for x in own if x.solver == "ours")
        others = [x for x in own if x.solver != "ours"]
        if not others:
            return math.nan, "none meets it"
        fastest = min(others, key=lambda x: x.microseconds)
        return fastest.microseconds / mine.microseconds, fastest.solver

    def summary(self):
        """Factors, and whether bars are held."""
        options = self.options
        rows, judged = [], {}
        for case in dict.fromkeys((x.workload, x.kind, x.budget) for x in self.lines):
            workload, kind, budget = case
            factors = [self.factor(*case, letter) for letter in "abc"]
            judged[case], least = factors[1][0], LEAST.get((workload, kind))
            held = ""
            if least is not None:
                held = "held" if judged[case] >= least else "MISSED"
                text = f"{workload} {kind} at {budget:g}: {judged[case]:.1f} x, not {least}"
                self.bars.judge(judged[case] >= least, text)
            row = [workload, kind, f"{budget:g}", *(f"{x:.1f} ({who})" for x, who in factors)]
            rows.append([*row, least or "", held])
        print("## Times the fastest other solver\n")
        head = ["workload", "what", "error", "(a) nobody skips", "(b) ours skips", "(c) all skip"]
        table([*head, "bar of (b)", ""], rows)
        known = {k: x for k, x in judged.items() if not math.isnan(x)}
        if known:
            worst = min(known, key=known.get)
            mean = math.exp(statistics.fmean(math.log(x) for x in known.values()))
            print(f"Geometric mean of (b) {mean:.1f}; worst {known[worst]:.1f}, of", *worst, "\n")
        enough = options.columns >= ENOUGH_COLUMNS and options.repeats >= ENOUGH_ROUNDS
        text = f"fewer than {ENOUGH_COLUMNS} columns or {ENOUGH_ROUNDS} rounds"
        self.bars.judge(enough, text)
        self.bars.report()
