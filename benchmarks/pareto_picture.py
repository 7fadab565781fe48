"""The picture of `pareto`: error across, microseconds a column up, a panel for each workload.

    python benchmarks/pareto_picture.py [benchmarks/results/pareto.md] [--out pareto.png]

draws what stands in the tables of a page, of which every heading names its workload; `pareto.py
--picture` draws its own run, with the settings that were tried for others. Needs matplotlib, which
the extra `plot` brings.
"""

import argparse
import re
from pathlib import Path
from types import SimpleNamespace

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.lines import Line2D
from pareto_report import Line

PAGE = Path(__file__).parent / "results" / "pareto.md"
COLOURS = {
    "ours": "#c1272d",
    "nanodisort": "#1f5fa8",
    "disortpp": "#2a9d6f",
    "sasktran2": "#8a6fb8",
    "nanodisort, differences": "#1f5fa8",
    "disortpp, differences": "#2a9d6f",
    "sasktran2 + derivatives": "#8a6fb8",
}
SMALLEST = 1e-6  # errors below are drawn here
TITLES = {
    "W1": "smoke and ash",
    "W2": "clouds",
    "W3": "clear and fire pixels",
    "W4": "a retrieval's steps",
}


def draw(report, path):
    """Write the picture of all that a report has."""
    cases = list(dict.fromkeys((x.kind, x.workload) for x in report.lines))
    cases.sort()
    across = max(sum(kind == other for other, _ in cases) for kind, _ in cases)
    kinds = list(dict.fromkeys(kind for kind, _ in cases))
    size = 4.6 * across + 3.4, 4.1 * len(kinds) + 0.3
    figure, axes = plt.subplots(len(kinds), across, figsize=size, squeeze=False)
    for row, kind in zip(axes, kinds, strict=True):
        own = [workload for other, workload in cases if other == kind]
        for k, axis in enumerate(row):
            if k < len(own):
                _panel(axis, report, kind, own[k])
            else:
                axis.set_visible(False)
        row[0].set_ylabel("time [µs a column]")
    for axis in (x for x in axes.flat if x.get_visible()):
        axis.set_xlabel("error of BRF at the 99th percentile [-]")
    solvers = [x for x in COLOURS if any(line.solver == x for line in report.lines)]
    figure.legend(
        handles=_legend(solvers, bool(report.points)),
        loc="center right",
        frameon=False,
        fontsize=10,
    )
    figure.tight_layout(rect=(0, 0, 1 - 3.1 / size[0], 1))
    figure.savefig(path, dpi=130)
    plt.close(figure)


def lines_of(page):
    """Lines of the tables of a page, with one time and one error each: the median, and p99."""
    found, workload = [], ""
    for text in page.splitlines():
        heading = re.match(r"#+ .*\b(W\d)\b", text)
        workload = heading[1] if heading else workload
        cells = [x.strip() for x in text.strip("|").split(" | ")]
        if cells[0] not in ("forward", "gradient") or len(cells) != 11:
            continue
        kind, budget, rows, solver, setting, count, micro, _, _, p99, _ = cells
        times, errors = [float(micro.replace(",", ""))], np.asarray([float(p99)])
        rows = rows.replace(", ", "")
        found.append(
            Line(workload, kind, float(budget), rows, solver, setting, int(count), times, errors)
        )
    return found


def _panel(axis, report, kind, workload):
    """What was tried in small, what was timed in rounds in large; lines at the errors to meet."""
    if kind == "forward":
        for other, peer, careful, trial in report.points:
            if other == workload:
                x = max(trial.p99, SMALLEST)
                marker = "v" if careful else "o"
                axis.plot(x, trial.microseconds, marker, ms=3.5, alpha=0.35, c=COLOURS[peer], mew=0)
    for line in report.lines:
        if (line.kind, line.workload) == (kind, workload):
            x, mine = max(line.p99, SMALLEST), line.solver == "ours"
            marker = _marker(line)
            size = 15 if marker == "*" else 8
            style = _style(line.solver)
            axis.plot(x, line.microseconds, marker, ms=size, zorder=3 + mine, **style)
    for budget in report.options.budgets:
        axis.axvline(budget, c="0.55", lw=0.9, ls="--", zorder=0)
    axis.set(xscale="log", yscale="log")
    axis.set_title(f"{workload}: {TITLES[workload]}, {kind}", fontsize=11)
    axis.grid(which="major", c="0.92")
    low, high = axis.get_ylim()
    axis.set_ylim(10 ** np.floor(np.log10(low)), 10 ** np.ceil(np.log10(high)))


def _marker(line):
    """By what is skipped; what a peer does in (a) and (b) is the same."""
    if line.solver == "ours":
        return "s" if line.rows == "a" else "*"
    return "o" if "a" in line.rows else "v"


def _style(solver):
    hollow = solver == "nanodisort, differences"
    colour = COLOURS[solver]
    edge = {"mec": colour if hollow else "white", "mew": 1.5 if hollow else 0.7}
    return {"c": colour, "fillstyle": "none" if hollow else "full", **edge}


def _legend(solvers, tried):
    kinds = {"s": "ours, nothing skipped", "*": "ours, skipping", "o": "others, nothing skipped"}
    kinds["v"] = "others, merged layers and early stop"
    shown = [Line2D([], [], ls="", marker="o", ms=8, label=x, **_style(x)) for x in solvers]
    shown += [Line2D([], [], ls="", marker=m, ms=8, c="0.35", label=x) for m, x in kinds.items()]
    small = {"marker": "o", "ms": 3.5, "c": "0.35", "alpha": 0.5, "label": "settings tried"}
    shown += [Line2D([], [], ls="", **small)] if tried else []
    return [*shown, Line2D([], [], c="0.55", ls="--", label="error to be met")]


def main():
    parser = argparse.ArgumentParser(description="The picture of a page of `pareto`.")
    parser.add_argument("page", nargs="?", type=Path, default=PAGE)
    parser.add_argument("--out", default="pareto.png")
    options = parser.parse_args()
    lines = lines_of(options.page.read_text())
    budgets = SimpleNamespace(budgets=sorted({x.budget for x in lines}))
    draw(SimpleNamespace(lines=lines, points=[], options=budgets), options.out)
    print(f"{options.out}: {len(lines)} lines")


if __name__ == "__main__":
    main()
