"""Ranges at their edges and in words; who checks what by them is in `scene/test_checks`."""

import numpy as np
import pytest

from abi_operator.files.plausible import PLAUSIBLE
from abi_operator.ranges import FINITE, SOLVER, STATE, WEATHER, Range

TABLES = {"solver": SOLVER, "state": STATE, "weather": WEATHER}
EVERY = [(table, name) for table, ranges in TABLES.items() for name in ranges]


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize(("table", "name"), EVERY)
def test_edges(table, name, dtype):
    """An end belongs to its range or does not, and the next number beyond never does."""
    allowed = TABLES[table][name]
    away = np.asarray([-np.inf, np.inf], dtype)
    for end, closed, beyond in zip(allowed[:2], ("[", "]"), away, strict=True):
        end = np.asarray(end, dtype)
        if np.isinf(end):
            assert not allowed.holds(end)
            assert allowed.holds(np.nextafter(end, -end))
            continue
        assert allowed.holds(end) == (closed in allowed.ends)
        assert not allowed.holds(np.nextafter(end, beyond))
        assert allowed.holds(np.nextafter(end, -beyond))
    assert not allowed.holds(np.asarray(np.nan, dtype))


def test_words():
    words = {
        Range(0.0, 1.0): ("0 to 1", "[0, 1]"),
        Range(0.0, np.inf, "[)", "m"): ("0 m or more", "[0, inf) m"),
        Range(0.0, np.inf, "()", "K"): ("above 0 K", "(0, inf) K"),
        Range(-1.0, 1.0, "()"): ("above -1 and below 1", "(-1, 1)"),
        Range(0.0, 1.0, "(]"): ("above 0 and at most 1", "(0, 1]"),
        Range(0.0, 1.0, "[)"): ("0 or more and below 1", "[0, 1)"),
        FINITE: ("finite", "(-inf, inf)"),
    }
    for allowed, expected in words.items():
        assert (allowed.words, allowed.interval) == expected
    assert STATE["solar_zenith"].words == "0 to pi (angles are in rad)"


def test_quantities_of_one_name_have_one_range():
    for name in SOLVER.keys() & STATE.keys():
        assert SOLVER[name] == STATE[name]
    for name in WEATHER.keys() & STATE.keys():
        assert STATE[name].low <= WEATHER[name].low < WEATHER[name].high <= STATE[name].high
    for name in WEATHER.keys() & PLAUSIBLE.keys():
        assert WEATHER[name][:2] == PLAUSIBLE[name][:2]
