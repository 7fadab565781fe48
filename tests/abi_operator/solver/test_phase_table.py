"""Tables of phase functions: accuracy, ends, derivatives, moments, mixtures."""

from functools import cache

import jax
import jax.numpy as jnp
import miepython
import numpy as np
import pytest

from abi_operator.solver import cos_scattering_angle
from abi_operator.solver.phase_table import (
    interpolate_phase_function,
    mix_moments,
    mix_phase_functions,
    moments_of_table,
    normalise_table,
)

ASYMMETRY = 0.86
ROUNDING = 1e-12  # float64, of tables between 0.04 and 100
# Relative, in float32: the angle is rounded to 1e-7, and so is its node; the forward peak changes
# by a factor e within 0.1.
ROUNDING_32 = 2e-5


def degrees(step):
    return np.linspace(0, np.pi, round(180 / step) + 1)


def henyey_greenstein(cosine, g=ASYMMETRY):
    return (1 - g**2) / (1 + g**2 - 2 * g * cosine) ** 1.5


@cache
def interpolation(angles, **options):
    grid = np.array(angles)
    return jax.jit(lambda t, c: interpolate_phase_function(t, grid, c, **options))


def interpolated(table, grid, cosine, **options):
    """`interpolate_phase_function` as one program for all that is alike in shape; one operation at
    a time compiles for longer."""
    return interpolation(tuple(grid), **options)(table, cosine)


MIXED = jax.jit(mix_phase_functions, static_argnames="multiple_views")


@cache
def droplets(num_sizes=700, num_terms=420):
    """Phase function of water droplets every 0.05 degrees: 0.64 um, gamma distribution."""
    wavelength, effective_radius, variance = 0.64, 10.0, 0.1
    radius = np.linspace(0.1, 3.5, num_sizes) * effective_radius
    number = radius ** (1 / variance - 3) * np.exp(-radius / (effective_radius * variance))
    radius, number = (x[number > 1e-7 * number.max()] for x in (radius, number))
    a, b = np.zeros((2, len(radius), num_terms), complex)
    for i, r in enumerate(radius):
        for series, found in zip(
            (a, b),
            miepython.an_bn(1.331 - 1.5e-8j, 2 * np.pi * r / wavelength, 0)[:2],
            strict=True,
        ):
            series[i, : len(found)] = found
    angle = degrees(0.05)
    pi, tau = np.zeros((2, num_terms + 1, angle.size))
    pi[1] = 1
    for n in range(1, num_terms + 1):
        if n > 1:
            pi[n] = ((2 * n - 1) * np.cos(angle) * pi[n - 1] - n * pi[n - 2]) / (n - 1)
        tau[n] = n * np.cos(angle) * pi[n] - (n + 1) * pi[n - 1]
    n = np.arange(1, num_terms + 1)
    a, b = (series * (2 * n + 1) / (n * (n + 1)) for series in (a, b))
    intensity = number @ (abs(a @ pi[1:] + b @ tau[1:]) ** 2 + abs(a @ tau[1:] + b @ pi[1:]) ** 2)
    return intensity / (np.trapezoid(intensity * np.sin(angle), angle) / 2)


@cache
def from_every(every):
    """At angles every 0.05 degrees, from a table at every n-th of them; one program for each n."""
    angle = degrees(0.05)
    return jax.jit(
        lambda t: interpolate_phase_function(t, angle[::every], jnp.asarray(np.cos(angle)))
    )


def largest_error(exact, every, transform=np.array, back=np.array):
    """Relative error of a table of every n-th value, between all of them."""
    table = jnp.asarray(transform(exact[None, ::every]))
    found = from_every(every)(table)
    return np.max(np.abs(back(found[:, 0]) / exact - 1))


# As the docstring prints them, to one digit.
PRINTED = {0.1: (2e-9, 2e-5), 0.2: (3e-8, 6e-4), 0.5: (2e-6, 4e-2), 1.0: (3e-5, 7e-1)}
LAST_DIGIT = 0.3


@pytest.mark.parametrize("step", PRINTED)
def test_errors_are_those_of_the_docstring(step):
    every = round(step / 0.05)
    exact = henyey_greenstein(np.cos(degrees(0.05)))
    errors = largest_error(exact, every), largest_error(droplets(), every)
    np.testing.assert_allclose(errors, PRINTED[step], rtol=LAST_DIGIT)
    if step <= 0.2:
        exact = henyey_greenstein(np.cos(degrees(0.05)))
        in_logarithm = [largest_error(p, every, np.log, np.exp) for p in (exact, droplets())]
        ratio = np.array(errors) / in_logarithm
        assert 2 <= ratio[0] <= 3 and 1 / 2.2 <= ratio[1] <= 1 / 1.5


def test_error_falls_with_the_fourth_power_of_the_spacing():
    exact = henyey_greenstein(np.cos(degrees(0.05)), g=0.5)
    errors = [largest_error(exact, every) for every in (80, 40, 20)]
    order = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all(order > 3.9)


def uneven_grid():
    rng = np.random.default_rng(5)
    inner = degrees(1.0)[1:-1] + rng.uniform(-0.006, 0.006, 179)
    return np.concatenate([[0], inner, [np.pi]])


def test_nodes_are_met_on_an_uneven_grid():
    grid = uneven_grid()
    table = henyey_greenstein(np.cos(grid))
    found = interpolated(jnp.asarray(table[None]), grid, jnp.asarray(np.cos(grid)))
    np.testing.assert_allclose(found[:, 0], table, rtol=ROUNDING)
    middle = np.cos((grid[1:] + grid[:-1]) / 2)
    found = interpolated(jnp.asarray(table[None]), grid, jnp.asarray(middle))
    # Intervals are up to 1.7 degrees wide: the docstring's 3e-5 times 1.7^4.
    np.testing.assert_allclose(found[:, 0], henyey_greenstein(middle), rtol=3e-4)


def test_slope_is_continuous_at_nodes():
    grid = uneven_grid()
    table = jnp.asarray(np.random.default_rng(0).uniform(1, 2, (1, 181)))

    def value(angle):
        return interpolate_phase_function(table, grid, jnp.cos(angle))[0]

    slope = jax.jit(jax.vmap(jax.grad(value)))
    inner, off = jnp.asarray(grid[1:-1]), 1e-9
    # Slopes are some 100, curvatures some 1e4.
    np.testing.assert_allclose(slope(inner + off), slope(inner - off), atol=1e-4)


@pytest.mark.float32
@pytest.mark.parametrize("cosine", [-1.0, 1.0, -1.0 - 1e-7, 1.0 + 1e-7])
def test_ends_are_stationary_in_cosine(cosine):
    grid = degrees(1.0)
    table = jnp.asarray(henyey_greenstein(np.cos(grid)), jnp.float32)

    def value(c):
        return interpolate_phase_function(table[None], grid, c)[0]

    found, slope = jax.value_and_grad(value)(jnp.asarray(cosine, jnp.float32))
    # A float32 step beyond 1 is rounded to 1 or taken as it.
    assert found == table[0 if cosine > 0 else -1] and slope == 0
    assert jax.jvp(value, (jnp.float32(cosine),), (jnp.float32(1),))[1] == 0


def test_slope_is_right_next_to_the_ends():
    """dP/dcos is -P'' at 0 and +P'' at pi, for a table of cos(2 Theta): 4 and -4."""
    grid = degrees(0.5)
    table = jnp.asarray(np.cos(2 * grid))[None]

    def value(c):
        return interpolate_phase_function(table, grid, c)[0]

    gradient = jax.jit(jax.grad(value))
    for sign in (1, -1):
        for distance in (1e-15, 1e-12, 1e-9, 1e-6):
            # Cubics through a cosine have its curvature to (2 h)^2 / 12; cos near pi is known to
            # 1e-16, its angle to 4e-16.
            rounding = 1e-15 / np.sqrt(distance)
            slope = gradient(jnp.asarray(sign * (1 - distance)))
            np.testing.assert_allclose(slope, 4 * sign, rtol=1e-4 + 4 * rounding)


def test_exact_backscatter_is_stationary_in_every_direction():
    grid = degrees(0.5)
    table = jnp.asarray(henyey_greenstein(np.cos(grid), g=-0.8))[None]

    def value(mu0, mu, azimuth):
        return interpolate_phase_function(table, grid, cos_scattering_angle(mu0, mu, azimuth))[0]

    mu0 = jnp.asarray([0.3, 0.5, 0.77, 1.0])
    slopes = jax.jit(jax.vmap(jax.grad(value, argnums=(0, 1, 2))))(mu0, mu0, jnp.zeros(4))
    # Where the cosine comes out a rounding away from -1 its own slope is one of 1e-16.
    for slope in slopes:
        np.testing.assert_allclose(slope, 0, atol=1e-11)


def test_derivatives_are_those_of_central_differences():
    grid = uneven_grid()
    rng = np.random.default_rng(2)
    table, cosine = rng.uniform(1, 2, (2, 181)), rng.uniform(-0.9, 0.9, 5)
    values = interpolation(tuple(grid))
    tangents = rng.normal(size=(2, 181)), rng.normal(size=5)
    forward = np.asarray(jax.jvp(values, (table, cosine), tangents)[1])
    step = 1e-6
    ahead, behind = (
        values(*(x + sign * step * t for x, t in zip((table, cosine), tangents, strict=True)))
        for sign in (1, -1)
    )
    # Curvature in the cosine is some 1e4, its jumps at nodes as much.
    np.testing.assert_allclose(forward, (ahead - behind) / (2 * step), rtol=1e-5, atol=1e-5)
    weight = rng.normal(size=forward.shape)
    pulled = jax.vjp(values, table, cosine)[1](jnp.asarray(weight))
    both = sum(np.sum(np.asarray(p) * t) for p, t in zip(pulled, tangents, strict=True))
    np.testing.assert_allclose(both, np.sum(weight * forward), rtol=1e-12)


def test_linear_in_the_table():
    grid, rng = uneven_grid(), np.random.default_rng(4)
    a, b = rng.uniform(0, 3, (2, 1, 181))
    cosine = rng.uniform(-1, 1, 50)
    p, q, both = (np.asarray(interpolated(t, grid, cosine)) for t in (a, b, 2 * a - b))
    np.testing.assert_allclose(both, 2 * p - q, rtol=ROUNDING, atol=ROUNDING)


def test_axes():
    grid, rng = degrees(5.0), np.random.default_rng(6)
    shared, own = rng.uniform(1, 2, (3, 37)), rng.uniform(1, 2, (4, 3, 37))
    cosine = rng.uniform(-1, 1, (4, 2))
    by_view = interpolated(own, grid, cosine, multiple_views=True)
    assert by_view.shape == (4, 3, 2)
    for view in range(2):
        found = interpolated(own, grid, cosine[:, view])
        np.testing.assert_allclose(found, by_view[..., view], rtol=1e-15)
    for column in range(4):
        one = interpolated(own[column], grid, cosine[column, 0])
        np.testing.assert_allclose(one, by_view[column, :, 0], rtol=1e-15)
    assert jax.eval_shape(interpolation(tuple(grid)), shared, cosine).shape == (4, 2, 3)
    mapped = jax.jit(jax.vmap(lambda t, c: interpolate_phase_function(t, grid, c)))
    np.testing.assert_allclose(mapped(own, cosine[:, 0]), by_view[..., 0], rtol=1e-14)


@pytest.mark.float32
def test_float32_stays_float32_and_near():
    grid = degrees(0.5)
    table = henyey_greenstein(np.cos(grid))
    cosine = np.cos(np.random.default_rng(7).uniform(0, np.pi, 200)).astype(np.float32)
    single = jnp.asarray(table, jnp.float32)[None]
    found = jax.jit(lambda t, c: interpolate_phase_function(t, grid, c))(single, cosine)
    assert found.dtype == jnp.float32
    # 2e-6 is the table's own error.
    np.testing.assert_allclose(
        found[:, 0], henyey_greenstein(cosine.astype(np.float64)), rtol=2e-6 + ROUNDING_32
    )
    moments = moments_of_table(single[0], grid, 65)
    assert moments.dtype == jnp.float32
    np.testing.assert_allclose(moments, ASYMMETRY ** np.arange(65), atol=2e-6)
    jaxpr = jax.make_jaxpr(lambda t, c: interpolate_phase_function(t, grid, c))(single, cosine)
    assert "f64" not in str(jaxpr)


def test_moments_are_those_of_the_interpolant():
    """Even where the table is coarse: integrals by 200 Gauss points in every interval."""
    grid = np.array([0, 0.1, 0.5, 0.6, 1.4, 2.2, 3.0, np.pi])
    table = jnp.asarray(np.random.default_rng(8).uniform(0.5, 2, 8))
    x, weight = np.polynomial.legendre.leggauss(200)
    half = np.diff(grid)[:, None] / 2
    angle = (grid[:-1, None] + half * (1 + x)).ravel()
    measure = (half * weight).ravel() * np.sin(angle) / 2
    p = np.asarray(interpolated(table[None], grid, jnp.asarray(np.cos(angle))))[:, 0]
    expected = np.polynomial.legendre.legvander(np.cos(angle), 99).T @ (p * measure)
    # The angle comes from its cosine, to 1e-16 over its sine.
    np.testing.assert_allclose(moments_of_table(table, grid, 100), expected, atol=1e-13)


def test_moments_of_henyey_greenstein():
    for step, error in ((0.1, 2e-10), (0.5, 1e-7), (1.0, 2e-6)):
        grid = degrees(step)
        found = moments_of_table(jnp.asarray(henyey_greenstein(np.cos(grid))), grid, 129)
        np.testing.assert_allclose(found, ASYMMETRY ** np.arange(129), atol=error)


def test_moments_are_differentiable_and_batched():
    grid, rng = degrees(5.0), np.random.default_rng(9)
    tables, tangent = jnp.asarray(rng.uniform(1, 2, (2, 3, 37)))
    found, slope = jax.jvp(lambda t: moments_of_table(t, grid, 8), (tables,), (tangent,))
    assert found.shape == (3, 8)
    np.testing.assert_allclose(slope, moments_of_table(tangent, grid, 8), rtol=1e-14)
    # Sums of terms of order 1, the order of which is the compiler's.
    np.testing.assert_allclose(found[1], moments_of_table(tables[1], grid, 8), rtol=0, atol=1e-15)


def test_normalised_tables_have_mean_one():
    grid = degrees(0.5)
    tables = jnp.asarray(np.stack([droplets()[::10], 7 * henyey_greenstein(np.cos(grid))]))
    normal = normalise_table(tables, grid)
    np.testing.assert_allclose(moments_of_table(normal, grid, 1), 1, rtol=1e-15)
    # Independent of the moments' own quadrature: Gauss points of the angle in every interval.
    node, weight = np.polynomial.legendre.leggauss(12)
    half = grid[1] / 2
    angle = (grid[:-1, None] + half * (1 + node)).ravel()
    measure = np.tile(weight * half, grid.size - 1) * np.sin(angle) / 2
    p = interpolated(normal, grid, jnp.asarray(np.cos(angle)))
    np.testing.assert_allclose(measure @ p, 1, rtol=1e-6)


def test_mixture_of_phase_functions_and_moments():
    weights = jnp.asarray([[3.0, 1.0], [0.0, 2.0], [0.0, 0.0]])
    values = jnp.asarray([0.5, 2.5])
    np.testing.assert_allclose(MIXED(weights, values), [1.0, 2.5, 0.0])
    by_view = jnp.asarray([[0.5, 1.0], [2.5, 3.0]])
    mixed = MIXED(weights, by_view, multiple_views=True)
    np.testing.assert_allclose(mixed, [[1.0, 1.5], [2.5, 3.0], [0.0, 0.0]])
    moments = jnp.asarray([[1.0, 0.8, 0.6], [1.0, 0.4, 0.2]])
    np.testing.assert_allclose(
        mix_moments(weights, moments), [[1, 0.7, 0.5], [1, 0.4, 0.2], [1, 0, 0]]
    )
    batch = jnp.asarray([[0.5, 2.5], [1.0, 4.0]])
    np.testing.assert_allclose(MIXED(weights, batch)[1], [1.75, 4.0, 0.0])
    each = jax.vmap(mix_phase_functions, in_axes=(None, 0))(weights, batch)
    np.testing.assert_allclose(each, MIXED(weights, batch))


@pytest.mark.float32
@pytest.mark.parametrize("weight", [0.0, 1e-30, 1e-10, 1.0])
def test_slopes_of_mixtures_are_finite(weight):
    weights = jnp.asarray([[weight, 0.0]], jnp.float32)
    values = jnp.asarray([0.5, 2.5], jnp.float32)
    for jacobian in (jax.jacfwd, jax.jacrev):
        for slope in jacobian(mix_phase_functions, argnums=(0, 1))(weights, values):
            assert np.all(np.isfinite(slope))


@pytest.mark.parametrize(
    "grid, message",
    [
        (np.linspace(0, np.pi, 6), r"one for each entry.*shape \(6,\).*shape \(1, 5\)"),
        (np.linspace(0, 3, 5), "begin with 0 and end with pi; got 0.0 and 3.0"),
        (np.linspace(0.1, np.pi, 5), "begin with 0"),
        (np.degrees(np.linspace(0, np.pi, 5)), "got 0.0 and 180.0"),
        (np.array([0, 1, 1, 2, np.pi]), "must increase; in float32 those from index 1"),
        (np.array([0, 1, 1 + 1e-9, 2, np.pi]), "must increase; in float32 those from index 1"),
    ],
)
@pytest.mark.float32
def test_bad_angles_are_refused(grid, message):
    table = jnp.ones((1, 5), jnp.float32)
    with pytest.raises(ValueError, match=message):
        interpolate_phase_function(table, grid, jnp.ones((), jnp.float32))


def test_at_least_one_moment():
    with pytest.raises(ValueError, match="num_moments must be 1 or more; got 0"):
        moments_of_table(jnp.ones(37), degrees(5.0), 0)
