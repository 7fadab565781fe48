"""Columns that scatter hardly anything: their light without a solution, and when it will do."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.solver import toa_brf, toa_radiance
from abi_operator.solver.gradient import emission, mode_sum
from abi_operator.solver.skipping import budget

STREAMS, LAYERS = 4, 6
HOW = {"num_streams": STREAMS}
BUDGET = 1e-3
# A layer has the doublings of that column of its tile that needs most (`skipping.budget`).
ALONE = 2e-6


@cache
def columns(count=130, scattered=1e-3, seed=5):
    """Air that scatters so much and absorbs up to half, over ground of any albedo."""
    rng = np.random.default_rng(seed)
    share = np.diff(np.linspace(0, 1, LAYERS + 1) ** 2)
    scattering = scattered * share * rng.uniform(0.3, 1, (count, 1))
    tau = scattering + share**2 * 10 ** rng.uniform(-3, 0, (count, 1))
    moments = np.where(np.arange(STREAMS + 1) == 2, 0.1, np.arange(STREAMS + 1) == 0)
    return {
        "tau": tau,
        "ssa": scattering / tau,
        "moments": np.broadcast_to(moments, (count, LAYERS, STREAMS + 1)).copy(),
        "albedo": rng.uniform(0, 1, count),
        "mu0": rng.uniform(0.3, 1, count),
        "mu": rng.uniform(0.3, 1, count),
        "relative_azimuth": rng.uniform(0, np.pi, count),
    }


def heat(count=130, seed=6):
    """Thermal light in units of the sun's, of a ground that may burn."""
    rng = np.random.default_rng(seed)
    return {
        "solar_irradiance": np.ones(count),
        "planck_levels": rng.uniform(0.01, 0.1, (count, LAYERS + 1)),
        "surface_emission": 10 ** rng.uniform(-2, 1, count),
    }


def test_nothing_is_solved(monkeypatch):
    """Of columns that are all faint; whatever is solved is no number here."""

    def nothing(inputs, plan, how):
        return jnp.full_like(inputs.weights[0], jnp.nan)

    monkeypatch.setattr(mode_sum, "_reflectance", nothing)
    # A budget of its own: programs are kept, and this one is wrong elsewhere.
    how = HOW | {"error_budget": BUDGET * (1 + 1e-9)}
    assert np.isfinite(toa_brf(**columns(scattered=1e-4), **how)).all()
    assert np.isnan(toa_brf(**columns(scattered=0.1), **how)).any()


def test_the_budget_is_kept():
    """Of the columns some are faint, of which no more is missing than half of what may be."""
    given = columns(scattered=1e-3)
    whole, found = (np.asarray(toa_brf(**given, **HOW, error_budget=b)) for b in (None, BUDGET))
    wrong = np.abs(found - whole) / np.maximum(whole, 0.01)
    assert 1e-5 < np.quantile(wrong, 0.99) < 0.5 * BUDGET


def test_light_of_faint_columns():
    """To first order in the scattering: a third as much of it is off by no more than a third."""
    off = []
    for scattered in (9e-4, 3e-4):
        given = columns(scattered=scattered)
        whole, found = (np.asarray(toa_brf(**given, **HOW, error_budget=b)) for b in (None, 1e-2))
        off.append(np.max(np.abs(found - whole) / np.maximum(whole, 0.01)))
    assert off[0] < 3e-4 and off[1] < 0.4 * off[0]


def test_a_column_is_faint_whoever_it_is_solved_with():
    """Among thick ones its light is that which it has among its like, bit by bit."""
    faint, thick = columns(scattered=1e-4), columns(scattered=1.0)
    alone = np.asarray(toa_brf(**faint, **HOW, error_budget=BUDGET))
    mixed = {
        k: np.stack([faint[k], thick[k]], axis=1).reshape(-1, *x.shape[1:])
        for k, x in faint.items()
    }
    found = np.asarray(toa_brf(**mixed, **HOW, error_budget=BUDGET)).reshape(-1, 2)
    np.testing.assert_allclose(found[:, 0], alone, rtol=1e-14)
    others = np.asarray(toa_brf(**thick, **HOW, error_budget=BUDGET))
    np.testing.assert_allclose(found[:, 1], others, rtol=ALONE)


@pytest.mark.parametrize("of", ["the sun on a sphere", "several views", "no delta-M"])
def test_what_a_column_may_be(of):
    """Of whatever kind columns are, those that are not solved are within half of the budget."""
    given, how = columns(scattered=5e-4), dict(HOW)
    rng = np.random.default_rng(7)
    count = given["mu0"].size
    if of == "the sun on a sphere":
        given = given | {"secant": rng.uniform(0.9, 1.3, (count, LAYERS)) / given["mu0"][:, None]}
        given = given | {"phase_function": rng.uniform(0.5, 2, (count, LAYERS))}
    elif of == "several views":
        how["multiple_views"] = True
        views = {"mu": (0.3, 1), "relative_azimuth": (0, np.pi)}
        given = given | {k: rng.uniform(*ends, (count, 3)) for k, ends in views.items()}
    else:
        how["delta_m"] = False
    whole, found = (np.asarray(toa_brf(**given, **how, error_budget=b)) for b in (None, BUDGET))
    assert np.mean(found != whole) > 0.5
    wrong = np.abs(found - whole) / np.maximum(whole, 0.01)
    assert np.quantile(wrong, 0.99) < 0.5 * BUDGET


def test_light_is_rounded_where_the_budget_has_room(monkeypatch):
    """Of columns that are not solved it is that of single precision, within its rounding."""
    given = columns(scattered=1e-5) | heat()

    def light(error_budget):
        return np.asarray(toa_radiance(**given, **HOW, error_budget=error_budget))

    without_room = 0.5 * budget.SINGLE_FROM
    rounded, small = light(BUDGET), light(without_room)
    monkeypatch.setattr(budget, "SINGLE_FROM", np.inf)
    # Budgets of their own, as above.
    exact = light(BUDGET * (1 + 5e-9))
    off = np.abs(rounded / exact - 1)
    assert 1e-9 < np.median(off) and off.max() < 1e-6
    np.testing.assert_allclose(small, light(without_room * (1 + 5e-9)), rtol=1e-14)


def test_thermal_light_of_faint_columns():
    """With fires below and sunlight: what is missing is within a fourth of the budget."""
    given = columns(scattered=3e-4) | heat()
    whole, found = (np.asarray(toa_radiance(**given, **HOW, error_budget=b)) for b in (None, 1e-3))
    assert np.any(found != whole)
    assert np.max(np.abs(found - whole) / whole) < 2.5e-4


def test_slopes_are_those_of_a_solution(monkeypatch):
    """As if no column were faint."""
    given = columns(scattered=1e-4)

    def slope(error_budget):
        def total(albedo):
            return jnp.sum(toa_brf(**given | {"albedo": albedo}, **HOW, error_budget=error_budget))

        return np.asarray(jax.grad(total)(given["albedo"]))

    found = slope(BUDGET)
    monkeypatch.setattr(budget, "OF_FAINT", -1.0)
    np.testing.assert_allclose(found, slope(BUDGET * (1 + 3e-9)), rtol=1e-9)


def test_light_from_above_is_solved():
    """Air reflects it as well, which nobody has counted."""
    from_above = columns(scattered=3e-4) | heat() | {"isotropic_top": np.ones(130)}
    whole, found = (
        np.asarray(toa_radiance(**from_above, **HOW, error_budget=b)) for b in (None, BUDGET)
    )
    np.testing.assert_allclose(found, whole, rtol=1e-4)


def test_no_share_of_the_budget_is_no_faint_column(monkeypatch):
    given = columns(scattered=3e-4)
    whole = np.asarray(toa_brf(**given, **HOW))
    monkeypatch.setattr(budget, "OF_FAINT", -1.0)
    # Another budget, of which no program is kept.
    found = np.asarray(toa_brf(**given, **HOW, error_budget=BUDGET * (1 + 2e-9)))
    np.testing.assert_allclose(found, whole, rtol=2e-5)


def test_low_sun_through_air_that_absorbs():
    """Its beam meets more than what is scattered out of it, which reaches the ground instead."""
    low = columns(scattered=3e-5)
    low = low | {"mu0": 10 ** np.linspace(-3, -1, len(low["mu0"]))}
    whole, found = (np.asarray(toa_brf(**low, **HOW, error_budget=b)) for b in (None, BUDGET))
    assert np.mean(found != whole) > 0.5
    assert np.max(np.abs(found - whole) / np.maximum(whole, 0.01)) < BUDGET


def test_heat_under_opaque_air(monkeypatch):
    """A fire that nobody sees through the air needs no solution."""
    given = columns(scattered=3e-5) | heat()
    scattering, absorbing = given["tau"] * given["ssa"], np.linspace(0.5, 3, LAYERS)
    tau = given["tau"] + absorbing
    given = given | {"tau": tau, "ssa": scattering / tau, "surface_emission": np.full(130, 30.0)}
    whole = np.asarray(toa_radiance(**given, **HOW))
    monkeypatch.setattr(emission, "_radiance", lambda lit, plan, how: jnp.nan * lit.weights[0])
    # A budget of its own, as above.
    found = np.asarray(toa_radiance(**given, **HOW, error_budget=BUDGET * (1 + 4e-9)))
    assert np.max(np.abs(found - whole) / whole) < 1e-4
