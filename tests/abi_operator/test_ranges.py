"""Ranges at their edges and in words; who checks what by them is in `scene/test_checks`."""

import numpy as np
import pytest

from abi_operator.files.plausible import PLAUSIBLE
from abi_operator.ranges import FINITE, SOLVER, STATE, WEATHER, Range
from abi_operator.solver import toa_brf

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


def test_the_deepest_layer_that_is_allowed_is_as_bright_as_a_deep_one():
    """Seen and lit at a cosine of 1e-3, where rounding counts most."""
    tau = np.array([1e8, 0.9 * SOLVER["tau"].high])[:, None] * np.array([0.0, 1.0]) + [0.1, 0.0]
    given = {"tau": tau, "ssa": np.full(2, 0.9), "moments": 0.5 ** np.arange(3) * np.ones((2, 1))}
    found = toa_brf(**given, albedo=0.3, mu0=1e-3, mu=1e-3, relative_azimuth=1.0, num_streams=2)
    np.testing.assert_allclose(found[1], found[0], rtol=1e-6)
