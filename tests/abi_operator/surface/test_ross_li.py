"""Kernels of vegetation against NumPy, constants of the MODIS product, corners and derivatives."""

import jax
import jax.numpy as jnp
import numpy as np

from abi_operator.surface import RossLi, directional_albedo
from abi_operator.surface.ross_li import BLACK_SKY_GEOMETRIC, BLACK_SKY_VOLUME, bent, kernels

ROUNDING = 1e-12
CUT = float(np.cos(np.deg2rad(80.0)))
JITTED = jax.jit(kernels)


def numpy_kernels(zenith_in, zenith_out, azimuth):
    """The kernels as printed by Lucht et al. (2000), h/b = 2 and b/r = 1. [rad]"""
    cos_i, cos_v = np.cos(zenith_in), np.cos(zenith_out)
    tan_i, tan_v = np.tan(zenith_in), np.tan(zenith_out)
    cos_xi = cos_i * cos_v + np.sin(zenith_in) * np.sin(zenith_out) * np.cos(azimuth)
    xi = np.arccos(np.clip(cos_xi, -1, 1))
    volume = ((np.pi / 2 - xi) * np.cos(xi) + np.sin(xi)) / (cos_i + cos_v) - np.pi / 4
    square = tan_i**2 + tan_v**2 - 2 * tan_i * tan_v * np.cos(azimuth)
    square = np.maximum(square, 0) + (tan_i * tan_v * np.sin(azimuth)) ** 2
    secants = 1 / cos_i + 1 / cos_v
    t = np.arccos(np.clip(2 * np.sqrt(square) / secants, -1, 1))
    overlap = (t - np.sin(t) * np.cos(t)) * secants / np.pi
    geometric = overlap - secants + 0.5 * (1 + cos_xi) / (cos_i * cos_v)
    return volume, geometric


def random_directions(count=400, lowest=80.0):
    rng = np.random.default_rng(2)
    zenith = np.deg2rad(rng.uniform(0, lowest, (2, count)))
    return *zenith, rng.uniform(0, np.pi, count)


def kernel_grounds():
    """The two kernels by themselves."""
    zero, one = jnp.asarray(0.0), jnp.asarray(1.0)
    return RossLi(zero, one, zero), RossLi(zero, zero, one)


def test_kernels_against_numpy():
    zenith_in, zenith_out, azimuth = random_directions()
    result = JITTED(*(jnp.asarray(x) for x in (np.cos(zenith_out), np.cos(zenith_in), azimuth)))
    for found, expected in zip(result, numpy_kernels(zenith_in, zenith_out, azimuth), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=ROUNDING)


def test_kernels_by_hand():
    """Sun and view in the zenith; the hot spot; two directions a right angle apart."""
    half = np.sqrt(0.5)
    mu_out, mu_in, azimuth = jnp.asarray([[1, 1, 0], [0.5, 0.5, 0], [half, half, np.pi]]).T
    volume, geometric = JITTED(mu_out, mu_in, azimuth)
    # xi = 0: pi / 2 over the sum of cosines; xi = pi / 2: sin xi = 1 alone.
    expected = [0, np.pi / 4, 1 / np.sqrt(2) - np.pi / 4]
    np.testing.assert_allclose(volume, expected, atol=ROUNDING)
    # Hot spot: O is half the sum of the secants, 2, and with it 2 - 4 + 4; right angle: cos t would
    # be sqrt 2, so that O = 0: -2 sqrt 2 + 1.
    np.testing.assert_allclose(geometric, [0, 2, 1 - 2 * np.sqrt(2)], atol=ROUNDING)


def test_white_sky_constants_are_the_kernels_integrals():
    """Of the kernels as they are, without a limit near the horizon: to the 1e-4 of the product."""
    x, weight = np.polynomial.legendre.leggauss(80)
    zenith, azimuth = np.pi / 4 * (1 + x), np.pi / 2 * (1 + x)
    into, out, turn = np.meshgrid(zenith, zenith, azimuth, indexing="ij")
    share = weight * np.pi / 4 * np.sin(2 * zenith)
    for kernel, expected in zip(numpy_kernels(into, out, turn), (0.189184, -1.377622), strict=True):
        found = np.einsum("i,j,k,ijk", share, share, weight / 2, kernel)
        np.testing.assert_allclose(found, expected, rtol=0, atol=2e-4)
    for ground, expected in zip(kernel_grounds(), (0.189184, -1.377622), strict=True):
        assert ground.white_sky_albedo() == expected
    assert RossLi(*(jnp.asarray(x) for x in (0.3, 0.0, 0.0))).white_sky_albedo() == 0.3


def test_the_limit_near_the_horizon_hardly_moves_the_white_sky_albedo():
    x, weight = np.polynomial.legendre.leggauss(16)
    mu = jnp.asarray((1 + x) / 2)
    for ground in kernel_grounds():
        found = np.sum(weight * mu * jax.jit(directional_albedo)(ground, mu))
        # 3 % of isotropic light is within 10 degrees of the horizon; measured: 0.0034 and 0.0057.
        np.testing.assert_allclose(found, ground.white_sky_albedo(), rtol=0, atol=0.006)


def test_black_sky_polynomials():
    """Their figures, and that they follow the kernels' integrals as well as they were fitted."""
    sun = np.deg2rad(np.arange(0, 80, 5.0))
    tables = (BLACK_SKY_VOLUME, BLACK_SKY_GEOMETRIC)
    for ground, table in zip(kernel_grounds(), tables, strict=True):
        c0, c2, c3 = table
        found = ground.black_sky_albedo(jnp.cos(jnp.asarray(sun)))
        np.testing.assert_allclose(found, c0 + c2 * sun**2 + c3 * sun**3, rtol=1e-12)
        integral = jax.jit(directional_albedo)(ground, jnp.cos(jnp.asarray(sun)))
        # Weights of 0.1 and 0.02, as of most land, make 0.002 of both.
        tolerance = 0.021 if table is BLACK_SKY_VOLUME else 0.11
        np.testing.assert_allclose(found, integral, rtol=0, atol=tolerance)


def test_black_sky_has_a_slope_at_the_zenith():
    ground = kernel_grounds()[0]
    value = jax.jit(lambda mu: ground.black_sky_albedo(mu))
    slope = jax.jit(jax.grad(lambda mu: ground.black_sky_albedo(mu)))
    # d s^2 / d mu = -2 s / sin s.
    np.testing.assert_allclose(slope(jnp.asarray(1.0)), 2 * 0.070987, rtol=1e-12)
    step = 1e-6
    mu = jnp.asarray(0.6)
    ends = (value(mu + d) for d in (step, -step))
    difference = np.subtract(*ends) / (2 * step)
    np.testing.assert_allclose(slope(mu), difference, rtol=1e-8)


def test_the_limit_is_smooth():
    mu = jnp.asarray([0.0, 0.5 * CUT, CUT, 0.5, 1.0])
    np.testing.assert_allclose(bent(mu), [CUT / 2, 0.625 * CUT, CUT, 0.5, 1], rtol=1e-15)
    slope = jax.jit(jax.vmap(jax.grad(bent)))
    sides = slope(jnp.asarray([CUT * (1 - 1e-9), CUT * (1 + 1e-9)]))
    np.testing.assert_allclose(sides, 1, rtol=1e-8)
    np.testing.assert_array_equal(slope(jnp.asarray([0.0])), 0)
    # Finite on the horizon, where the kernels themselves are not.
    assert np.all(np.isfinite(JITTED(jnp.asarray(0.0), jnp.asarray(0.0), jnp.asarray(1.0))))


def test_reciprocal(make_ground):
    rng = np.random.default_rng(3)
    mu_out, mu_in = (jnp.asarray(x) for x in rng.uniform(0.01, 1, (2, 300)))
    azimuth = jnp.asarray(rng.uniform(0, np.pi, 300))
    ground = make_ground("ross_li", (300,))

    @jax.jit
    def one_way(mu_out, mu_in):
        return ground.brdf(mu_out, mu_in, azimuth), ground.modes(3, mu_out, mu_in)

    for there, back in zip(one_way(mu_out, mu_in), one_way(mu_in, mu_out), strict=True):
        np.testing.assert_allclose(there, back, rtol=1e-12, atol=1e-14)


def test_modes_against_dense_quadrature():
    nodes = jnp.asarray([0.02, 0.1, 0.24, 0.41, 0.59, 0.76, 0.9, 0.98, 1.0])
    mu_out, mu_in = nodes[:, None], nodes[None]
    count, orders = 5000, jnp.asarray([0, 1, 7, 15])
    azimuth = np.pi * (np.arange(count) + 0.5) / count
    cosines = np.cos(np.asarray(orders)[:, None] * azimuth) / count
    dense = JITTED(mu_out[None], mu_in[None], jnp.asarray(azimuth)[:, None, None])
    modes = jax.jit(jax.vmap(lambda ground, m: ground.modes(m, mu_out, mu_in), in_axes=(None, 0)))
    for ground, kernel in zip(kernel_grounds(), dense, strict=True):
        expected = np.einsum("mk,kij->mij", cosines, kernel)
        # The edge of the shadows' overlap is not smooth; the kernels reach 40 and more.
        np.testing.assert_allclose(modes(ground, orders), expected, rtol=0, atol=1e-3)


def test_without_kernels_it_is_lambertian():
    ground = RossLi(jnp.asarray([0.2, 0.4]), jnp.zeros(2), jnp.zeros(2))
    mu = jnp.full((3, 2), 0.3)
    brdf, mean, first = jax.jit(
        lambda ground: (ground.brdf(mu, mu, mu), *(ground.modes(m, mu, mu) for m in (0, 1)))
    )(ground)
    np.testing.assert_array_equal(brdf, [[0.2, 0.4]] * 3)
    np.testing.assert_array_equal(mean, brdf)
    np.testing.assert_array_equal(first, 0)


def test_derivatives_in_angles_against_differences():
    zenith_in, zenith_out, azimuth = random_directions(50, 88.0)
    inputs = tuple(jnp.asarray(x) for x in (np.cos(zenith_out), np.cos(zenith_in), azimuth))
    step = 1e-6
    # The limit's second derivative jumps at 80 degrees, the overlap's where it ends.
    slopes_along = jax.jit(lambda *x: jax.jvp(kernels, x[:3], x[3:])[1])
    for i in range(3):
        direction = [np.full(50, float(i == j)) for j in range(3)]
        up, down = (
            JITTED(*(x + sign * step * d for x, d in zip(inputs, direction, strict=True)))
            for sign in (1, -1)
        )
        slopes = slopes_along(*inputs, *direction)
        for a, b, slope in zip(up, down, slopes, strict=True):
            difference = (a - b) / (2 * step)
            np.testing.assert_allclose(slope, difference, rtol=1e-4, atol=1e-6)


def test_derivatives_are_finite_in_the_corners(corners):
    # Single precision, which leaves its range first.
    inputs = tuple(jnp.asarray(x, jnp.float32) for x in corners)

    def totals(*inputs):
        return jnp.stack([jnp.sum(kernel) for kernel in kernels(*inputs)])

    forward, reverse = (
        jax.jit(mode(totals, argnums=(0, 1, 2))) for mode in (jax.jacfwd, jax.jacrev)
    )
    assert all(np.all(np.isfinite(kernel)) for kernel in JITTED(*inputs))
    for a, b in zip(forward(*inputs), reverse(*inputs), strict=True):
        assert np.all(np.isfinite(b))
        np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-4)


def test_the_hot_spot_is_a_cusp_and_its_derivative_the_mean_of_both_sides():
    mu, at = jnp.asarray(0.6), jnp.asarray(0.0)
    slope = jax.jit(jax.grad(lambda turn: kernels(mu, mu, turn)[1]))
    assert slope(at) == 0
    # A straight fall: from 1e-7 rad to 1e-3 rad the slope changes by as much as the angle.
    slopes = [float(slope(jnp.asarray(turn))) for turn in (1e-7, 1e-3, -1e-3)]
    assert slopes[0] < -1
    np.testing.assert_allclose(slopes[1:], [slopes[0], -slopes[0]], rtol=5e-3)


def test_float32_stays_and_is_near():
    zenith_in, zenith_out, azimuth = random_directions()
    inputs = (np.cos(zenith_out), np.cos(zenith_in), azimuth)
    single = JITTED(*(jnp.asarray(x, jnp.float32) for x in inputs))
    for found, expected in zip(single, numpy_kernels(zenith_in, zenith_out, azimuth), strict=True):
        assert found.dtype == jnp.float32
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)
    ground = RossLi(*(jnp.asarray(x, jnp.float32) for x in (0.2, 0.1, 0.03)))
    mu = jnp.asarray([0.3, 0.8], jnp.float32)
    assert jax.eval_shape(lambda: ground.modes(jnp.asarray(2), mu, mu)).dtype == jnp.float32
    assert jax.eval_shape(ground.black_sky_albedo, mu).dtype == jnp.float32
