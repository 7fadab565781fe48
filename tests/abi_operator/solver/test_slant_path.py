"""The sun's path on a sphere: limits, geometry with 50 digits, the cost of one ray for all."""

from decimal import Decimal, localcontext

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.solver.method.slant_path import slant_path_secant

RADIUS = 6371e3  # [m]
HEIGHT = np.array([60e3, 20e3, 12e3, 11.9e3, 3e3, 1e3, 250.0])  # [m]
# A dozen roundings, half of them under a root.
ROUNDINGS = 6


# As one program for all that is alike in shape.
SECANTS = jax.jit(slant_path_secant, static_argnames="radius")


def secants(height, mu0, **options):
    return SECANTS(jnp.asarray(height), jnp.asarray(mu0), **options)


def exact_secants(height, mu0):
    """Difference of distances along the ray over thickness, with 50 digits."""
    with localcontext(prec=50):
        z, cosine = [Decimal(float(x)) for x in height], Decimal(float(mu0))
        radius = Decimal(RADIUS)
        impact = (radius + z[-1]) * (1 - cosine**2).sqrt()
        along = [abs((radius + x) ** 2 - impact**2).sqrt() for x in z]
        pairs = zip(along, along[1:], z, z[1:], strict=False)
        return np.array([float((a - b) / (top - bottom)) for a, b, top, bottom in pairs])


@pytest.mark.float32
@pytest.mark.parametrize("mu0", [1.0, 0.7, 0.1, 1e-3, 0.0])
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_no_digit_is_lost(mu0, dtype):
    if dtype == "float64" and not jax.config.jax_enable_x64:
        pytest.skip("x64 is off")
    height, mu0 = HEIGHT.astype(dtype), np.asarray(mu0, dtype)
    found = secants(height, mu0)
    assert found.dtype == dtype
    np.testing.assert_allclose(
        found, exact_secants(height, mu0), rtol=ROUNDINGS * np.finfo(dtype).eps
    )


@pytest.mark.float32
def test_flat_ground_and_overhead_sun():
    mu0 = jnp.asarray([0.05, 0.5, 1.0], jnp.float32)
    height = jnp.asarray(HEIGHT, jnp.float32)
    flat = slant_path_secant(height, mu0, radius=np.inf)
    np.testing.assert_array_equal(flat, np.broadcast_to(1 / mu0[:, None], flat.shape))
    rounding = ROUNDINGS * np.finfo(np.float32).eps
    np.testing.assert_allclose(secants(height, mu0)[2], 1, rtol=rounding)


def test_horizontal_sun_sees_the_lowest_layer_as_a_chord():
    thickness = HEIGHT[-2] - HEIGHT[-1]
    ground = RADIUS + HEIGHT[-1]
    chord = np.sqrt(2 * ground * thickness + thickness**2)
    np.testing.assert_allclose(secants(HEIGHT, 0.0)[-1], chord / thickness, rtol=1e-14)


def test_empty_layers_take_the_limit():
    thin = np.array([10e3, 5e3, 5e3, 0.0, 0.0])
    s = np.asarray(secants(thin, 0.3))
    np.testing.assert_allclose(s[3], 1 / 0.3, rtol=1e-14)
    assert s[0] < s[1] < s[2] < s[3]


def test_batches_read_as_columns():
    heights = np.stack([HEIGHT, HEIGHT + 500.0])
    mu0 = np.array([0.2, 0.6])
    together = secants(heights, mu0)
    mapped = jax.vmap(SECANTS)(jnp.asarray(heights), jnp.asarray(mu0))
    np.testing.assert_allclose(mapped, together, rtol=1e-15)
    for i in range(2):
        np.testing.assert_allclose(secants(heights[i], mu0[i]), together[i], rtol=1e-15)
    assert secants(HEIGHT, mu0).shape == (2, len(HEIGHT) - 1)


@pytest.mark.float32
@pytest.mark.parametrize("mu0", [0.0, 1e-20, 1e-3, 0.5, 1.0])
def test_slopes_are_finite_in_both_modes(mu0):
    height, mu0 = jnp.asarray(HEIGHT, jnp.float32), jnp.asarray(mu0, jnp.float32)
    for jacobian in (jax.jacfwd, jax.jacrev):
        for slope in jacobian(SECANTS, argnums=(0, 1))(height, mu0):
            assert np.all(np.isfinite(slope))


def test_slopes_are_those_of_central_differences():
    # 1 m and 1e-4 leave a third derivative of 1e-8 or less and rounding of 1e-12.
    by_height, by_mu0 = jax.jacrev(SECANTS, argnums=(0, 1))(jnp.asarray(HEIGHT), jnp.asarray(0.2))
    difference = (secants(HEIGHT, 0.2 + 1e-4) - secants(HEIGHT, 0.2 - 1e-4)) / 2e-4
    np.testing.assert_allclose(by_mu0, difference, rtol=1e-5)
    for level in range(len(HEIGHT)):
        step = np.eye(len(HEIGHT))[level]
        difference = (secants(HEIGHT + step, 0.2) - secants(HEIGHT - step, 0.2)) / 2
        np.testing.assert_allclose(by_height[:, level], difference, rtol=1e-4, atol=1e-12)


def test_slope_at_a_horizontal_sun_is_one_sided():
    slope = jax.jacfwd(SECANTS, argnums=1)(jnp.asarray(HEIGHT), jnp.asarray(0.0))
    step = 1e-7
    difference = (secants(HEIGHT, step) - secants(HEIGHT, 0.0)) / step
    np.testing.assert_allclose(slope[-1], difference[-1], rtol=1e-4)  # of order step / root


SCALE_HEIGHT = 8e3  # [m]
# As the docstring prints them. These secants: path to 10 km, light scattered once; 1 / mu0: path to
# the ground, path to 10 km, light scattered once.
PRINTED = {
    60: (-0.0046, 0.00057, 0.0037, 0.0037, -0.00095),
    75: (-0.020, 0.0049, 0.017, 0.017, -0.0073),
    80: (-0.044, 0.015, 0.038, 0.037, -0.021),
    85: (-0.13, 0.085, 0.13, 0.13, -0.096),
}
LAST_DIGIT = 0.04  # half a unit of the second digit of the smallest leading digits, 1.3 and 1.5
GROUND = 2e-5  # layers of 250 m
MEAN_SECANT = 2e-4, 1.1e-4  # path to 10 km, light scattered once, both at 85 degrees


def exact_paths(height, mu0):
    """Slant over vertical: path to each level of an exponential atmosphere, in scale heights."""
    x, weight = np.polynomial.legendre.leggauss(200)
    paths = [0.0]
    for level in height[1:]:
        # Height above the level is u^2, so that the horizon's root is smooth.
        reach = np.sqrt(height[0] - level)
        u, ground = (x + 1) / 2 * reach, RADIUS + level
        along = (ground + u * u) / np.sqrt((ground * mu0) ** 2 + u * u * (2 * ground + u * u))
        density = np.exp(-(level + u * u) / SCALE_HEIGHT)
        paths.append(np.sum(weight * reach / 2 * density * along * 2 * u) / SCALE_HEIGHT)
    return np.array(paths)


def scattered_once(vertical, path):
    """Light that isotropic scattering turns to the zenith, up to a factor."""
    return np.trapezoid(np.exp(-vertical - path), vertical)


def printed_errors(zenith, optical_depth=0.3):
    height = np.linspace(100e3, 0, 401)
    mu0 = np.cos(np.radians(zenith))
    tau = np.diff(np.exp(-height / SCALE_HEIGHT))
    exact = exact_paths(height, mu0)
    s = np.asarray(secants(height, mu0))
    at_10_km = np.argmin(np.abs(height - 10e3))
    to_depth = optical_depth / tau.sum()
    vertical = np.append(0, np.cumsum(tau)) * to_depth
    errors = []
    mean = np.asarray(secants(height, mu0, tau=jnp.asarray(tau)))
    for secant in (s, 1 / mu0, mean):
        path = np.append(0, np.cumsum(secant * tau))
        once = scattered_once(vertical, path * to_depth)
        right = scattered_once(vertical, exact * to_depth)
        errors += [
            (path[-1] / exact[-1] - 1, path[at_10_km] / exact[at_10_km] - 1, once / right - 1)
        ]
    return errors


@pytest.mark.parametrize("zenith", PRINTED)
def test_errors_are_those_of_the_docstring(zenith):
    ray, flat, mean = printed_errors(zenith)
    np.testing.assert_allclose((*ray[1:], *flat), PRINTED[zenith], rtol=LAST_DIGIT)
    assert abs(ray[0]) < GROUND and abs(mean[0]) < GROUND
    assert abs(mean[1]) < MEAN_SECANT[0] and abs(mean[2]) < MEAN_SECANT[1]


def test_the_mean_secant_is_one_for_all_layers():
    tau = np.asarray([0.1, 0.0, 0.3, 0.2, 1.0, 0.4])
    own = np.asarray(secants(HEIGHT, 0.2))
    mean = secants(HEIGHT, 0.2, tau=tau)
    np.testing.assert_allclose(mean, np.full(6, np.sum(own * tau) / np.sum(tau)), rtol=1e-14)
    total = jax.jit(
        lambda t: jnp.sum(slant_path_secant(jnp.asarray(HEIGHT), jnp.asarray(0.2), tau=t))
    )
    empty, slope = jax.value_and_grad(total)(0 * tau)
    np.testing.assert_allclose(empty, np.sum(own), rtol=1e-14)
    assert np.all(np.isfinite(slope))


@pytest.mark.float32
def test_the_mean_secant_of_next_to_no_optical_depth():
    """Too little to divide by: every layer counts alike, as where there is none."""
    height, tau = jnp.asarray(HEIGHT, jnp.float32), jnp.full(6, 1e-20, jnp.float32)
    found = secants(height, jnp.float32(0.2), tau=tau)
    own = np.asarray(secants(height, jnp.float32(0.2)))
    np.testing.assert_allclose(found, np.full(6, own.mean()), rtol=1e-6)
    total = jax.jit(jax.grad(lambda t: jnp.sum(slant_path_secant(height, jnp.float32(0.2), tau=t))))
    assert np.all(np.isfinite(total(tau)))


def test_the_mean_secant_of_one_optical_depth_for_all_layers():
    one = secants(HEIGHT, 0.2, tau=np.asarray([0.3]))
    np.testing.assert_allclose(one, secants(HEIGHT, 0.2, tau=np.full(6, 0.3)), rtol=1e-14)
