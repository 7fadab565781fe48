"""The solver's parts on their own: quadrature, Legendre functions, bordered matrices, layers."""

from decimal import Decimal, localcontext

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator._numerics import safe_divide, safe_sqrt
from abi_operator.machine.algebra import Entry, fenced, matmul
from abi_operator.machine.batching import map_tiles
from abi_operator.machine.elimination import inverse, solve
from abi_operator.solver import double_gauss, half_range, on_double_gauss, sufficient_doublings
from abi_operator.solver.method.bordered import Bordered, Vector
from abi_operator.solver.method.delta_m import delta_m
from abi_operator.solver.method.doublings import (
    _REACH,
    Doublings,
    layer_doublings,
    start_coefficient,
    unknown_doublings,
)
from abi_operator.solver.method.ground import isotropic
from abi_operator.solver.method.layer import half_layer
from abi_operator.solver.method.legendre import associated_legendre, legendre_series
from abi_operator.solver.method.quotient import minus_and_quotient, minus_quotient
from abi_operator.solver.method.refinement import refined
from abi_operator.solver.method.single_scatter import exact_single_scattering
from abi_operator.solver.skipping.heat import emissivities

REACH_ERROR = 2e-12  # what `doublings` promises, and rounding


@pytest.mark.parametrize("num_streams", [2, 8, 32])
def test_double_gauss_integrates_polynomials(num_streams):
    mu, weight = double_gauss(num_streams)
    for power in range(num_streams):
        np.testing.assert_allclose(np.sum(weight * mu**power), 1 / (power + 1), rtol=1e-13)


@pytest.mark.parametrize("num_streams", [2, 4, 8, 32, 128])
def test_nodes_integrate_what_energy_needs_and_a_logarithm(num_streams):
    mu, weight = half_range(num_streams)
    assert (0 < mu).all() and (mu < 1).all() and (np.diff(mu) > 0).all() and (weight > 0).all()
    for power in range(max(2, num_streams - 1)):
        np.testing.assert_allclose(np.sum(weight * mu**power), 1 / (power + 1), rtol=1e-13)
    if num_streams == 2:
        return
    gauss, its_weight = double_gauss(num_streams)
    own, its = (w @ (x**2 * np.log(x)) + 1 / 9 for x, w in ((mu, weight), (gauss, its_weight)))
    assert abs(own) <= 1e-3 * abs(its) + 1e-15


def test_nodes_of_others_are_used_while_asked_for():
    own = half_range(8)[0]
    with on_double_gauss():
        np.testing.assert_array_equal(half_range(8)[0], double_gauss(8)[0])
        with on_double_gauss():
            pass
        np.testing.assert_array_equal(half_range(8)[0], double_gauss(8)[0])
    np.testing.assert_array_equal(half_range(8)[0], own)


def test_legendre_functions_satisfy_the_addition_theorem():
    mu, other, azimuth = 0.3, 0.8, 1.1
    p = np.asarray(jax.jit(lambda x: associated_legendre(12, 12, x))(jnp.asarray([mu, other])))
    series = [
        sum((2 - (m == 0)) * p[m, l, 0] * p[m, l, 1] * np.cos(m * azimuth) for m in range(12))
        for l in range(12)  # noqa: E741
    ]
    cosine = mu * other + np.sqrt((1 - mu**2) * (1 - other**2)) * np.cos(azimuth)
    expected = [np.polynomial.legendre.Legendre.basis(k)(cosine) for k in range(12)]
    np.testing.assert_allclose(series, expected, rtol=1e-12, atol=1e-14)
    constants = associated_legendre(12, 12, np.array([mu, other]))
    np.testing.assert_allclose(constants, p, rtol=1e-13, atol=1e-15)


def test_legendre_series_sums_henyey_greenstein():
    g, cosine = 0.5, 0.2
    total = legendre_series(jnp.asarray(g ** np.arange(80.0))[None], jnp.asarray([cosine]))
    expected = (1 - g**2) / (1 + g**2 - 2 * g * cosine) ** 1.5
    np.testing.assert_allclose(total[0, 0], expected, rtol=1e-13)


def test_delta_m_leaves_absorption_and_mean_forward_scattering_alone():
    """tau (1 - omega) and tau (1 - omega g), and the co-albedo below rounding of 1 - omega."""
    rng = np.random.default_rng(4)
    tau, ssa = rng.uniform(0, 9, (3, 5)), rng.uniform(0, 1, (3, 5))
    ssa[0] = 1 - 1e-15
    g = rng.uniform(-0.5, 0.95, (3, 5))
    moments = g[:, None] ** np.arange(9.0)[None, :, None]
    scaled = jax.jit(delta_m, static_argnums=3)(tau, ssa, moments, 8)
    scaled = jax.tree.map(np.asarray, scaled)
    np.testing.assert_allclose(scaled.tau * scaled.coalbedo, tau * (1 - ssa), rtol=1e-14)
    np.testing.assert_allclose(
        scaled.tau * (1 - scaled.ssa * scaled.moments[:, 1]), tau * (1 - ssa * g), rtol=1e-13
    )
    np.testing.assert_allclose(scaled.ssa, 1 - scaled.coalbedo, rtol=1e-13)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_delta_m_where_all_light_goes_straight_on(dtype):
    """Such a layer absorbs and scatters nothing, whatever its albedo; its slopes are finite."""
    ssa = np.asarray([0, 0.5, 1], dtype)
    given = np.full_like(ssa, 2), ssa, np.ones((3, 3), dtype)

    def scaled(*arrays):
        layers = delta_m(*arrays, 2)
        scatters = (layers.tau * layers.ssa)[:, None] * layers.moments
        return layers.tau, scatters, layers.tau * layers.coalbedo, layers.scattering_ratio

    tau, scatters, absorbs, ratio = jax.jit(scaled)(*given)
    rounding = 4 * np.finfo(dtype).eps
    np.testing.assert_allclose(tau, [2, 1, 0], atol=rounding)
    np.testing.assert_allclose(scatters, 0, atol=rounding)
    np.testing.assert_allclose(absorbs, [2, 1, 0], atol=rounding)
    np.testing.assert_allclose(ratio[:2], [0, 1], rtol=rounding)
    # Light scattered once is that of the layer as it is given, where nothing absorbs too.
    np.testing.assert_allclose(tau * ratio, ssa * given[0], rtol=rounding)
    forward, reverse = (
        jax.jit(jacobian(scaled, argnums=(0, 1, 2)))(*given)
        for jacobian in (jax.jacfwd, jax.jacrev)
    )
    for one, other in zip(jax.tree.leaves(forward), jax.tree.leaves(reverse), strict=True):
        assert one.dtype == dtype and np.all(np.isfinite(one))
        np.testing.assert_allclose(one, other, rtol=rounding, atol=rounding)
    np.testing.assert_allclose(np.diagonal(forward[0][2][..., 2]), -2 * ssa, rtol=rounding)


def test_bordered_matrices_act_on_light_without_a_sun():
    rng = np.random.default_rng(2)
    a, b = random_bordered(rng), random_bordered(rng)
    vector = Vector(jnp.asarray(rng.normal(size=3)), jnp.asarray(rng.normal(size=2)))
    # With the sun as a view, which its symmetric kind allows, the matrix is this one.
    plain = np.append(vector.nodes, vector.beams)

    @jax.jit
    def actions(a, b, vector):
        _, quotient = minus_and_quotient([(1.0, a)], jnp.ones(()), a, b, a)
        return a @ vector, quotient.transposed_action(vector)

    direct, through = (np.append(*leaves(x)) for x in actions(a, b, vector))
    np.testing.assert_allclose(direct, as_views(a) @ plain, rtol=1e-12)
    expected = as_views(a) @ np.linalg.inv(as_views(b)) @ plain
    np.testing.assert_allclose(through, expected, rtol=1e-12)


def leaves(vector):
    return vector.nodes, vector.beams


def as_views(matrix):
    """The matrix over (nodes, beams) with every beam fed by the nodes and feeding nothing."""
    n = matrix.core.shape[0]
    full = np.zeros((n + 2, n + 2))
    full[:n, :n], full[n:, :n] = matrix.core, matrix.border.T
    full[[n, n + 1], [n, n + 1]] = matrix.diagonal
    return full


def random_bordered(rng, nodes=3, batch=()):
    core = rng.normal(size=(nodes, nodes, *batch))
    core = np.einsum("ik...,jk...->ij...", core, core) + 3 * np.eye(nodes).reshape(
        nodes, nodes, *(1,) * len(batch)
    )
    parts = (
        rng.normal(size=(nodes, 2, *batch)),
        rng.uniform(1, 2, (2, *batch)),
        rng.normal(size=(1, *batch)),
    )
    return Bordered(*(jnp.asarray(x) for x in (core, *parts)))


def dense(matrix):
    """The matrix over (nodes, sun, view)."""
    n = matrix.core.shape[0]
    full = np.zeros((n + 2, n + 2))
    full[:n, :n], full[:n, n] = matrix.core, matrix.border[:, 0]
    full[n, n], full[n + 1, n + 1] = matrix.diagonal
    full[n + 1, :n], full[n + 1, n] = matrix.border[:, 1], matrix.corner[0]
    return full


@pytest.mark.parametrize("nodes", [1, 2, 3, 8, 17])  # each way a product is computed
def test_bordered_algebra_is_matrix_algebra(nodes):
    rng = np.random.default_rng(0)
    a, b, c = (random_bordered(rng, nodes) for _ in range(3))
    factor = jnp.asarray(0.7)

    @jax.jit
    def algebra(a, b, c):
        return (
            a.inverse(),
            2.0 * a - b,
            minus_quotient([(2.0, c), (factor, a)], factor, a, b, a),
            minus_quotient([(1.0, c)], factor, a, b, c),
        )

    inverted, combined, with_itself, with_another = (dense(x) for x in algebra(a, b, c))
    np.testing.assert_allclose(inverted, np.linalg.inv(dense(a)), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(combined, 2 * dense(a) - dense(b))
    # The views' rows are found like the sun's column, right where the product is symmetric as
    # everywhere in the solver: here for left = right, where both factors are of symmetric kind.
    symmetric = dense(a) @ np.linalg.inv(dense(b)) @ dense(a)
    expected = 2 * dense(c) + 0.7 * dense(a) - 0.7 * symmetric
    np.testing.assert_allclose(with_itself, expected, rtol=1e-12, atol=1e-13)
    expected = dense(c) - 0.7 * dense(a) @ np.linalg.inv(dense(b)) @ dense(c)
    np.testing.assert_allclose(with_another[:, nodes], expected[:, nodes], rtol=1e-12, atol=1e-13)
    core = np.s_[:nodes, :nodes]
    np.testing.assert_allclose(with_another[core], expected[core], rtol=1e-12, atol=1e-13)


def test_kernels_read_the_same_alone_and_in_a_batch():
    rng = np.random.default_rng(1)
    batch = random_bordered(rng, batch=(5,)), random_bordered(rng, batch=(5,))
    tau = rng.uniform(0, 2, 5)
    admittance = jax.jit(lambda *x: half_layer(*x, doublings_of_a_layer(2))[0].core)
    together = np.asarray(admittance(*batch, tau))
    for i in range(5):
        a, b = (jax.tree.map(lambda x, i=i: jnp.asarray(np.asarray(x)[..., i]), m) for m in batch)
        np.testing.assert_allclose(admittance(a, b, tau[i]), together[..., i], rtol=1e-12)


@pytest.mark.parametrize("n", [1, 2, 3, 5, 8])
def test_inverse_of_positive_definite_matrices(n):
    rng = np.random.default_rng(n)
    root = rng.normal(size=(n, n, 7))
    a = np.einsum("ikb,jkb->ijb", root, root) + np.eye(n)[..., None]
    identity = np.broadcast_to(np.eye(n)[..., None], a.shape)
    product = jax.jit(lambda a: matmul(a, inverse(a)))(a)
    np.testing.assert_allclose(product, identity, atol=1e-12)


@pytest.mark.parametrize(
    "n", [1, 2, 3, 12, *(pytest.param(n, marks=pytest.mark.slow) for n in (6, 8))]
)
def test_quotients_of_positive_definite_matrices(n):
    """By halves of halves, and their derivative, which is written out, against differences."""
    rng = np.random.default_rng(n)
    root, change = rng.normal(size=(2, n, n, 7))
    a = np.einsum("ikb,jkb->ijb", root, root) + np.eye(n)[..., None]
    rights = [rng.normal(size=(n, columns, 7)) for columns in (n, 2)]
    da = change + np.swapaxes(change, 0, 1)

    @jax.jit
    def along(step):
        return [x.joined() for x in solve(a + step * da, [r * (1 + step) for r in rights])]

    found, slopes = jax.jit(lambda step: jax.jvp(along, (step,), (1.0,)))(0.0)
    for x, right in zip(found, rights, strict=True):
        np.testing.assert_allclose(np.einsum("ijb,jkb->ikb", a, x), right, atol=1e-11)
    ends = (map(np.asarray, along(step)) for step in (1e-5, -1e-5))
    for slope, above, below in zip(slopes, *ends, strict=True):
        scale = np.abs(slope).max()  # differences of 1e-5 are right to 1e-10 of what they divide
        np.testing.assert_allclose(slope, (above - below) / 2e-5, atol=1e-6 * scale)


@pytest.mark.parametrize("n", [2, 3, 5, 8, 10, 16])
def test_a_small_eigenvalue_does_not_round_what_lies_across(n):
    """Of 1 beside 1e5, in single precision: of an inverse rounding of the one were as large."""
    rng = np.random.default_rng(n)
    along = rng.uniform(0.2, 1, (n, 9))
    along = along / np.linalg.norm(along, axis=0)
    ones = along[:, None] * along[None]
    others = np.eye(n)[..., None] - ones
    across = np.einsum("ijb,jkb->ikb", others, rng.normal(size=(n, 3, 9)))
    a, right = (np.asarray(x, np.float32) for x in (1e5 * others + ones, across))
    found = np.asarray(jax.jit(lambda a, r: solve(a, [r])[0].joined())(a, right), float)
    found = 1e5 * np.einsum("ijb,jkb->ikb", others, found)
    np.testing.assert_allclose(found, across, atol=1e-5)  # an inverse: 6e-4 and more


def test_quotients_are_right_along_isotropic_light():
    """Where S is 1e-5 along it and 1 across: what elimination leaves there is 1e5 roundings."""
    rng = np.random.default_rng(4)
    nodes, columns = 3, 9
    one = np.asarray(isotropic(2 * nodes, jnp.ones((2, columns))).nodes)
    along = one[:, None] * one[None] / np.sum(one**2, axis=0)
    others = np.eye(nodes)[..., None] - along
    mixed = rng.normal(size=(nodes, nodes, columns))
    mixed = np.einsum("ijb,jkb,lkb->ilb", others, mixed, mixed)
    across = np.einsum("ijb,jkb->ikb", mixed, others)
    borders = np.einsum("ijb,jkb->ikb", others, rng.normal(size=(nodes, 2, columns)))
    little = rng.uniform(1, 2, (2, columns))

    def matrix(core, little, border):
        core = core + 1e-5 * little * along
        border = border + (1e-5 * little - 1) * one[:, None] / np.sum(one**2, axis=0)
        own = np.ones((2, columns))
        return Bordered(*(jnp.asarray(x) for x in (core, border, own, own[1:])))

    middle = matrix(others, little[0], borders)
    right = matrix(across, little[1], 0.5 * borders)
    acted = [x @ isotropic(2 * nodes, jnp.ones((2, columns))) for x in (middle, right)]

    @jax.jit
    def found(middle, right, acted):
        _, plain = minus_and_quotient([(1.0, right)], right.corner[0], right, middle, right)
        better = refined(plain, *acted)
        return [(x.core.joined(), x.border.joined()) for x in (plain, better)]

    exact, _ = found(middle, right, acted)
    single = jax.tree.map(lambda x: x.astype(jnp.float32), (middle, right, acted))
    for plain, better, x in zip(*found(*single), exact, strict=True):
        wrong = [np.abs(np.asarray(y, float) - x).max() / np.abs(x).max() for y in (plain, better)]
        assert wrong[1] < 1e-6 < 1e-4 < wrong[0]


def test_an_entry_of_a_stack_is_read_by_the_kernel_it_is_given_to():
    """Forward and reverse mode and `jax.vmap` reach the stack through it."""
    stack = jnp.asarray(np.random.default_rng(5).uniform(1, 2, (3, 8)))
    factor = jnp.asarray([1.0, 2.0])

    def scaled(stack, place):
        return fenced(lambda x, y: x * y)(Entry(stack, place, (2, 2, 2)), factor)

    expected = np.asarray(stack).reshape(3, 2, 2, 2) * np.asarray(factor)
    places = jnp.arange(3)
    np.testing.assert_array_equal(jax.vmap(scaled, (None, 0))(stack, places), expected)
    slope = jax.grad(lambda x: jnp.sum(scaled(x, places[1])))(stack)
    np.testing.assert_array_equal(slope, [np.zeros(8), np.tile(factor, 4), np.zeros(8)])
    change = jax.jvp(lambda x: scaled(x, places[2]), (stack,), (jnp.ones_like(stack),))[1]
    np.testing.assert_array_equal(change, np.broadcast_to(factor, (2, 2, 2)))


def test_map_tiles_fills_up_the_last_tile():
    x = jnp.arange(14.0).reshape(2, 7)
    np.testing.assert_array_equal(map_tiles(lambda a: 2 * a, x, 3), 2 * x)
    np.testing.assert_array_equal(map_tiles(lambda a: 2 * a, x, 7), 2 * x)


def test_safe_functions_have_values_and_slopes_where_others_do_not():
    zero = jnp.zeros(())
    assert jax.value_and_grad(safe_sqrt)(zero) == (0, 0)
    value, slopes = jax.value_and_grad(safe_divide, argnums=(0, 1))(zero + 1, zero)
    assert value == 0 and slopes == (0, 0)
    assert safe_divide(zero + 6, zero + 3) == 2


def test_more_doublings_for_thicker_layers_and_lower_sun():
    assert sufficient_doublings(0.005, 0.5, 8) == 4
    assert sufficient_doublings(1e5, 1e-3, 8) <= 14
    steps = [sufficient_doublings(t, 0.3, 8) for t in (0.01, 1, 30, 1e3, 1e6)]
    assert steps == sorted(steps)
    for num_streams in (2, 16, 128):  # at 128 streams the smallest cosine is below 1e-3
        assert unknown_doublings(num_streams) >= sufficient_doublings(1e5, 1e-3, num_streams)
        assert sufficient_doublings(1e5, 1e-3, num_streams) <= 15
        # In single precision the start of a thick layer has no digits left.
        single = sufficient_doublings(1e5, 1e-3, num_streams, np.float32)
        assert 0.5 * 1e5 / 1e-3 / 2**single <= 45
    assert sufficient_doublings(30, 0.02, 8, np.float32) == sufficient_doublings(30, 0.02, 8)


def test_each_layer_is_doubled_as_its_thickest_column_needs():
    """A column that is not finite makes no others double, nor does one layer the others."""
    smallest = half_range(8)[0][0]
    tau = np.full((6, 3), 1e-9)
    tau[:5, 1] = 2 * smallest * np.array([0.9 * _REACH[0], 1.1 * _REACH[0], 1.0, 200, 1e38])
    tau[5] = np.nan, np.inf, 1e-9
    secants, low = np.ones((2, 6, 3)), np.ones((2, 6, 3))
    low[1] = 1e3
    chosen = jax.jit(lambda *x: layer_doublings(*x, 8, None).numbers)
    numbers, grazing = (np.asarray(chosen(tau, x)) for x in (secants, low))
    np.testing.assert_array_equal(numbers[:, 0], [0, 1, 4, 5, 64, 0])
    np.testing.assert_array_equal(numbers[:, 1], 0.5 / 2 ** numbers[:, 0])
    assert np.all(grazing[:5, 0] >= numbers[:5, 0]) and grazing[3, 0] == 7


def doublings_of_a_layer(number):
    return Doublings(jnp.asarray([number, 0.5 / 2**number, start_coefficient(number)]), number)


HALF_LAYER = jax.jit(lambda a, p, tau, numbers: half_layer(a, p, tau, Doublings(numbers, None)))


UNIT = np.ones((1, 1, 50)), np.zeros((1, 2, 50)), np.ones((2, 50)), np.zeros((1, 50))


@pytest.mark.parametrize("doublings", range(7))
def test_half_layer_is_tanh_up_to_the_reach_of_its_doublings(doublings):
    """One node with a = b = 1: admittance tanh(h), impedance h coth(h), h = tau / 2."""
    reach = _REACH[doublings] if doublings < 5 else _REACH[4] * 4 ** (doublings - 4)
    tau = 2 * reach * np.linspace(1e-3, 1, 50)
    unit = Bordered(*map(jnp.asarray, UNIT))
    numbers = doublings_of_a_layer(doublings).numbers
    admittance, impedance = HALF_LAYER(unit, unit, tau, numbers)
    h = np.asarray(tau) / 2
    for found, exact in ((admittance, np.tanh(h)), (impedance, h / np.tanh(h))):
        for entry in (np.asarray(found.core)[0, 0], np.asarray(found.diagonal)[0]):
            np.testing.assert_allclose(entry, exact, rtol=REACH_ERROR)


@pytest.mark.parametrize(("dtype", "digits"), [(np.float64, 1e-14), (np.float32, 3e-6)])
def test_thermal_light_of_thin_layers_keeps_its_digits(dtype, digits):
    """From next to nothing to opaque, also about where a series takes over."""
    x = np.concatenate([[0], 10.0 ** np.arange(-12, 3), np.linspace(0.04, 0.06, 9), [1e30]])
    x = x.astype(dtype)
    with localcontext(prec=120):
        exact = [Decimal(float(value)) for value in x]
        some = [value if value else Decimal("1e-30") for value in exact]
        wanted = [(1 - (-v).exp()) / v - (-v).exp() for v in some]
        # x slope = exp(-x) (1 + x) - (1 - exp(-x)) / x + x exp(-x), by hand, over x
        slopes = [((-v).exp() * (v * v + v + 1) - 1) / (v * v) for v in some]
    found = jax.jit(lambda x: emissivities(x)[2])(x)
    assert found.dtype == dtype
    np.testing.assert_allclose(found, np.array(wanted, float), rtol=digits, atol=1e-29)
    one, tangent = jnp.asarray(x), jnp.ones_like(x)
    of_all = jax.jit(lambda x: jax.jvp(emissivities, (x,), (tangent,))[1])(one)
    by_reverse = jax.jit(jax.grad(lambda x: jnp.sum(emissivities(x)[2])))(one)
    assert all(np.all(np.isfinite(slope)) for slope in of_all)
    thin = x <= 1
    for slope in (of_all[2], by_reverse):
        assert np.all(np.isfinite(slope))
        np.testing.assert_allclose(slope[thin], np.array(slopes, float)[thin], rtol=500 * digits)


@pytest.mark.parametrize(("dtype", "digits"), [(np.float64, 1e-13), (np.float32, 2e-6)])
def test_light_scattered_once_keeps_its_digits(dtype, digits):
    """Of two layers, from the thinnest to opaque ones, also about where a series takes over."""
    depth = np.concatenate([10.0 ** np.arange(-12, 2), np.linspace(0.01, 0.03, 6)])
    tau = np.stack([depth, depth[::-1]]).astype(dtype)
    arrays = tau, np.full_like(tau, 0.9), np.ones((2, 1, 20), dtype)
    mu0, mu = np.full(20, 0.5, dtype), np.full((1, 20), 0.7, dtype)
    sun = np.full_like(tau, 2)
    found = jax.jit(exact_single_scattering)(*arrays, mu0, mu, sun)
    assert found.dtype == dtype
    secant = 2 + 1 / mu[0].astype(float)
    first, second = -np.expm1(-secant * tau.astype(float))
    both = first + np.exp(-secant * tau[0].astype(float)) * second
    wanted = 0.9 * both / secant / (4 * 0.5 * mu[0].astype(float))
    np.testing.assert_allclose(found[0], wanted, rtol=digits)
