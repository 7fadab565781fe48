"""What columns that emit do not need: radiances within the budget, slopes of every layer."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from surfaces import Constant

from abi_operator.solver import toa_brf, toa_radiance
from abi_operator.solver.skipping.grouping import Alike, Limits, grouped
from abi_operator.solver.skipping.heat import unscattered
from abi_operator.solver.skipping.one_pass import Air, known

STREAMS, LAYERS, COLUMNS = 4, 12, 96
DARK = 0.01  # reflectance below which errors are of that
ROUNDING = 1e-12


@cache
def columns():
    """Air that absorbs, a tenth of it with a cloud, over warm ground; the last half by night."""
    rng = np.random.default_rng(0)
    share = np.sort(rng.uniform(0, 1, (COLUMNS, LAYERS)), axis=1)
    tau = 10 ** rng.uniform(-2, 1.2, (COLUMNS, 1)) * share / share.sum(axis=1, keepdims=True)
    scattered = 1e-4 * np.ones_like(tau)
    scattered[:: COLUMNS // 6, 5:8] = rng.uniform(0.1, 2, 3)
    angles = rng.uniform(0.3, 1, (2, COLUMNS))
    planck = np.sort(10 ** rng.uniform(-2.5, 0, (COLUMNS, LAYERS + 1)), axis=1)
    albedo = rng.uniform(0, 0.4, COLUMNS)
    degrees = np.arange(STREAMS + 1)
    return {
        "tau": tau + scattered,
        "ssa": scattered / (tau + scattered),
        "moments": np.broadcast_to(0.7**degrees, (COLUMNS, LAYERS, STREAMS + 1)).copy(),
        "phase_function": np.full((COLUMNS, LAYERS), 0.4),
        "albedo": albedo,
        "mu0": angles[0],
        "mu": angles[1],
        "relative_azimuth": rng.uniform(0, np.pi, COLUMNS),
        "solar_irradiance": np.where(np.arange(COLUMNS) < COLUMNS // 2, 10.0, 0.0),
        "planck_levels": planck,
        "surface_emission": (1 - albedo) * 1.2 * planck[:, -1],
    }


@cache
def solved(error_budget):
    return np.asarray(toa_radiance(**columns(), num_streams=STREAMS, error_budget=error_budget))


@pytest.mark.parametrize("error_budget", [pytest.param(1e-2, marks=pytest.mark.slow), 1e-3])
def test_radiances_are_within_the_budget(error_budget):
    given = columns()
    sun = given["solar_irradiance"] * given["mu0"] / np.pi
    wrong = np.abs(solved(error_budget) - solved(None)) / np.maximum(solved(None), DARK * sun)
    assert 0 < np.quantile(wrong, 0.99) < error_budget
    # Of thermal light that nothing scatters nothing is lost, and little is scattered of it here.
    clear = given["ssa"].max(axis=1) < 0.05
    assert wrong[clear].max() < 0.5 * error_budget


def test_light_of_fires_below_and_on_the_top_is_counted():
    """Of a ground far hotter than its air, which layers that scatter turn back and forth."""
    rng = np.random.default_rng(1)
    shape = (COLUMNS, LAYERS)
    bright = 10 ** rng.uniform(0.5, 3, COLUMNS)
    given = columns() | {
        "tau": 10 ** rng.uniform(-4, 0, shape),
        "ssa": rng.uniform(0.3, 1, shape),
        "moments": rng.uniform(-0.2, 0.9, (*shape, 1)) ** np.arange(STREAMS + 1),
        "surface_emission": bright,
    }
    for light in ({}, {"isotropic_top": 5.0}):
        whole, found = (
            np.asarray(toa_radiance(**given, **light, num_streams=STREAMS, error_budget=budget))
            for budget in (None, 1e-3)
        )
        wrong = np.abs(found - whole) / whole
        assert 0 < np.quantile(wrong, 0.99) < 1e-3 and wrong.max() < 1e-2


@pytest.mark.slow
def test_modes_do_not_end_where_a_cosine_is_small():
    """Where the second is nothing by its azimuth it says nothing of the third: without heat as many
    are solved as of a reflectance."""
    rng, count = np.random.default_rng(0), 400
    g, tau = rng.uniform(0.3, 0.85, (count, 1)), 10 ** rng.uniform(-1.5, 0.5, (count, 1))
    mu0, mu = rng.uniform(0.1, 1, (2, count))
    given = {
        "tau": tau,
        "ssa": rng.uniform(0.7, 1, (count, 1)),
        "moments": g[..., None] ** np.arange(STREAMS + 1),
        "phase_function": np.ones((count, 1)),
        "albedo": np.full(count, 0.1),
        "mu0": mu0,
        "mu": mu,
        "relative_azimuth": np.full(count, np.pi / 4),
    }
    how = {"num_streams": STREAMS, "error_budget": 1e-3}
    brf = toa_brf(**given, **how)
    cold = {"solar_irradiance": np.pi / mu0, "planck_levels": np.zeros((count, 2))}
    found = toa_radiance(**given, **cold, **how)
    np.testing.assert_allclose(found, brf, rtol=1e-6)


@cache
def slopes(error_budget):
    """Value, and slopes in all arguments, a row a column."""

    def total(arguments):
        how = {"num_streams": STREAMS, "error_budget": error_budget}
        light = toa_radiance(**arguments, **how)
        return jnp.sum(light), light

    found, light = jax.grad(total, has_aux=True)(columns())
    return np.asarray(light), {k: np.asarray(x).reshape(COLUMNS, -1) for k, x in found.items()}


def test_slopes_are_those_of_every_layer_in_the_modes_that_count():
    """Within 1 % of all slopes of a column; in a sun that does not shine they are the mean's."""
    (light, found), (exact, whole) = slopes(1e-3), slopes(None)
    sun = columns()["solar_irradiance"] * columns()["mu0"] / np.pi
    assert np.max(np.abs(light - exact) / np.maximum(exact, DARK * sun)) < 1e-3
    by_night = sun[:, None] == 0
    in_sun = {"solar_irradiance": np.where(by_night, 0, whole["solar_irradiance"])}
    found = found | {"solar_irradiance": np.where(by_night, 0, found["solar_irradiance"])}
    found, whole = (np.concatenate(list(x.values()), axis=1) for x in (found, whole | in_sun))
    error = np.linalg.norm(found - whole, axis=1) / np.linalg.norm(whole, axis=1)
    assert 1e-9 < np.quantile(error, 0.99) < 1e-2
    assert np.median(error) < 1e-6


def test_slopes_in_a_sun_that_does_not_shine_are_the_means():
    """`toa_radiance` says so."""

    def total(irradiance):
        given = columns() | {"solar_irradiance": irradiance}
        return jnp.sum(toa_radiance(**given, num_streams=STREAMS, num_modes=1))

    by_night = columns()["solar_irradiance"] == 0
    of_mean = np.asarray(jax.grad(total)(columns()["solar_irradiance"]))[by_night]
    found = slopes(1e-3)[1]["solar_irradiance"][by_night, 0]
    np.testing.assert_allclose(found, of_mean, rtol=1e-4)  # doublings end as the budget allows


def test_modes_of_what_hardly_scatters_are_not_solved_for_slopes():
    """The mean depends on no azimuth."""
    found, whole = (slopes(x)[1]["relative_azimuth"][:, 0] for x in (1e-3, None))
    cloudy = np.arange(COLUMNS) % (COLUMNS // 6) == 0
    np.testing.assert_allclose(found[cloudy], whole[cloudy], rtol=1e-5)
    left_out = found == 0
    assert np.mean(left_out[~cloudy]) > 0.8 and 0 < np.abs(whole[left_out]).max() < 1e-5


def test_other_grounds_are_solved_whole():
    given = columns() | {"albedo": Constant(jnp.asarray(columns()["albedo"]))}
    whole, found = (
        np.asarray(toa_radiance(**given, num_streams=2, error_budget=budget))
        for budget in (None, 1e-2)
    )
    np.testing.assert_allclose(found, whole, rtol=ROUNDING)


def test_cold_space_over_warm_air_is_light_too():
    """At night, of ground and air of one temperature: what scatters sends back space's darkness."""
    whole = np.ones((COLUMNS, LAYERS))
    given = columns() | {
        "tau": 2 / LAYERS * 2 * whole,
        "ssa": np.where(np.arange(LAYERS) < LAYERS // 2, 1.0, 0.0) * whole,
        "moments": np.broadcast_to(np.arange(STREAMS + 1) == 0, (*whole.shape, STREAMS + 1)) * 1.0,
        "albedo": np.zeros(COLUMNS),
        "planck_levels": np.ones((COLUMNS, LAYERS + 1)),
        "surface_emission": np.ones(COLUMNS),
        "solar_irradiance": np.zeros(COLUMNS),
    }
    exact, found = (
        np.asarray(toa_radiance(**given, num_streams=STREAMS, error_budget=budget))
        for budget in (None, 1e-3)
    )
    assert exact.max() < 0.9
    np.testing.assert_allclose(found, exact, rtol=1e-3)


UNSCATTERED = jax.jit(unscattered, static_argnums=5)


def test_unscattered_light_does_not_depend_on_how_layers_are_cut():
    """Of a Planck function that is linear in the optical depth of homogeneous air."""
    depth = np.linspace(0, 3, 13)
    planck = 1 + 2 * depth
    secant = np.asarray([1.5])

    def light(levels, of_levels):
        tau, jumps = np.diff(levels)[:, None], np.diff(of_levels)[:, None]
        coalbedo = np.full_like(tau, 0.8)
        return UNSCATTERED(tau, coalbedo, of_levels[:-1, None], jumps, secant, STREAMS)

    fine, coarse = light(depth, planck), light(depth[[0, 12]], planck[[0, 12]])
    np.testing.assert_allclose(fine.up, coarse.up, rtol=ROUNDING)
    np.testing.assert_allclose(fine.down, coarse.down, rtol=ROUNDING)
    # Light of air that emits what it takes, as it is found from below.
    tau, planck = np.diff(depth)[:, None], planck[:, None]
    whole = UNSCATTERED(tau, 1 + 0 * tau, planck[:-1], np.diff(planck, axis=0), secant, STREAMS)
    air = Air(tau, 0 * tau, np.zeros((12, STREAMS + 1, 1)), 0 * tau[:, None], planck=planck)
    seen = jax.jit(known, static_argnums=(4, 5))
    found = seen(air, 1 / secant, 1 / secant[None], 0 * secant, STREAMS, True).passing
    np.testing.assert_allclose(found.up, whole.up, rtol=ROUNDING)
    np.testing.assert_allclose(found.down, whole.down, rtol=ROUNDING)
    assert not found.turned.any() and found.hottest == planck[-1]
    # By hand: 0.8 times the integral of (1 + 2 t) exp(-1.5 t) 1.5 from 0 to 3.
    through = np.exp(-4.5)
    wanted = 0.8 * (1 - 7 * through + 2 / 1.5 * (1 - through))
    np.testing.assert_allclose(fine.up, wanted, rtol=ROUNDING)


def test_layers_that_scatter_their_own_light_stay_apart():
    tau = np.ones((4, 1))
    planck = np.asarray([1.0, 1.0, 10.0, 10.0, 10.0])[:, None]
    limits = Limits(np.full(1, 2.0), np.full(1, 1e-2), np.inf)
    compiled = jax.jit(lambda alike: grouped(alike, limits))

    def labels(ssa):
        alike = Alike(tau, ssa * tau, 0 * tau, None, planck, np.ones(1))
        return np.asarray(compiled(alike).labels)[:, 0]

    np.testing.assert_array_equal(labels(1e-4), 0)
    # The second is 10 times as warm at its lower face; the others are of one temperature.
    np.testing.assert_array_equal(labels(0.5), [0, 1, 2, 2])
