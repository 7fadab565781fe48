"""What fails a check of `stress.py`, asked once more: is it the solver that is wrong?

Each function takes failures back from `rows`, the errors of columns by check, that are of the
equations themselves, of another check, or of the quotient that a slope is compared with, and prints
how many. `where` is the group, the batch and the row in it of every column.
"""

import numpy as np
import stress_truth
from stress_checks import AGREE, FLOOR, LIMITS, Judged, both, scale_of, value
from stress_columns import GROUPS, columns_of
from stress_directions import along, moved
from stress_report import PRECISIONS, SIGNS, failed

MOST_STREAMS = 8  # for 40 digits
LONGER_STEP = 1e-3  # than that of `stress_checks`, whose quotients lose digits under deep layers


def without_the_equations_own(rows, where, precision):
    """Take back wrong signs that 40 digits have as much; streams may agree by chance."""
    wrong = failed(rows, SIGNS[0], precision) | failed(rows, SIGNS[1], precision)
    taken = 0
    for i in np.flatnonzero(wrong):
        group = GROUPS[where[i, 0]]
        if group[0] <= MOST_STREAMS and not group[3]:
            batch = columns_of(group, where[i, 1], precision)
            own = stress_truth.falls(batch.columns, where[i, 2], group[0])
            size = max(abs(rows["value"][i]), FLOOR)
            for name in SIGNS:
                limit = LIMITS[name][PRECISIONS.index(precision)]
                if limit < rows[name][i] <= limit + (1 + AGREE) * own / size:
                    rows[name][i], taken = np.nan, taken + 1
    print(f"Signs that the equations have by themselves, by 40 digits: {taken}\n")


def without_albedos_of_the_equations(rows, where, precision):
    """Take back plane albedos outside [0, 1] that 40 digits have as much."""
    taken, limit = 0, LIMITS["absorption"][PRECISIONS.index(precision)]
    for i in np.flatnonzero(failed(rows, "absorption", precision)):
        number, index, row = where[i]
        streams = GROUPS[number][0]
        if streams <= MOST_STREAMS:
            columns = columns_of(GROUPS[number], index, precision).columns
            own = stress_truth.outside(columns, row, streams)
            if rows["absorption"][i] <= limit + (1 + AGREE) * own:
                rows["absorption"][i], taken = np.nan, taken + 1
    print(f"Plane albedos that the equations have outside [0, 1], by 40 digits: {taken}\n")


def without_what_is_conserved(rows, where, precision):
    """Leave columns that absorb nothing, and fail "absorption", to "energy", which asks the very
    same number of them."""
    taken = 0
    for i in np.flatnonzero(failed(rows, "absorption", precision)):
        number, index, row = where[i]
        columns = columns_of(GROUPS[number], index, precision).columns
        absorbed = columns["tau"][row] * (1 - columns["ssa"][row])
        if not absorbed.any() and columns["albedo"][row] == 1:
            rows["absorption"][i], taken = np.nan, taken + 1
    print(f"Columns that absorb nothing, judged by energy alone: {taken}\n")


def without_the_quotients_own(rows, where, precision):
    """Compare slopes that fail over a longer step as well: what rounding leaves of a quotient is
    the less, the longer its step. Of single precision no quotient is formed."""
    for name in ("slope", "partial"):
        again = np.flatnonzero(failed(rows, name, precision))
        for i in again:
            number, index, row = where[i]
            found = over_a_longer_step(GROUPS[number], index, row, precision)[name]
            rows[name][i] = min(rows[name][i], found)
        print(f"Slopes compared over a longer step as well ({name}): {again.size}", end="")
        print(f", then off by {rows[name][again].max():.1e} at most\n" if again.size else "\n")


def over_a_longer_step(group, index, row, precision):
    """The checks "slope" and "partial" of one column of a batch."""
    batch, streams = columns_of(group, index, precision), group[0]
    asked = Judged(batch.columns, batch.further, streams, [streams, index])
    columns, directions, one = (
        {name: x[row : row + 1] for name, x in given.items()}
        for given in (batch.columns, asked.directions, asked.one)
    )

    def at(way, steps):
        return value(moved(columns, way, steps * LONGER_STEP), num_streams=streams)

    (_, light), slopes = both(columns, streams)
    light = np.asarray(light, np.float64)
    floor = asked.floor[row]
    quotients = {
        "slope": (directions, at(directions, 1) - at(directions, -1)),
        "partial": (one, 4 * at(one, 1) - at(one, 2) - 3 * light),
    }
    found = {}
    for name, (way, difference) in quotients.items():
        slope, sizes = along(slopes, way)
        apart = abs(difference / (2 * LONGER_STEP) - slope)
        of = np.maximum(sizes, floor) if name == "slope" else scale_of(sizes, light, floor)
        found[name] = float((apart / of)[0])
    return found
