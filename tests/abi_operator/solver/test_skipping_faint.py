"""Columns that scatter hardly anything: their light without a solution, and when it will do."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.solver import toa_brf, toa_radiance
from abi_operator.solver.glimpse import Glimpse
from abi_operator.solver.gradient import emission, mode_sum
from abi_operator.solver.skipping import budget

# As in the other tests of a budget, in shape too: most of their programs are these.
STREAMS, LAYERS = 4, 12
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
    degrees = np.arange(4 * STREAMS + 1)
    moments = np.where(degrees == 2, 0.1, degrees == 0)
    return {
        "tau": tau,
        "ssa": scattering / tau,
        "moments": np.broadcast_to(moments, (count, LAYERS, degrees.size)).copy(),
        "albedo": rng.uniform(0, 1, count),
        "mu0": rng.uniform(0.3, 1, count),
        "mu": rng.uniform(0.3, 1, count),
        "relative_azimuth": rng.uniform(0, np.pi, count),
    }


def warm(given, seed=6):
    """The same with thermal light in units of the sun's, of a ground that may burn."""
    rng, count = np.random.default_rng(seed), given["mu0"].size
    mu0, mu, azimuth = (given[name] for name in ("mu0", "mu", "relative_azimuth"))
    angle = -mu * mu0 - np.sqrt((1 - mu**2) * (1 - mu0**2)) * np.cos(azimuth)
    return given | {
        "moments": given["moments"][..., : STREAMS + 1],
        "phase_function": np.repeat(0.75 * (1 + angle[:, None] ** 2), LAYERS, axis=1),
        "solar_irradiance": np.ones(count),
        "planck_levels": rng.uniform(0.01, 0.1, (count, LAYERS + 1)),
        "surface_emission": 10 ** rng.uniform(-2, 1, count),
    }


def brf(given, error_budget, **how):
    return np.asarray(toa_brf(**given, **HOW, error_budget=error_budget, **how))


def light(given, error_budget):
    return np.asarray(toa_radiance(**given, **HOW, error_budget=error_budget))


def test_nothing_is_solved(monkeypatch):
    """Of columns that are all faint; whatever is solved is no number here."""

    def nothing(inputs, plan, how):
        return jnp.full_like(inputs.weights[0], jnp.nan)

    monkeypatch.setattr(mode_sum, "_reflectance", nothing)
    # A budget of its own: programs are kept, and this one is wrong elsewhere.
    own = BUDGET * (1 + 1e-9)
    assert np.isfinite(brf(columns(scattered=1e-4), own)).all()
    assert np.isnan(brf(columns(scattered=0.1), own)).any()


def test_thin_air_over_what_is_opaque():
    """The square of a depth that is no number in single precision is of no light: what is left is
    scattered once, and hardly any twice."""
    tau = np.asarray([[1e-4, 1e14], [1e-4, 1e10], [1e-4, 1e3]])
    given = {"tau": tau, "ssa": np.asarray([1.0, 0.0]), "moments": np.eye(1, 3) * np.ones((2, 1))}
    given = given | {"albedo": 0.3, "mu0": 0.5, "mu": 0.5, "relative_azimuth": 1.0}
    found = toa_brf(**given, num_streams=2, error_budget=BUDGET)
    np.testing.assert_allclose(found, -np.expm1(-4e-4) / 4, rtol=BUDGET)


def test_light_that_is_no_number_is_not_enough():
    nothing = jnp.zeros(2)
    light = jnp.asarray([[1.0, 1.0], [jnp.nan, 1.0]])
    glimpse = Glimpse(light, nothing, nothing + 1)
    np.testing.assert_array_equal(glimpse.enough(BUDGET), [False, True])


def test_the_budget_is_kept():
    """Of the columns some are faint, of which no more is missing than half of what may be."""
    given = columns(scattered=1e-2)
    whole, found = (brf(given, x) for x in (None, BUDGET))
    wrong = np.abs(found - whole) / np.maximum(whole, 0.01)
    assert 1e-5 < np.quantile(wrong, 0.99) < 0.5 * BUDGET


def test_light_of_faint_columns():
    """To first order in the scattering: a third as much of it is off by no more than a third."""
    off = []
    for scattered in (9e-4, 3e-4):
        given = columns(scattered=scattered)
        whole, found = (brf(given, x) for x in (None, BUDGET))
        off.append(np.max(np.abs(found - whole) / np.maximum(whole, 0.01)))
    assert off[0] < 3e-4 and off[1] < 0.4 * off[0]


def test_a_column_is_faint_whoever_it_is_solved_with():
    """Among thick ones its light is that which it has among its like, bit by bit."""
    faint, thick = columns(scattered=1e-4), columns(scattered=1.0)
    alone = brf(faint, BUDGET)
    mixed = {
        k: np.stack([faint[k], thick[k]], axis=1).reshape(-1, *x.shape[1:])
        for k, x in faint.items()
    }
    found = brf(mixed, BUDGET).reshape(-1, 2)
    np.testing.assert_allclose(found[:, 0], alone, rtol=1e-14)
    np.testing.assert_allclose(found[:, 1], brf(thick, BUDGET), rtol=ALONE)


def test_what_a_column_may_be():
    """Under a sun on a sphere, with phase functions, from several views and without delta-M, those
    that are not solved are within half of the budget."""
    rng = np.random.default_rng(7)
    given = columns(scattered=5e-4)
    count = given["mu0"].size
    views = {"mu": (0.3, 1), "relative_azimuth": (0, np.pi)}
    given = given | {k: rng.uniform(*ends, (count, 3)) for k, ends in views.items()}
    given = given | {"secant": rng.uniform(0.9, 1.3, (count, LAYERS)) / given["mu0"][:, None]}
    given = given | {"phase_function": rng.uniform(0.5, 2, (count, LAYERS, 1))}
    how = {"multiple_views": True, "delta_m": False}
    whole, found = (brf(given, x, **how) for x in (None, BUDGET))
    assert np.mean(found != whole) > 0.5
    wrong = np.abs(found - whole) / np.maximum(whole, 0.01)
    assert np.quantile(wrong, 0.99) < 0.5 * BUDGET


def test_a_sun_at_the_horizon_of_a_sphere():
    """More of it is scattered to the ground than a plane's of as long a path would send there."""
    rng = np.random.default_rng(8)
    given = columns(scattered=5e-4)
    count = given["mu0"].size
    mu0 = rng.uniform(0.002, 0.05, count)
    secant = rng.uniform(0.1, 0.6, (count, 1)) / mu0[:, None] * np.ones(LAYERS)
    given = given | {"mu0": mu0, "secant": secant}
    whole, found = (brf(given, x) for x in (None, BUDGET))
    wrong = np.abs(found - whole) / np.maximum(whole, 0.01)
    assert np.quantile(wrong, 0.99) < BUDGET and wrong.max() < 10 * BUDGET


@pytest.mark.slow
def test_light_is_rounded_where_the_budget_has_room(monkeypatch):
    """Of columns that are not solved it is that of single precision, within its rounding; here
    whatever is solved is no number."""
    given = warm(columns(scattered=1e-6))
    monkeypatch.setattr(emission, "_radiance", unsolved)
    # Budgets of their own, as above.
    rounded = light(given, BUDGET * (1 + 5e-9))
    small = light(given, 0.5 * budget.SINGLE_FROM * (1 + 7e-9))
    monkeypatch.setattr(budget, "SINGLE_FROM", np.inf)
    exact = light(given, BUDGET * (1 + 6e-9))
    off = np.abs(rounded / exact - 1)
    assert 1e-9 < np.median(off) and off.max() < 1e-6
    np.testing.assert_allclose(small, exact, rtol=1e-14)


def unsolved(lit, plan, how):
    return jnp.nan * lit.weights[0]


def test_thermal_light_of_faint_columns():
    """With fires below and sunlight: what is missing is within a fourth of the budget."""
    given = warm(columns(scattered=3e-4))
    whole, found = (light(given, x) for x in (None, BUDGET))
    assert np.any(found != whole)
    assert np.max(np.abs(found - whole) / whole) < BUDGET / 4


@pytest.mark.slow
def test_slopes_are_those_of_a_solution(monkeypatch):
    """As if no column were faint."""
    given = columns(scattered=1e-4)

    def slope(error_budget):
        def total(albedo):
            how = {"num_streams": 2, "error_budget": error_budget}
            return jnp.sum(toa_brf(**given | {"albedo": albedo}, **how))

        return np.asarray(jax.grad(total)(given["albedo"]))

    found = slope(BUDGET)
    monkeypatch.setattr(budget, "OF_FAINT", -1.0)
    np.testing.assert_allclose(found, slope(BUDGET * (1 + 3e-9)), rtol=1e-9)


@pytest.mark.slow
def test_light_from_above_is_solved():
    """Air reflects it as well, which nobody has counted."""
    from_above = warm(columns(scattered=3e-4)) | {"isotropic_top": np.ones(130)}
    whole, found = (light(from_above, x) for x in (None, BUDGET))
    np.testing.assert_allclose(found, whole, rtol=1e-4)


def test_no_share_of_the_budget_is_no_faint_column(monkeypatch):
    given = columns(scattered=3e-4)
    whole = brf(given, None)
    monkeypatch.setattr(budget, "OF_FAINT", -1.0)
    # Another budget, of which no program is kept.
    found = brf(given, BUDGET * (1 + 2e-9))
    np.testing.assert_allclose(found, whole, rtol=2e-5)


def test_low_sun_through_air_that_absorbs():
    """Its beam meets more than what is scattered out of it, which reaches the ground instead."""
    low = columns(scattered=3e-5)
    low = low | {"mu0": 10 ** np.linspace(-3, -1, len(low["mu0"]))}
    whole, found = (brf(low, x) for x in (None, BUDGET))
    assert np.mean(found != whole) > 0.5
    assert np.max(np.abs(found - whole) / np.maximum(whole, 0.01)) < BUDGET


def test_heat_under_opaque_air(monkeypatch):
    """A fire that nobody sees through the air needs no solution."""
    given = warm(columns(scattered=3e-5))
    scattering, absorbing = given["tau"] * given["ssa"], np.linspace(0.5, 3, LAYERS)
    tau = given["tau"] + absorbing
    given = given | {"tau": tau, "ssa": scattering / tau, "surface_emission": np.full(130, 30.0)}
    whole = light(given, None)
    monkeypatch.setattr(emission, "_radiance", unsolved)
    # A budget of its own, as above.
    found = light(given, BUDGET * (1 + 4e-9))
    assert np.max(np.abs(found - whole) / whole) < 1e-4
