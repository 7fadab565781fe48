"""Modes of values, and slopes, in single precision, where an error budget has room for it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.solver import toa_brf, toa_radiance
from abi_operator.solver.method.rounding import in_single_precision
from abi_operator.solver.skipping import budget

STREAMS = 6  # the fewest of which modes are kernels of their own
ORDER = np.arange(STREAMS + 1)
BUDGET = 1e-3
# That all else is as good as the same, and the program another one.
NEXT = BUDGET * (1 + 1e-6)


def columns(count=64, seed=8):
    """Clouds without absorption, from thin ones to some that nothing gets through."""
    rng = np.random.default_rng(seed)
    g = rng.uniform(0.75, 0.88, (count, 3, 1))
    return {
        "tau": 10 ** rng.uniform(-2, 2.5, (count, 3)),
        "ssa": np.where(rng.random((count, 3)) < 0.5, 1.0, 0.99),
        "moments": g**ORDER,
        "phase_function": np.ones((count, 3)),
        "albedo": rng.uniform(0, 0.5, count),
        "mu0": rng.uniform(0.2, 1.0, count),
        "mu": rng.uniform(0.2, 1.0, count),
        "relative_azimuth": rng.uniform(0, np.pi, count),
    }


def warm(given):
    """The same, and as warm as the sun is bright."""
    count, layers = given["tau"].shape
    levels = np.linspace(0.1, 0.3, layers + 1) * np.ones((count, 1))
    more = {"planck_levels": levels, "surface_emission": levels[:, -1]}
    return given | more | {"solar_irradiance": np.ones(count)}


@pytest.mark.parametrize("door, given", [(toa_brf, columns()), (toa_radiance, warm(columns()))])
def test_values_are_rounded_and_next_to_nothing_is_lost(door, given, monkeypatch):
    rounded = np.asarray(door(**given, num_streams=STREAMS, error_budget=BUDGET))
    monkeypatch.setattr(budget, "SINGLE_FROM", np.inf)
    double = np.asarray(door(**given, num_streams=STREAMS, error_budget=NEXT))
    error = np.abs(rounded / double - 1)
    assert rounded.dtype == double.dtype == np.float64
    assert 1e-9 < np.median(error) < 3e-6  # eps of float32 is 1.2e-7
    assert error.max() < 1e-4


def test_slopes_are_rounded_and_next_to_nothing_is_lost(monkeypatch):
    """Of the norm of all slopes of a column."""
    names = "tau", "ssa", "moments", "albedo", "mu0", "mu"

    def slopes(error_budget):
        def total(some):
            how = {"num_streams": STREAMS, "error_budget": error_budget}
            return toa_brf(**columns() | some, **how).sum()

        return jax.grad(total)({name: columns()[name] for name in names})

    rounded = slopes(BUDGET)
    monkeypatch.setattr(budget, "SINGLE_FROM", np.inf)
    found = [
        np.concatenate([np.reshape(s[name], (64, -1)) for name in names], axis=1)
        for s in (rounded, slopes(NEXT))
    ]
    assert all(x.dtype == np.float64 for x in found)
    error = np.linalg.norm(found[0] - found[1], axis=1) / np.linalg.norm(found[1], axis=1)
    assert 1e-9 < np.median(error) < 2e-6
    assert error.max() < 1e-4, error.max()


@pytest.mark.parametrize("ssa", [0.9, 1.0])
@pytest.mark.parametrize("depth", [1e3, 1e5, 1e6])
def test_layers_deeper_than_anything_that_is_seen(depth, ssa):
    deep = columns() | {"tau": np.full((64, 3), depth), "ssa": np.full((64, 3), ssa)}
    rounded, double = (
        np.asarray(toa_brf(**deep, num_streams=STREAMS, **how))
        for how in ({"error_budget": BUDGET}, {})
    )
    np.testing.assert_allclose(rounded, double, rtol=BUDGET / 4)  # 6e-4 and more if they were


@pytest.mark.slow
def test_peaks_that_are_cut_off_stay_in_double_precision():
    """Without delta-M no matrix is sure to be positive in single precision."""
    rough = columns() | {
        "tau": np.full((64, 3), 10.0),
        "moments": np.full((64, 3, 1), 0.9) ** ORDER,
    }
    brf, whole = (
        np.asarray(toa_brf(**rough, num_streams=STREAMS, delta_m=False, error_budget=x))
        for x in (BUDGET, None)
    )
    np.testing.assert_allclose(brf, whole, rtol=1e-6)  # 6e-5 and more if they were not


def test_only_what_is_double_changes():
    given = jnp.asarray([0.1, np.nan]), jnp.arange(2), jnp.float32(3)
    double, integers, single = in_single_precision(given)
    assert [x.dtype for x in (double, integers, single)] == [np.float32, np.int64, np.float32]
    np.testing.assert_array_equal(double, np.asarray([0.1, np.nan], np.float32))
