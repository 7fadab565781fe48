"""An error budget: what it leaves out, that it is kept, and that nothing else depends on it."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.solver import slant_path_secant, toa_brf
from abi_operator.solver.method.doublings import reaches
from abi_operator.solver.skipping.budget import Expected
from abi_operator.solver.skipping.grouping import Alike, Limits, grouped
from abi_operator.solver.skipping.merging import Solved, handed_back, merged
from abi_operator.solver.skipping.plan import LayersOfModes, over_modes, planned

# Rounding of sums in another order.
ROUNDING = 1e-13
# A layer has the doublings of that column of its tile that needs most (`skipping.budget`).
ALONE = 2e-6
LAYERS, STREAMS = 12, 4


@cache
def columns(count=96, seed=3):
    """Air of twelve layers with a plume in two or three of them, or a cloud; many of them alike."""
    rng = np.random.default_rng(seed)
    level = np.linspace(0, 1, LAYERS + 1)
    air = rng.choice([0.2, 0.05, 0.002], (count, 1)) * np.diff(level**2)[None]
    base = rng.integers(5, LAYERS - 2, count)[:, None]
    inside = (np.arange(LAYERS) >= base) & (np.arange(LAYERS) < base + 3)
    plume = inside * 10 ** rng.uniform(-2, 1, (count, 1))
    cloud = rng.random((count, 1)) < 0.3
    g, ssa = np.where(cloud, 0.86, 0.65), np.where(cloud, 0.99999, 0.9)
    scattered = air + ssa * plume
    order = np.arange(4 * STREAMS + 1)
    rayleigh = np.where(order == 0, 1, np.where(order == 2, 0.1, 0))
    moments = air[..., None] * rayleigh + (ssa * plume)[..., None] * (g**order)[:, None]
    return {
        "tau": air + plume,
        "ssa": scattered / (air + plume),
        "moments": moments / scattered[..., None],
        "albedo": rng.uniform(0, 0.4, count),
        "mu0": rng.uniform(0.3, 0.95, count),
        "mu": rng.uniform(0.4, 0.95, count),
        "relative_azimuth": rng.uniform(0, np.pi, count),
    }


@cache
def solved(error_budget):
    return np.asarray(toa_brf(**columns(), num_streams=STREAMS, error_budget=error_budget))


@cache
def slopes(error_budget):
    """Of each column's reflectance in all its arguments."""

    def total(arguments):
        return jnp.sum(toa_brf(**arguments, num_streams=STREAMS, error_budget=error_budget))

    return jax.tree.map(np.asarray, jax.grad(total)(columns()))


@cache
def value_beside(error_budget):
    """Reflectances as they come with their slopes, for which more groups are made."""

    def brf(arguments):
        return toa_brf(**arguments, num_streams=STREAMS, error_budget=error_budget)

    return np.asarray(jax.vjp(brf, columns())[0])


def error(error_budget):
    exact = solved(None)
    return np.abs(solved(error_budget) - exact) / np.maximum(exact, 0.01)


@pytest.mark.parametrize("error_budget", [1e-2, 1e-3, 1e-5])
def test_the_budget_is_kept(error_budget):
    assert np.quantile(error(error_budget), 0.99) < error_budget
    assert error(error_budget).max() < 10 * error_budget


def test_a_larger_budget_is_spent():
    """Something is left out at each of them, and more where more may be."""
    spent = [np.mean(error(x)) for x in (1e-2, 1e-3, 1e-5)]
    assert spent[0] > spent[1] > spent[2] > 1e-12


@pytest.mark.parametrize("name", ["tau", "ssa", "moments"])
def test_a_column_that_is_no_number_moves_no_other(name):
    """Layers of a tile are grouped for all its columns together."""
    given, others = dict(columns()), np.arange(96) != 5
    given[name] = given[name].copy()
    given[name][5] = np.nan
    how = {"num_streams": STREAMS, "error_budget": 1e-3, "check_values": False}
    found = np.asarray(toa_brf(**given, **how))
    assert np.isnan(found[5])
    np.testing.assert_allclose(found[others], solved(1e-3)[others], rtol=1e-5)


@pytest.mark.parametrize("error_budget", [pytest.param(1e-2, marks=pytest.mark.slow), 1e-3])
def test_slopes_of_members_are_their_own(error_budget):
    """1 % of a column's slopes, those in each of its layers among them, in 99 of 100 columns."""
    exact, found = slopes(None), slopes(error_budget)
    count = len(exact["mu0"])

    def flat(slopes):
        return np.concatenate([x.reshape(count, -1) for x in slopes.values()], axis=1)

    wrong = np.linalg.norm(flat(found) - flat(exact), axis=1)
    assert np.quantile(wrong / np.linalg.norm(flat(exact), axis=1), 0.99) < 0.01


@pytest.mark.slow
def test_slopes_in_moments_of_high_degree():
    """They are much the same in every mode: with many streams most modes count for them, although
    they count for nothing in the reflectance."""
    given, num_streams = dict(columns()), 12
    given["moments"] = given["moments"][..., : num_streams + 1]

    def found(error_budget):
        def total(arguments):
            how = {"num_streams": num_streams, "error_budget": error_budget}
            return jnp.sum(toa_brf(**arguments, **how))

        slopes = jax.grad(total)(given)
        return np.concatenate([np.asarray(x).reshape(96, -1) for x in slopes.values()], axis=1)

    whole = found(None)
    wrong = np.linalg.norm(found(1e-3) - whole, axis=1) / np.linalg.norm(whole, axis=1)
    assert np.quantile(wrong, 0.99) < 0.01


@pytest.mark.slow
def test_the_same_inside_of_everything():
    """Under `jax.jit`, mapped one by one and with the others in another order: what is left out for
    a column hardly depends on any other."""
    given, error_budget = columns(), 1e-3

    def one(arguments):
        return toa_brf(**arguments, num_streams=STREAMS, error_budget=error_budget)

    np.testing.assert_allclose(jax.jit(one)(given), solved(error_budget), rtol=ALONE)
    np.testing.assert_allclose(jax.vmap(one)(given), solved(error_budget), rtol=ALONE)
    order = np.random.default_rng(1).permutation(96)
    given = {name: x[order] for name, x in given.items()}
    _, found = jax.jit(jax.vmap(jax.value_and_grad(one)))(given)
    for name, slope in found.items():
        wanted = slopes(error_budget)[name]
        np.testing.assert_allclose(slope, wanted[order], atol=ALONE * np.abs(wanted).max())


def test_a_column_without_numbers_spoils_no_other():
    given, error_budget = dict(columns()), 1e-3
    given["albedo"] = np.where(np.arange(96) == 17, np.nan, given["albedo"])
    how = {"num_streams": STREAMS, "error_budget": error_budget, "check_values": False}
    rest = np.arange(96) != 17

    def total(arguments):
        found = toa_brf(**arguments, **how)
        return jnp.sum(found), found

    found, value = jax.grad(total, has_aux=True)(given)
    assert np.isnan(value[17])
    np.testing.assert_allclose(value[rest], value_beside(error_budget)[rest], rtol=ALONE)
    for name, slope in found.items():
        wanted = slopes(error_budget)[name]
        np.testing.assert_allclose(slope[rest], wanted[rest], atol=ALONE * np.abs(wanted).max())


@pytest.mark.slow
def test_two_views_at_once():
    """Both get what each gets alone, within the budget."""
    given, views = dict(columns()), np.array([0.5, 0.9])
    given |= {"relative_azimuth": np.ones(96)}
    alone = [toa_brf(**given | {"mu": np.full(96, x)}, num_streams=STREAMS) for x in views]
    exact = np.stack(alone, axis=1)
    given |= {"mu": np.broadcast_to(views, (96, 2)), "relative_azimuth": np.ones((96, 2))}
    how = {"num_streams": STREAMS, "multiple_views": True}
    found = np.asarray(toa_brf(**given, **how, error_budget=1e-3))
    wrong = np.abs(found - exact) / np.maximum(exact, 0.01)
    assert np.quantile(wrong, 0.99) < 1e-3


@pytest.mark.slow
def test_second_derivatives_solve_everything():
    """They are those without a budget."""
    given = {name: x[:2] for name, x in columns().items()}

    def curvature(error_budget):
        def brf(tau):
            how = {"num_streams": 2, "num_doublings": 4, "error_budget": error_budget}
            moments = given["moments"][..., :3]
            return jnp.sum(toa_brf(**given | {"tau": tau, "moments": moments}, **how))

        return jax.jvp(jax.grad(brf), (given["tau"],), (np.ones_like(given["tau"]),))[1]

    np.testing.assert_allclose(curvature(1e-2), curvature(None), rtol=0.1, atol=0.05)


@pytest.mark.float32
def test_single_precision():
    given = {name: x.astype(np.float32) for name, x in columns().items()}
    exact = np.asarray(toa_brf(**given, num_streams=STREAMS))
    found = np.asarray(toa_brf(**given, num_streams=STREAMS, error_budget=1e-3))
    assert found.dtype == np.float32
    wrong = np.abs(found - exact) / np.maximum(exact, 0.01)
    assert np.quantile(wrong, 0.99) < 1e-3


@pytest.mark.float32
def test_little_that_scatters_over_much_that_absorbs():
    """Under black layers of 2e5 a difference of depths has no digit left of what scatters."""
    given = {name: x.astype(np.float32) for name, x in columns().items()}
    black = np.arange(LAYERS) >= LAYERS - 2
    given["ssa"] = np.where(black, np.float32(0), given["ssa"])
    given["tau"] = np.where(black, np.float32(1e5), np.float32(6e-4))
    given["mu0"], given["mu"] = given["mu0"] * np.float32(0.2), given["mu"] * np.float32(0.2)
    exact = np.asarray(toa_brf(**given, num_streams=STREAMS))
    found = np.asarray(toa_brf(**given, num_streams=STREAMS, error_budget=1e-3))
    np.testing.assert_allclose(found, exact, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("wrong", [0.0, 1.0, -1e-3, float("nan")])
def test_budgets_that_are_none(wrong):
    with pytest.raises(ValueError, match="error_budget must be above 0"):
        toa_brf(**columns(), num_streams=STREAMS, error_budget=wrong)


def layers(batch=5):
    rng = np.random.default_rng(0)
    tau = 10 ** rng.uniform(-3, 0, (LAYERS, batch))
    return tau, rng.uniform(0, 1, (LAYERS, 4, batch))


@jax.jit
def compiled(alike, limits):
    return grouped(alike, limits)


def groups_of(alike, limits):
    """As one program for all that is alike in shape."""
    return jax.tree.map(np.asarray, compiled(alike, limits))


MERGED, HANDED_BACK = jax.jit(merged), jax.jit(handed_back)


def limited(allowed, thickest=np.inf):
    return Limits(np.full(5, 2.0), np.full(5, allowed), thickest)


def test_alike_layers_are_one_group():
    tau, _ = layers()
    same = 0 * tau + 0.9
    limits = limited(1e-12)
    groups = groups_of(Alike(tau, same, 0.5 * same), limits)
    assert groups.number == 1 and not groups.labels.any()
    other = same.copy()
    other[LAYERS // 2 :] = 0.1
    groups = groups_of(Alike(tau, other, 0.5 * other), limits)
    assert groups.number == 2
    np.testing.assert_array_equal(groups.labels[:, 0], np.arange(LAYERS) >= LAYERS // 2)


def test_layers_that_share_g_and_no_more_stay_apart():
    """Droplets of two sizes: delta-M brings their g together, and not their further moments."""
    tau, _ = layers()
    same, further = 0 * tau + 1, np.where(np.arange(LAYERS)[:, None] < LAYERS // 2, 0.1, 0.2)
    limits = limited(1e-4)
    alike = Alike(tau, same, 0.75 * same)
    assert groups_of(alike, limits).number == 1
    for differs in ("further", "second"):
        groups = groups_of(alike._replace(**{differs: further * same}), limits)
        assert groups.number == 2
        np.testing.assert_array_equal(groups.labels[:, 0], np.arange(LAYERS) >= LAYERS // 2)


def test_layers_are_merged_by_the_sun_that_they_see():
    """Air of one composition under a sun that is low, over a spherical Earth."""
    levels = np.linspace(6e4, 0, LAYERS + 1)
    mu0 = np.cos(np.deg2rad(88))
    given = {
        "tau": 0.3 * np.diff(np.exp(-levels / 8e3)),
        "ssa": np.ones(LAYERS),
        "moments": np.tile([1, 0, 0.1], (LAYERS, 1)),
        "albedo": 0.1,
        "mu0": mu0,
        "mu": 0.8,
        "relative_azimuth": 1.0,
        "secant": slant_path_secant(jnp.asarray(levels), jnp.asarray(mu0)),
    }
    whole, within = (toa_brf(**given, num_streams=2, error_budget=x) for x in (None, 1e-3))
    np.testing.assert_allclose(within, whole, rtol=1e-3)


def modes_that_count(last_moment, shares):
    """Of a column of one layer with this last moment, whose modes are such shares of the budget."""
    one = jnp.ones((1, 1))
    moments = 0 * one[None], (2 * STREAMS - 1) * last_moment * one[None]
    moments = tuple(jnp.repeat(x, STREAMS // 2, axis=1) for x in moments)
    moments = moments[0].at[:, 0].set(1), moments[1]  # all is scattered
    layers = LayersOfModes(one, 0 * one, one, moments)
    known = Expected(one, one[0], one[0], 1e9 * one[0], one[0], one[0])
    plan = planned(layers, one, known, 1e-3, None)

    def body(carry, share, counts):
        return carry, counts, share

    modes = np.asarray(shares, float)[:, None]
    return int(np.sum(over_modes(body, 0.0, modes, 0, np.zeros_like(modes), plan)[1]))


def test_modes_end_at_a_small_one_after_one_that_is_not_large():
    flat, sharp = 0.5 / STREAMS, 0.9 / STREAMS
    assert modes_that_count(flat, [9, 2, 0.1, 9, 9]) == 3
    assert modes_that_count(flat, [9, 4, 0.1, 9, 9]) == 5
    # Of a sharp peak forwards three in a row may be small by chance, any number of one backwards.
    assert modes_that_count(flat, [99, 2, 0.1, 9, 9]) == 3
    assert modes_that_count(sharp, [9, 2, 0.1, 9, 9]) == 5
    assert modes_that_count(sharp, [9, 2, 0.9, 0.1, 9]) == 4
    assert modes_that_count(sharp, [99, 2, 0.9, 0.1, 9]) == 5
    assert modes_that_count(-0.1, [0.1, 0.1, 0.1, 0.1, 9]) == 5


def test_a_thin_black_layer_is_not_spread_through_a_thick_white_one():
    """Under a layer that only scatters nobody sees it, and in one a little of it is much."""
    tau, _ = layers()
    first = np.arange(LAYERS)[:, None] == 0
    tau = np.where(first, 1e3, 0.05 / LAYERS + 0 * tau)
    white = np.where(first, 1.0, 0 * tau)
    limits = limited(3e-4)
    groups = groups_of(Alike(tau, white, 0 * tau), limits)
    np.testing.assert_array_equal(groups.labels[:, 0], np.arange(LAYERS) > 0)


@pytest.mark.slow
def test_one_layer_and_more_columns_than_a_tile():
    """Columns are put in order by their groups, of which there is one."""
    one = {k: x[:, :1] if np.ndim(x) > 1 else x for k, x in columns().items()}
    order = np.arange(7)
    given = one | {"moments": 0.7 ** order[None, None], "phase_function": np.ones((96, 1))}
    within, whole = (
        np.asarray(toa_brf(**given, num_streams=6, error_budget=x)) for x in (1e-3, None)
    )
    np.testing.assert_allclose(within, whole, rtol=1e-3)


def test_no_group_is_thicker_than_it_may_be():
    tau, _ = layers()
    same = 0 * tau + 0.9
    groups = groups_of(Alike(tau, same, same), limited(1.0, 2.0))
    for column in range(5):
        labels = groups.labels[:, column]
        for label in np.unique(labels):
            members = labels == label
            depth = 4 * float(tau[members, column].sum())  # on the way down and up
            assert depth < 2 or members.sum() == 1


def test_groups_have_sums_and_means():
    tau, rows = layers()
    rng = np.random.default_rng(1)
    uneven = rng.uniform(0, 1, tau.shape)
    groups = groups_of(Alike(tau, uneven, uneven), limited(0.02))
    depth, means = (np.asarray(x) for x in MERGED(groups, tau, rows))
    for column in range(5):
        labels = groups.labels[:, column].astype(int)
        for k in range(labels.max() + 1):
            members = labels == k
            t = tau[members, column]
            np.testing.assert_allclose(depth[k, column], t.sum(), rtol=ROUNDING)
            mean = t @ rows[members, :, column] / t.sum()
            np.testing.assert_allclose(means[k, :, column], mean, rtol=ROUNDING)


def test_slopes_handed_back_add_up():
    """Members' slopes times what they have sum to the group's, and a straight line is kept."""
    tau, rows = layers()
    groups = groups_of(Alike(tau, rows[:, 0], rows[:, 1]), limited(np.inf))
    depth, means = (np.asarray(x) for x in MERGED(groups, tau, rows))
    upper, lower = np.linspace(1, 2, 5)[:, None], np.linspace(-1, 3, 5)[:, None]
    faces = np.zeros((LAYERS + 1, 5, 5))
    faces[0], faces[1] = upper, lower
    mean = 0.5 * (upper + lower)
    row_slopes = np.zeros(rows.shape)
    row_slopes[0] = mean[1:] * depth[0]
    tau_slopes = np.zeros(tau.shape)
    tau_slopes[0] = mean[0] + np.sum(mean[1:] * means[0], axis=0)
    solved = Solved(depth, means, tau_slopes, row_slopes, faces)
    of_tau, of_rows = (np.asarray(x) for x in HANDED_BACK(groups, tau, rows, solved))
    np.testing.assert_allclose(of_rows.sum(axis=0), row_slopes[0], rtol=1e-12)
    place = (np.cumsum(tau, axis=0) - 0.5 * tau) / depth[0]
    line = upper + (lower - upper) * place[:, None]
    np.testing.assert_allclose(of_rows, tau[:, None] * line[:, 1:], rtol=1e-10, atol=1e-14)
    wanted = line[:, 0] + np.sum(rows * line[:, 1:], axis=1)
    np.testing.assert_allclose(of_tau, wanted, rtol=1e-10, atol=1e-13)


def test_reaches_rise_with_what_may_be_wrong():
    coarse, fine = reaches(1e-3), reaches(1e-9)
    assert all(x > y for x, y in zip(coarse, fine, strict=True))
    assert list(coarse) == sorted(coarse) and list(fine) == sorted(fine)
