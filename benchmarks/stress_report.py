"""What `stress.py` prints of the columns that it asked."""

import numpy as np
from rounds import table
from stress_checks import CHECKS, LIMITS
from stress_columns import GROUPS, STRATA

PRECISIONS = ("float64", "float32")
# What the worst error of a check comes from, where nothing fails.
DEPTH = "rounding, times the depth of layers that absorb nothing"
LIMITED_BY = dict.fromkeys(CHECKS, "rounding") | {
    "finite value": "",
    "finite slopes": "",
    "energy": DEPTH,
    "reciprocity": DEPTH,
    "slope": "the quotient: rounding of values over its step",
    "partial": "the quotient, likewise",
    "inside jit": DEPTH + ", of light of one layer seen through them",
    "budget": "what each way of skipping is estimated to lose",
    "float32": "rounding, times optical depth over the cosine of the view",
    "float32 slope": "rounding, times optical depth over the cosine of the view",
    "float32 partial": "rounding, times optical depth over the cosine of the view",
}
SIGNS = ("not negative", "rising in albedo")


def failed(rows, name, precision):
    """What is above its limit, and what is not finite where there is none."""
    return (rows[name] > LIMITS[name][PRECISIONS.index(precision)]) | np.isinf(rows[name])


def by_stratum(rows, precision):
    names = [name for name in CHECKS if (~np.isnan(rows[name])).any()]
    print("Columns by stratum, and how many failed each check:\n")
    beyond = ["beyond single precision"] if precision == "float32" else []
    lines = []
    for k, stratum in [*enumerate(STRATA), (None, "all")]:
        own = rows if k is None else rows[rows["stratum"] == k]
        counts = [f"{failed(own, name, precision).sum()}" for name in names]
        more = [f"{own['beyond'].sum()}"] if beyond else []
        lines.append([stratum, f"{own.size}", *more, *counts])
    table(["stratum", "columns", *beyond, *names], lines)


def by_check(rows, where, precision):
    emits = np.array([group[3] for group in GROUPS])[where[:, 0]]
    for words, chosen in (("in sunlight alone", ~emits), ("that emit", emits)):
        if chosen.any():
            print(f"Errors by check, of columns {words}:\n")
            _errors(rows[chosen], where[chosen], precision)


def _errors(rows, where, precision):
    lines = []
    for name, meaning in CHECKS.items():
        asked = ~np.isnan(rows[name])
        if not asked.any():
            continue
        worst = int(np.nanargmax(rows[name]))
        p50, p99, p999 = np.percentile(rows[name][asked], (50, 99, 99.9))
        limit = LIMITS[name][PRECISIONS.index(precision)]
        errors = [f"{x:.1e}" for x in (p50, p99, p999, rows[name][worst])]
        passes = f"{limit:g}" if limit < np.inf else "any"
        which = described(rows, where, worst) if rows[name][worst] else ""
        counts = [passes, f"{failed(rows, name, precision).sum()}"]
        lines.append([name, f"{asked.sum()}", *errors, *counts, which, LIMITED_BY[name], meaning])
    head = ["check", "columns", "median", "p99", "p99.9", "worst", "passes to", "failed"]
    table([*head, "the worst", "what limits it", "error of"], lines)


def described(rows, where, i):
    number, index, row = where[i]
    streams, layers, _, emitting, *_ = GROUPS[number]
    kind = " emitting" if emitting else ""
    stratum = list(STRATA)[rows["stratum"][i]]
    return f"{stratum}, {streams} streams, {layers}{kind} layers, batch {index} row {row}"


def worst(rows, precision, count):
    """Columns whose errors are largest beside what each check lets pass, most of them cheap."""
    ratio = np.zeros(rows.size)
    for name, limits in LIMITS.items():
        limit = limits[PRECISIONS.index(precision)]
        if 0 < limit < np.inf and name not in (
            "budget",
            "slope",
            "partial",
            "float32 slope",
            "float32 partial",
        ):
            ratio = np.maximum(ratio, np.nan_to_num(rows[name]) / limit)
    return np.argsort(-ratio, kind="stable")[:count]
