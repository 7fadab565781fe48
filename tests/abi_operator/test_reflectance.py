"""The operator against an independent path, in batches, and its derivatives."""

from functools import cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from cdisort import cdisort_brf
from programs import programs_anew
from states import column, stacked

import abi_operator
from abi_operator import BANDS, GRASSO2013, band_columns, brf, reflectance_factor
from abi_operator.reflectance import with_the_suns_cosine
from abi_operator.solver import on_double_gauss

# Rayleigh depth at 1013.25 hPa and beta2 (Bodhaine et al. 1999); smoke relative to 555 nm, its
# single-scattering albedo and asymmetry (6SV2.1): typed again here, from the sources.
RAYLEIGH = {"C01": (0.18411, 0.47867), "C02": (0.05381, 0.47930), "C03": (0.01555, 0.47960)}
RAYLEIGH["C06"] = (0.000338, 0.4799)
SMOKE = {"C01": (1.3573, 0.9391, 0.6585), "C02": (0.7477, 0.9234, 0.5831)}
SMOKE |= {"C03": (0.3827, 0.8961, 0.4994), "C06": (0.0782, 0.8220, 0.6180)}
# The largest difference that one smoke row's last digit, 5e-5 in ssa, makes.
TABLE_DIGITS = 1e-4
# One program for a batch, whatever its number of columns, serves all that need no other. So many
# doublings are also what slopes of these columns choose by themselves.
OPTIONS = {"num_streams": 4, "num_doublings": 4}


def solved(*states):
    """Reflectances of columns in the default bands, together."""
    return np.asarray(brf(stacked(states), **OPTIONS))


@pytest.mark.slow
def test_equals_cdisort_on_layers_built_from_published_numbers():
    """Rayleigh and smoke at 1-3 km over grey ground, layers mixed in NumPy, no optics of ours."""
    state = column(liquid=0.0)
    height = np.asarray(state.atmosphere.height)
    pressure = np.asarray(state.atmosphere.pressure)
    # 0.550 um lies between the C01 centroid and 0.555 um; log-log interpolation of the extinction.
    slope = np.log(SMOKE["C01"][0]) / np.log(0.4711 / 0.555)
    at_550 = (0.55 / 0.555) ** slope
    inside = np.clip(np.minimum(height[:-1], 3000) - np.maximum(height[1:], 1000), 0, None) / 2000
    with on_double_gauss():
        result = solved(state)[0]
    for i, name in enumerate(GRASSO2013):
        depth, beta2 = RAYLEIGH[name]
        air = depth * np.diff(pressure) / 101325
        extinction, ssa, g = SMOKE[name]
        haze = 0.8 * extinction / at_550 * inside
        rayleigh = np.zeros(200)
        rayleigh[[0, 2]] = 1, beta2 / 5
        scattering = air + ssa * haze
        moments = air[:, None] * rayleigh + (ssa * haze)[:, None] * g ** np.arange(200)
        expected = cdisort_brf(
            air + haze, scattering / (air + haze), moments / scattering[:, None], 0.1,
            np.cos(0.6), np.cos(0.8), 1.2, OPTIONS["num_streams"], True,
        )  # fmt: skip
        np.testing.assert_allclose(result[i], expected, rtol=TABLE_DIGITS, err_msg=name)


def test_reflectance_factor_contains_the_cosine_of_the_sun():
    states = column(), column(smoke_aod=0.1)
    factors = reflectance_factor(stacked(states), **OPTIONS)
    np.testing.assert_allclose(factors, np.cos(0.6) * solved(*states), rtol=1e-14)


def test_a_sun_that_is_nowhere_is_not_below_the_horizon():
    zeniths = jnp.asarray([0.6, np.nan, 2.0, 0.6]), jnp.asarray([0.8, 0.8, 0.8, 2.0])
    found = with_the_suns_cosine(jnp.full((4, 1), 0.5), *zeniths)[:, 0]
    np.testing.assert_allclose(found, [0.5 * np.cos(0.6), np.nan, 0.0, np.nan])


def test_ground_alone_shows_its_albedo():
    state = column(liquid=0.0, smoke_aod=0.0, albedo=0.3)
    state = eqx.tree_at(lambda s: s.atmosphere.pressure, state, replace_fn=lambda p: 0 * p)
    np.testing.assert_allclose(solved(state, state), 0.3, rtol=1e-12)


def test_a_column_has_all_of_its_air_wherever_its_levels_begin():
    """From 24 km a twentieth of the air is above; the levels below say how much."""
    whole = column()
    cut = eqx.tree_at(
        lambda s: s.atmosphere.pressure, whole, replace_fn=lambda p: p.at[0].set(5045.0)
    )
    np.testing.assert_allclose(*solved(whole, cut), rtol=1e-14)


# Neither the first nor in their order: one where droplets absorb and one where air matters.
TWO = "C06", "C01"


STATES = column(), column(liquid=0, smoke_aod=0), column(albedo=0.4)
MOVED = (
    (lambda s: s.atmosphere.plumes["smoke"].extinction_550, 1e-9),
    (lambda s: s.atmosphere.plumes["smoke"].ssa["C01"], 1e-5),
    (lambda s: s.albedo["C06"], 1e-5),
    (lambda s: s.geometry.view_zenith, 1e-5),
)


def ends_of(state):
    """States that are moved by twice and once the step: there is no smoke below 0."""
    state = jax.tree.map(lambda x: np.asarray(x, float), state)
    return [
        eqx.tree_at(choose, state, choose(state) + size * step)
        for choose, step in MOVED
        for size in (2, 1)
    ]


@cache
def jacobians():
    """And values beside them, of `STATES` and then of the ends of each.

    In few bands, for compiling grows with them. The program is also `test_state_checks`'s.
    """

    def two_bands(state):
        factors = reflectance_factor(state, TWO, **OPTIONS)
        return factors, factors

    states = [*STATES, *(end for state in STATES for end in ends_of(state))]
    return jax.vmap(jax.jacfwd(two_bands, has_aux=True))(stacked(states))


def test_bands_can_be_chosen_and_ordered():
    chosen = [GRASSO2013.index(band) for band in TWO]
    expected = np.cos(0.6) * solved(*STATES)[:, chosen]
    _, values = jacobians()
    np.testing.assert_allclose(values[: len(STATES)], expected, rtol=1e-11)


def test_batches_equal_single_columns():
    states = [column(smoke_aod=a, albedo=b) for a, b in ((0.0, 0.05), (0.5, 0.2), (3.0, 0.6))]
    together = solved(*states)
    assert together.shape == (3, 4)
    for one, state in zip(together, states, strict=True):
        np.testing.assert_allclose(one, brf(state, **OPTIONS), rtol=1e-13)
    mapped = jax.vmap(lambda s: brf(s, **OPTIONS))(stacked(states))
    np.testing.assert_allclose(mapped, together, rtol=1e-13)


def test_exponential_terms_are_weighted_runs(monkeypatch):
    """A band of two gas terms is the weighted sum of two grey bands."""
    plain = band_columns.mixture
    # Two columns that differ in what the functions below read their gas from, and in no optics,
    # for there is no ash.
    grey = np.array([0.01, 0.3])
    pair = stacked([column(smoke_aod=0.3, num_layers=4)] * 2)
    pair = eqx.tree_at(lambda s: s.atmosphere.plumes["ash"].brightness, pair, grey)

    def run(depths_of, weights):
        def optics(atmosphere, *how):
            air = plain(atmosphere, *how)
            tau = air.tau + depths_of(atmosphere)[:, None] * jnp.ones_like(atmosphere.height[1:])
            return air._replace(tau=tau, ssa=air.ssa * air.tau / tau, weight=jnp.asarray(weights))

        monkeypatch.setattr(band_columns, "mixture", optics)
        monkeypatch.setattr(band_columns, "num_terms", lambda *_: len(weights))
        programs_anew(monkeypatch)
        return brf(pair, ("C01",), num_streams=2, num_modes=1, num_doublings=0)

    single = run(lambda air: air.plumes["ash"].brightness[None], [1.0])
    both = run(lambda air: jnp.asarray(grey)[:, None], [0.25, 0.75])
    assert abs(single[1] / single[0] - 1) > 0.1
    np.testing.assert_allclose(both[0], 0.25 * single[0] + 0.75 * single[1], rtol=1e-12)
    np.testing.assert_array_equal(both[0], both[1])


@pytest.mark.parametrize("number", range(2), ids=["cloud and smoke", "clear"])
def test_jacobian_of_every_leaf(number):
    """Equals differences; finite where there is no cloud and no plume.

    That reverse mode gives the same is asked of states that hold more (`test_jacobian`).
    """
    slopes, values = jacobians()
    forward = jax.tree.map(lambda x: np.asarray(x)[number], slopes)
    for path, k in jax.tree_util.tree_leaves_with_path(forward):
        assert np.isfinite(k).all(), jax.tree_util.keystr(path)
    value, of_ends = np.asarray(values)[number], np.asarray(values)[len(STATES) :]
    ends = of_ends.reshape(len(STATES), len(MOVED), 2, len(TWO))[number]
    for (choose, step), (two, one) in zip(MOVED, ends, strict=True):
        difference = (4 * (one - value) - (two - value)) / (2 * step)
        scale = np.abs(choose(forward)).max() + 1e-12
        np.testing.assert_allclose(choose(forward) / scale, difference / scale, atol=1e-5)


@pytest.mark.float32
def test_float32_states_give_float32_reflectances():
    state = jax.tree.map(lambda x: jnp.asarray(x, jnp.float32), column())
    single = brf(state, num_doublings=5)
    assert single.dtype == jnp.float32
    with jax.enable_x64(True):
        double = brf(jax.tree.map(lambda x: jnp.asarray(x, jnp.float64), state), num_doublings=5)
    np.testing.assert_allclose(single, double, rtol=1e-4)


def test_errors_name_what_is_wrong():
    state = column()
    with pytest.raises(ValueError, match=r"\['C13'\] are not simulated; choose from \['C01'"):
        brf(state, ("C01", "C13"))
    with pytest.raises(ValueError, match="once"):
        brf(state, ("C01", "C01"))
    poor = eqx.tree_at(lambda s: s.albedo, state, {"C01": 0.1})
    with pytest.raises(ValueError, match=r"state.albedo has no 'C02'; it holds \['C01'\]"):
        brf(poor)
    batch = jax.tree.map(lambda x: jnp.stack([jnp.asarray(x)] * 2), state)
    uneven = eqx.tree_at(lambda s: s.atmosphere.height, batch, state.atmosphere.height)
    with pytest.raises(ValueError, match=r"state.atmosphere.height has shape \(13,\)"):
        brf(uneven)


def test_public_names():
    assert abi_operator.__version__
    assert set(GRASSO2013) < set(BANDS)


@pytest.mark.slow
def test_an_error_budget_is_for_values_and_derivatives():
    """Within it, and the Jacobian within 1 % of each leaf's largest entry."""
    states = stacked([column(liquid=x) for x in (0.0, 0.01, 0.1)])

    def total(state, error_budget):
        return jnp.sum(brf(state, ("C01", "C03"), error_budget=error_budget, **OPTIONS))

    both = jax.value_and_grad(total)
    (exact, slopes), (found, near) = both(states, None), both(states, 1e-3)
    np.testing.assert_allclose(found, exact, rtol=1e-3)
    assert found != exact
    for slope, right in zip(jax.tree.leaves(near), jax.tree.leaves(slopes), strict=True):
        np.testing.assert_allclose(slope, right, rtol=0, atol=0.01 * np.abs(right).max() + 1e-12)
