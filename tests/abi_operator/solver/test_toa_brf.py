"""Closed forms, invariances and errors of the solver's door."""

from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from cdisort import cdisort_brf
from columns import STANDARD, simple_columns, standard_columns
from programs import programs_anew

from abi_operator.solver import half_range, on_double_gauss, toa_albedo, toa_brf
from abi_operator.solver.column import aligned, promoted
from abi_operator.solver.method import doublings

# A few hundred products and inverses of well-conditioned matrices.
ROUNDING = 1e-12
# The residue of doubling a layer in two different ways; the start of a layer errs by 1e-12.
SPLIT = 1e-10


# Columns that make a chunk of the first width, of which a program is compiled anyway.
MANY = 8


def brf(columns, **options):
    return np.asarray(toa_brf(*columns, **(STANDARD | options)))


def test_without_atmosphere_it_is_the_albedo():
    tau, *rest = standard_columns()
    np.testing.assert_allclose(brf((0 * tau, *rest)), rest[2], rtol=ROUNDING)


def test_without_scattering_the_ground_shines_through_both_paths():
    tau, ssa, moments, albedo, mu0, mu, azimuth = standard_columns()
    expected = albedo * np.exp(-tau.sum(axis=1) * (1 / mu0 + 1 / mu))
    result = brf((tau, 0 * ssa, moments, albedo, mu0, mu, azimuth))
    np.testing.assert_allclose(result, expected, rtol=1e-9)


def test_thin_layer_scatters_once_exactly():
    tau, ssa, _, albedo, mu0, mu, azimuth = standard_columns()
    g, thin = 0.7, 1e-8 * tau
    moments = np.broadcast_to(g ** np.arange(65), (*tau.shape, 65))
    angle = -mu * mu0 - np.sqrt((1 - mu**2) * (1 - mu0**2)) * np.cos(azimuth)
    phase = (1 - g**2) / (1 + g**2 - 2 * g * angle) ** 1.5
    expected = (ssa * thin).sum(axis=1) * phase / (4 * mu * mu0)
    result = brf((thin, ssa, moments, 0 * albedo, mu0, mu, azimuth))
    # What is scattered twice is smaller by tau; from the 65th term on g = 0.7 leaves 2e-8.
    np.testing.assert_allclose(result, expected, rtol=1e-6)


@pytest.mark.parametrize("num_streams", [4, pytest.param(16, marks=pytest.mark.slow)])
def test_nothing_is_lost_between_white_ground_and_white_air(num_streams):
    """With ssa = 1 over albedo 1 the mean of the BRF over all views, weighted by mu, is 1."""
    nodes, weights = half_range(num_streams)
    # The mean over so many azimuths is the mode of order 0.
    azimuths = 2 * np.pi * np.arange(num_streams) / num_streams
    mu, azimuth = (x.ravel() for x in np.meshgrid(nodes, azimuths, indexing="ij"))
    tau = np.tile([0.1, 3.0, 65, 65, 70], (mu.size, 1))
    moments = np.broadcast_to(0.85 ** np.arange(65), (*tau.shape, 65))
    one = np.ones(mu.size)
    columns = tau, np.ones(tau.shape), moments, one, 0.6 * one, mu, azimuth
    result = brf(
        columns, num_streams=num_streams, num_doublings=None, single_scattering=None
    )  # fmt: skip
    mean = np.mean(result.reshape(nodes.size, -1), axis=1)
    np.testing.assert_allclose(2 * np.sum(weights * nodes * mean), 1, rtol=1e-11)


def test_swapping_sun_and_satellite_changes_nothing():
    tau, ssa, moments, albedo, mu0, mu, azimuth = standard_columns()
    there = brf((tau, ssa, moments, albedo, mu0, mu, azimuth))
    back = brf((tau, ssa, moments, albedo, mu, mu0, azimuth))
    np.testing.assert_allclose(there, back, rtol=1e-11)


def test_split_layers_and_empty_layers_change_nothing():
    tau, ssa, moments, *rest = standard_columns()

    def with_layers(*, chosen, share):
        layers = tau[:, chosen] * np.array(share), ssa[:, chosen], moments[:, chosen]
        return brf((*layers, *rest))

    whole = with_layers(chosen=[0, 1, 2, 2, 2], share=[1, 1, 0, 0, 0])
    halves = with_layers(chosen=[0, 0, 1, 1, 2], share=[0.5, 0.5, 0.5, 0.5, 0])
    np.testing.assert_allclose(halves, whole, rtol=SPLIT)
    apart = with_layers(chosen=[2, 0, 3, 1, 4], share=[0, 1, 0, 1, 0])
    np.testing.assert_allclose(apart, whole, rtol=1e-13)


@pytest.mark.parametrize("count", [1, 7, 300])
def test_batch_order_subset_and_tiles_change_nothing(count):
    columns = standard_columns(count)
    order = np.random.default_rng(0).permutation(count)
    whole = brf(columns)
    np.testing.assert_allclose(brf([x[order] for x in columns]), whole[order], rtol=1e-13)
    single = [float(brf([x[i] for x in columns])) for i in range(min(count, 3))]
    np.testing.assert_allclose(single, whole[:3], rtol=1e-13)


def test_leading_axes_broadcast():
    tau, ssa, moments, albedo, mu0, mu, azimuth = standard_columns()
    albedos = np.array([0.5, 0.1])[:, None]
    grid = brf((tau, ssa, moments, albedos, mu0, mu, azimuth))
    assert grid.shape == (2, 4)
    one = brf((tau, ssa, moments, np.full(4, 0.1), mu0, mu, azimuth))
    np.testing.assert_allclose(grid[1], one, rtol=1e-13)


def test_doublings_chosen_from_the_data_equal_more_of_them(monkeypatch):
    """Each layer has more beside thick neighbours, and if it is thought to reach less far."""
    columns = standard_columns()
    options = {"num_doublings": None, "single_scattering": None}
    chosen = brf(columns, **options)
    traced = jax.jit(lambda *a: toa_brf(*a, num_streams=4, single_scattering=None))(*columns)
    np.testing.assert_allclose(chosen, traced, rtol=1e-10)
    thick = [columns[0].copy(), *columns[1:]]
    thick[0][2:] = 1e4
    np.testing.assert_allclose(brf(thick, **options)[:2], chosen[:2], rtol=SPLIT)
    programs_anew(monkeypatch)
    monkeypatch.setattr(doublings, "_reach", lambda k, *_, reach=doublings._reach: reach(k) / 4**4)
    more = brf(columns, **options)
    assert np.any(more != chosen)
    np.testing.assert_allclose(more, chosen, rtol=SPLIT)


def test_lists_are_arrays():
    columns = standard_columns()
    listed = [x.tolist() for x in columns]
    np.testing.assert_array_equal(brf(listed), brf(columns))


def test_grazing_reflectances_below_zero_are_reported():
    """Four streams, no correction, sun and view 87 degrees from the vertical: -0.6, as CDISORT."""
    layer = np.full(1, 0.2), np.full(1, 0.9), 0.85 ** np.arange(65.0)[None]
    padded = [np.pad(x, [(0, 4)] + [(0, 0)] * (x.ndim - 1)) for x in layer]
    azimuths = np.linspace(0, np.pi, MANY)
    columns = [np.tile(x, (MANY,) + (1,) * np.ndim(x)) for x in (*padded, 0.0, 0.05, 0.05)]
    with on_double_gauss():
        result = brf((*columns, azimuths), num_doublings=None, single_scattering=None)
    assert result[0] < -0.5
    expected = [cdisort_brf(*layer, 0.0, 0.05, 0.05, azimuth, 4, False) for azimuth in azimuths]
    np.testing.assert_allclose(result, expected, rtol=1e-8)


@pytest.mark.slow
def test_128_streams():
    """As CDISORT at as many, and nearly as half of them; the correction needs no more moments."""
    columns = simple_columns(count=1, num_layers=3, num_moments=257)
    with on_double_gauss():
        many, fewer = (brf(columns, num_streams=n)[0] for n in (128, 64))
    column = [np.array(x[0]) for x in columns[:3]] + [float(x[0]) for x in columns[3:]]
    np.testing.assert_allclose(many, cdisort_brf(*column, 128, True), rtol=1e-8)
    # What quadrature by 64 streams leaves of smooth phase functions.
    np.testing.assert_allclose(fewer, many, rtol=1e-6)


def test_backscatter_is_where_relative_azimuth_is_zero():
    """A backward-peaked layer is brightest with sun and satellite on the same side."""
    tau, ssa = np.array([0.2, 0, 0, 0, 0]), np.ones(5)
    moments = np.broadcast_to((-0.6) ** np.arange(65), (5, 65))
    same, opposite = (brf((tau, ssa, moments, 0.0, 0.6, 0.6, azimuth)) for azimuth in (0.0, np.pi))
    assert same > 2 * opposite


def test_exact_phase_function_equals_a_long_enough_series():
    tau, ssa, _, albedo, mu0, mu, azimuth = standard_columns(MANY)
    g = 0.6
    angle = -mu * mu0 - np.sqrt((1 - mu**2) * (1 - mu0**2)) * np.cos(azimuth)
    phase = np.repeat(((1 - g**2) / (1 + g**2 - 2 * g * angle) ** 1.5)[:, None], 5, axis=1)
    long = np.broadcast_to(g ** np.arange(65), (MANY, 5, 65))
    summed = brf((tau, ssa, long, albedo, mu0, mu, azimuth))
    given = brf((tau, ssa, long[..., :5], albedo, mu0, mu, azimuth), phase_function=phase)
    np.testing.assert_allclose(summed, given, rtol=1e-11)


@pytest.mark.parametrize(
    ("num_streams", "fewer"), [(4, (1, 2)), pytest.param(8, (1, 3, 6), marks=pytest.mark.slow)]
)
def test_few_modes_leave_the_exact_single_scattering_alone(num_streams, fewer):
    """A thin layer scatters once, so that one mode is as good as all; a thick one needs more."""
    tau, *rest = standard_columns()
    rest[2] = np.zeros(4)  # black ground
    thin, thick = (1e-9 * tau, *rest), (tau, *rest)
    options = {"num_streams": num_streams}
    np.testing.assert_allclose(brf(thin, num_modes=1, **options), brf(thin, **options), rtol=1e-6)
    whole = brf(thick, **options)
    errors = [np.abs(brf(thick, num_modes=m, **options) / whole - 1).max() for m in fewer]
    assert all(more > 10 * less for more, less in pairwise(errors))


def test_the_first_mode_is_the_mean_over_azimuths():
    """Light scattered once, the same with all modes and with one, drops out of the difference."""
    tau, ssa, moments, albedo, mu0, mu, _ = (np.repeat(x, 4, axis=0) for x in standard_columns(2))
    azimuth = np.tile(np.pi * np.arange(4) / 2, 2)
    columns = tau, ssa, moments, albedo, mu0, mu, azimuth
    higher = (brf(columns) - brf(columns, num_modes=1)).reshape(2, 4)
    assert np.all(np.ptp(higher, axis=1) > 1e-4)
    np.testing.assert_allclose(higher.mean(axis=1), 0, atol=1e-14)


def test_moment_zero_is_one_whatever_is_given():
    tau, ssa, moments, *rest = standard_columns()
    other = moments.copy()
    other[..., 0] = 7
    np.testing.assert_array_equal(brf((tau, ssa, other, *rest)), brf((tau, ssa, moments, *rest)))


@pytest.mark.float32
def test_float32_in_float32_out_and_near_float64():
    columns = [np.asarray(x, np.float32) for x in simple_columns(count=50)]
    single = brf(columns)
    assert single.dtype == np.float32
    with jax.enable_x64(True):
        double = brf([np.asarray(x, np.float64) for x in columns])
    # Some thousand roundings of 6e-8 each, mostly of random sign.
    np.testing.assert_allclose(single, double, rtol=1e-4)


def test_float32_never_computes_in_float64():
    columns = [jnp.asarray(x, jnp.float32) for x in standard_columns()]
    program = jax.jit(lambda *a: toa_brf(*a, num_streams=4, num_doublings=1)).lower(*columns)
    assert "f64" not in program.as_text()


def test_other_float_types_are_promoted_together():
    columns = standard_columns()
    mixed = [np.asarray(columns[0], np.float32), *columns[1:]]
    assert brf(mixed).dtype == jnp.result_type(float)
    layers, others = columns[:3], columns[4:]
    single = [np.asarray(x, np.float32) for x in (*layers, *others)]
    # A Python number follows the arrays.
    found = jax.eval_shape(lambda *x: toa_brf(*x[:3], 0.1, *x[3:], **STANDARD), *single)
    assert found.dtype == jnp.float32
    half = [np.asarray(x, np.float16) for x in single]
    found = jax.eval_shape(lambda *x: toa_brf(*x[:3], 0.1, *x[3:], **STANDARD), *half)
    assert found.dtype == jnp.float32


def shared(dtype="float32", **changed):
    """Three columns of one layer, of two streams."""
    given = {
        "tau": np.full((3, 1), 0.3, dtype),
        "ssa": np.full((3, 1), 0.5, dtype),
        "moments": np.asarray([[1, 0.5, 0.1]], dtype),
        "albedo": np.asarray(0.1, dtype),
        "mu0": np.asarray(0.5, dtype),
        "mu": np.asarray(0.6, dtype),
        "relative_azimuth": np.asarray(1, dtype),
        "phase_function": np.ones(1, dtype),
    }
    return given | changed


def of_shared(num_doublings=2, **options):
    return toa_brf(**options, num_streams=2, num_doublings=num_doublings)


def test_python_numbers_follow_the_arrays_under_transformations():
    """They are arrays of JAX there, of double precision; alone they have the usual one."""
    given = shared()

    def of_albedo(albedo):
        found = of_shared(**given | {"albedo": albedo})
        assert found.dtype == jnp.float32
        return jnp.sum(found)

    jax.eval_shape(jax.grad(of_albedo), 0.3)
    jax.eval_shape(of_albedo, jnp.asarray(0.3))
    numbers = jax.eval_shape(lambda: of_shared(**jax.tree.map(as_full, given)))
    assert numbers.dtype == jnp.result_type(float)
    plane = {name: given[name] for name in ("tau", "ssa", "moments", "albedo", "mu0")}
    found = jax.eval_shape(lambda: toa_albedo(**jax.tree.map(as_full, plane), num_streams=2))
    assert found.dtype == jnp.result_type(float)


def as_full(x):
    """Zeros without a type of their own."""
    return jnp.full(x.shape, 0.0)


@pytest.mark.parametrize("dtype", [jnp.bfloat16, np.complex128, np.longdouble])
def test_other_types_are_refused(dtype):
    """By name, where they have no floating type in common with the others."""
    if np.dtype(dtype) == np.float64:
        pytest.skip("long double is double here")
    message = f"mu0 is of the type {np.dtype(dtype)}; allowed are .* up to 64 bits"
    with pytest.raises(TypeError, match=message):
        of_shared(**shared(mu0=np.asarray(0.5, dtype)))


def test_layers_and_views_are_as_many_as_any_argument_has():
    """Others are stretched."""
    given = shared() | {"secant": np.asarray([2.0, 2.1, 2.2], np.float32)}
    column = aligned_alone(given, multiple_views=False)
    layers = column.tau, column.ssa, column.moments, column.secant, column.phase_function
    assert [len(x) for x in layers] == [3] * 5
    angles = {name: given[name][None] for name in ("mu", "relative_azimuth")}
    of_views = given | angles | {"phase_function": np.ones((1, 5), np.float32)}
    found = jax.eval_shape(lambda: of_shared(**of_views, multiple_views=True))
    assert found.shape == (3, 5)
    column = aligned_alone(of_views, multiple_views=True)
    assert column.phase_function.shape == (3, 5, 1)
    assert column.mu.shape == column.relative_azimuth.shape == (5, 1)


def aligned_alone(given, multiple_views):
    """The first column, with an axis for the batch."""
    one = given | {name: given[name][0] for name in ("tau", "ssa")}
    return aligned(jax.tree.map(lambda x: x[..., None], promoted(**one)), multiple_views)


def test_all_scattered_light_goes_straight_on():
    """Where every moment is 1 a layer only absorbs; slopes are finite."""
    given = shared("float64", moments=np.ones((1, 3)), phase_function=np.zeros(1))
    total, slopes = jax.value_and_grad(lambda given: jnp.sum(of_shared(**given)))(given)
    wanted = 3 * 0.1 * np.exp(-0.5 * 0.3 * (1 / 0.5 + 1 / 0.6))
    np.testing.assert_allclose(total, wanted, rtol=ROUNDING)
    assert all(np.all(np.isfinite(x)) for x in slopes.values())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"num_streams": 7}, "num_streams must be even and at least 2; got 7"),
        ({"num_streams": 40}, "need at least 41 moments .* got 33"),
        ({"num_modes": 9, "num_streams": 8}, "num_modes must be 1 to num_streams = 8; got 9"),
        ({"single_scattering": "ims"}, "must be 'tms' or None; got 'ims'"),
        ({"num_doublings": -1}, "num_doublings must be 0 or more; got -1"),
    ],
)
def test_bad_options_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        toa_brf(*simple_columns(), **change)


def test_bad_shapes_are_refused():
    tau, ssa, moments, *rest = standard_columns()
    with pytest.raises(ValueError, match="same number of layers"):
        toa_brf(tau[:, :3], ssa, moments, *rest)
    with pytest.raises(ValueError, match="do not broadcast"):
        toa_brf(tau[:3], ssa, moments, *rest)
    with pytest.raises(ValueError, match="layer axis"):
        toa_brf(0.1, ssa, moments, *rest)
