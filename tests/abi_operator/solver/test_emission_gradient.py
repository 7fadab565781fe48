"""The derivative of thermal light and of fluxes against reverse mode and differences."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from columns import simple_columns
from surfaces import Bowl

from abi_operator.solver import surface_coupling, toa_albedo, toa_radiance
from abi_operator.solver.albedo import response_and_slopes
from abi_operator.solver.column import Column, Options
from abi_operator.solver.program import (
    emerging,
    ground_response,
    plane_albedo,
    radiance_of_one_view,
)

# Both ways sum some 1e4 products, in different orders; relative to a column's largest slope.
AGREE = 1e-11
# Central differences of step h err by h^2 / 6 times a third derivative and by rounding / h.
STEP, DIFFERENCES_AGREE = 1e-5, 1e-6
# Some 1e4 products in float32, the largest slope being 1.
SINGLE = 3e-5

OPTIONS = {"num_streams": 2, "num_doublings": 2}


def tile(num_streams, general=False, batch=4, num_layers=4):
    """Columns with their batch last: an empty layer across which the Planck function jumps, layers
    that scatter nothing and that absorb nothing, and a sun whose secant differs by layer."""
    rng = np.random.default_rng(num_streams)
    tau = 10 ** rng.uniform(-3, 1.5, (num_layers, batch))
    ssa = rng.uniform(0.5, 1, tau.shape)
    tau[1], ssa[2, 0], ssa[2, 1] = 0, 0, 1
    g = rng.uniform(0.2, 0.85, (num_layers, 1, batch))
    mu0, mu = rng.uniform(0.2, 0.95, (2, batch))
    albedo = rng.uniform(0.1, 0.8, batch)
    arrays = {
        "tau": tau,
        "ssa": ssa,
        "moments": g ** np.arange(num_streams + 1)[:, None],
        "mu0": mu0,
        "mu": mu[None],
        "relative_azimuth": rng.uniform(0.1, 3, (1, batch)),
        "phase_function": rng.uniform(0.5, 1.5, (num_layers, 1, batch)),
        "secant": rng.uniform(0.9, 1.1, tau.shape) / mu0,
        "planck_levels": rng.uniform(1, 9, (num_layers + 1, batch)),
        "surface_emission": rng.uniform(1, 9, batch),
        "isotropic_top": rng.uniform(0, 2, batch),
        "solar_irradiance": rng.uniform(1, 9, batch),
    }
    arrays = {name: jnp.asarray(x) for name, x in arrays.items()}
    ground = jnp.asarray(albedo)
    return Column(albedo=Bowl(ground, 0.5 * ground) if general else ground, **arrays)


def options(num_streams, num_doublings, tms):
    return Options(num_streams, num_streams, True, tms, num_doublings)


def plain(column, how):
    """The radiance by the program that has no derivative of its own."""
    brf, emitted = emerging(column, how)
    return (column.solar_irradiance * column.mu0 / np.pi * brf + emitted)[0]


@cache
def _compiled(function, how):
    @jax.jit
    def run(column):
        value, pull_back = jax.vjp(lambda column: function(column, how), column)
        return value, pull_back(jnp.ones_like(value))[0]

    return run


def assert_slopes_agree(found, expected, tolerance=AGREE):
    """Relative to the largest slope of each column."""
    found, expected = (jax.tree.map(lambda x: x if x.size else None, y) for y in (found, expected))
    leaves = jax.tree.leaves(expected)
    largest = np.max([np.abs(x).reshape(-1, x.shape[-1]).max(axis=0) for x in leaves], axis=0)
    names = [jax.tree_util.keystr(path) for path, _ in jax.tree_util.tree_leaves_with_path(found)]
    for name, slope, right in zip(names, jax.tree.leaves(found), leaves, strict=True):
        assert np.isfinite(slope).all(), name
        assert np.max(np.abs(slope - right) / largest) < tolerance, name


@pytest.mark.parametrize(
    ("num_streams", "num_doublings", "tms", "general"),
    [
        (2, 2, True, True),
        pytest.param(2, 0, False, False, marks=pytest.mark.slow),
        pytest.param(4, 3, False, True, marks=pytest.mark.slow),
        pytest.param(6, 3, True, False, marks=pytest.mark.slow),
        pytest.param(8, 4, True, True, marks=pytest.mark.slow),
    ],
)
def test_equals_reverse_mode(num_streams, num_doublings, tms, general):
    column, how = tile(num_streams, general), options(num_streams, num_doublings, tms)
    expected, slopes = _compiled(plain, how)(column)
    value, ours = _compiled(radiance_of_one_view, how)(column)
    np.testing.assert_allclose(value, expected, rtol=AGREE)
    assert_slopes_agree(ours, slopes)


@pytest.mark.slow
@pytest.mark.parametrize("num_streams", [2, 4])
def test_response_of_the_ground_equals_reverse_mode(num_streams):
    column = tile(num_streams)
    # Through opaque layers there would be little to compare.
    column = column._replace(tau=0.05 * column.tau, albedo=jnp.zeros(4))
    how = options(num_streams, 2, True)
    found, slopes = jax.jit(lambda x: response_and_slopes(x, how))(column)
    expected, pull_back = jax.vjp(jax.jit(lambda x: ground_response(x, how)), column)
    nothing = jax.tree.map(jnp.zeros_like, expected)
    for row, name in enumerate(("brf_black", "coupling", "spherical_albedo")):
        value = getattr(expected, name)
        np.testing.assert_allclose(getattr(found, name), value, rtol=AGREE)
        (right,) = pull_back(nothing._replace(**{name: jnp.ones_like(value)}))
        assert_slopes_agree(jax.tree.map(lambda x, row=row: x[row], slopes), right)


@pytest.mark.slow
@pytest.mark.parametrize("num_streams", [2, 4])
def test_plane_albedo_equals_reverse_mode(num_streams):
    """By reciprocity it is what isotropic light from above looks like from where the sun stands."""
    given, how = tile(num_streams), options(num_streams, 2, False)
    unseen = given.mu[:0]
    column = Column(*given[:5], mu=unseen, relative_azimuth=unseen)

    def plain(column, how):
        one, zero = jnp.ones_like(column.mu0), jnp.zeros_like(column.mu0)
        seen = column._replace(mu=column.mu0[None], relative_azimuth=zero[None], isotropic_top=one)
        return emerging(seen, how).emitted[0]

    expected, slopes = _compiled(plain, how)(column)
    value, ours = _compiled(plane_albedo, how)(column)
    np.testing.assert_allclose(value, expected, rtol=AGREE)
    assert_slopes_agree(ours, slopes)


def arguments(num_layers=3, count=3, dtype=float):
    """Columns and sources with the batch first; the second of several layers is empty."""
    rng = np.random.default_rng(7)
    columns = [np.array(x) for x in simple_columns(count, num_layers, num_moments=3)]
    columns[0][:, 1:2] = 0
    sources = [
        rng.uniform(1, 5, count),
        rng.uniform(1, 9, (count, num_layers + 1)),
        rng.uniform(1, 9, count),
        rng.uniform(0, 2, count),
    ]
    return [jnp.asarray(x, dtype) for x in (*columns, *sources)]


NAMES = ("tau", "ssa", "moments", "albedo", "mu0", "mu", "relative_azimuth")
NAMES += ("solar_irradiance", "planck_levels", "surface_emission", "isotropic_top")
ALL = tuple(range(len(NAMES)))


def radiance(*arguments, **more):
    named = dict(zip(NAMES, arguments, strict=True))
    positions = [named.pop(name) for name in NAMES[:7]]
    return toa_radiance(*positions, **named, single_scattering=None, **OPTIONS, **more)


def total(*arguments):
    return jnp.sum(radiance(*arguments))


GRADIENT = jax.grad(total, argnums=ALL)


def direction(inputs, seed=1):
    """Of no change in layers that are empty."""
    rng = np.random.default_rng(seed)
    found = [jnp.asarray(rng.normal(size=x.shape)) for x in inputs]
    return [jnp.where(inputs[0] == 0, 0, found[0]), *found[1:]]


def test_forward_reverse_and_differences_agree():
    inputs = arguments()
    tangents = direction(inputs)
    slopes = GRADIENT(*inputs)
    forward = jax.jvp(total, tuple(inputs), tuple(tangents))[1]
    reverse = sum(jnp.sum(x * t) for x, t in zip(slopes, tangents, strict=True))
    np.testing.assert_allclose(forward, reverse, rtol=1e-12)
    ahead, behind = (
        total(*(x + step * t for x, t in zip(inputs, tangents, strict=True)))
        for step in (STEP, -STEP)
    )
    np.testing.assert_allclose(forward, (ahead - behind) / (2 * STEP), rtol=DIFFERENCES_AGREE)


def test_an_empty_layer_is_the_limit_of_a_thin_one():
    """Although the Planck function jumps across it; all that is left is the next order in tau."""
    inputs = arguments()
    thin = [jnp.where(inputs[0] == 0, 1e-9, inputs[0]), *inputs[1:]]
    for name, empty, limit in zip(NAMES, GRADIENT(*inputs), GRADIENT(*thin), strict=True):
        assert np.isfinite(empty).all(), name
        np.testing.assert_allclose(empty, limit, atol=3e-8 * np.abs(limit).max(), err_msg=name)


def test_compiled_and_mapped_it_is_the_gradient_of_the_batch():
    inputs = arguments()
    mapped = jax.jit(jax.vmap(jax.grad(lambda *x: radiance(*x), argnums=ALL)))(*inputs)
    for name, found, expected in zip(NAMES, mapped, GRADIENT(*inputs), strict=True):
        atol = AGREE * np.abs(expected).max()
        np.testing.assert_allclose(found, expected, rtol=0, atol=atol, err_msg=name)


def test_two_views_have_the_slopes_of_each_alone():
    inputs = arguments()
    mu, azimuth = inputs[5:7]
    views = jnp.stack([mu, inputs[4]], axis=1), jnp.stack([azimuth, 0.5 * azimuth], axis=1)

    def of_both(*inputs):
        return jnp.sum(radiance(*inputs, multiple_views=True), axis=0)

    together = jax.jacrev(of_both, argnums=ALL)(*inputs[:5], *views, *inputs[7:])
    for k in range(2):
        alone = GRADIENT(*inputs[:5], views[0][:, k], views[1][:, k], *inputs[7:])
        for name, both, expected in zip(NAMES, together, alone, strict=True):
            found = both[k, :, k] if name in ("mu", "relative_azimuth") else both[k]
            atol = AGREE * np.abs(expected).max()
            np.testing.assert_allclose(found, expected, rtol=0, atol=atol, err_msg=name)


@pytest.mark.slow
def test_one_layer_alone():
    """It takes kernels of its own; an empty layer below, as warm as its end, changes nothing."""
    one = arguments(num_layers=1)
    one[0] = one[0] + 0.7
    pairs = zip(one[:3], (0, 1, 1), strict=True)
    tau, ssa, moments = (jnp.concatenate([x, weight * x], axis=1) for x, weight in pairs)
    levels = jnp.concatenate([one[8], one[8][:, 1:]], axis=1)
    two = [tau, ssa, moments, *one[3:8], levels, *one[9:]]
    np.testing.assert_allclose(radiance(*one), radiance(*two), rtol=AGREE)
    for name, found, expected in zip(NAMES, GRADIENT(*one), GRADIENT(*two), strict=True):
        if name == "planck_levels":
            expected = jnp.stack([expected[:, 0], expected[:, 1] + expected[:, 2]], axis=1)
        elif found.ndim > 1:
            expected = expected[:, :1]
        atol = AGREE * np.abs(expected).max()
        np.testing.assert_allclose(found, expected, rtol=0, atol=atol, err_msg=name)


def test_single_precision():
    """Finite and as accurate as the type allows, in the empty layer with its jump, too."""
    expected, slopes = total(*arguments()), GRADIENT(*arguments())
    single = arguments(dtype=jnp.float32)
    np.testing.assert_allclose(total(*single), expected, rtol=1e-6)
    for name, found, right in zip(NAMES, GRADIENT(*single), slopes, strict=True):
        assert found.dtype == jnp.float32
        assert np.isfinite(found).all(), name
        atol = SINGLE * np.abs(right).max()
        np.testing.assert_allclose(found, right, rtol=0, atol=atol, err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("order", ["forward", "reverse"])
def test_second_derivatives(order):
    """Change of the gradient along a direction in all inputs, against its differences."""
    inputs = tuple(arguments(num_layers=2, count=2))
    inputs = inputs[0] + 0.3, *inputs[1:]
    tangents = tuple(0.1 * x for x in direction(inputs))

    def along(*inputs):
        return sum(jnp.sum(x * t) for x, t in zip(GRADIENT(*inputs), tangents, strict=True))

    if order == "forward":
        second = jax.jit(lambda *x: jax.jvp(GRADIENT, x, tangents)[1])(*inputs)
    else:
        second = jax.jit(jax.grad(along, argnums=ALL))(*inputs)
    ahead, behind = (
        GRADIENT(*(x + step * t for x, t in zip(inputs, tangents, strict=True)))
        for step in (STEP, -STEP)
    )
    for name, found, p, m in zip(NAMES, second, ahead, behind, strict=True):
        atol = DIFFERENCES_AGREE * (np.abs(found).max() + 1)
        np.testing.assert_allclose(found, (p - m) / (2 * STEP), rtol=0, atol=atol, err_msg=name)


def test_slopes_of_fluxes_agree_with_differences():
    """Of all that doors give, weighted, along a direction in all inputs."""
    inputs = arguments()[:7]
    tangents = direction(inputs)

    def fluxes(tau, ssa, moments, albedo, mu0, mu, azimuth):
        plane = toa_albedo(tau, ssa, moments, albedo, mu0, **OPTIONS)
        response = surface_coupling(tau, ssa, moments, mu0, mu, azimuth, **OPTIONS)
        others = response.brf_black, 3 * response.coupling, 7 * response.spherical_albedo
        return jnp.sum(plane) + sum(map(jnp.sum, others))

    forward = jax.jvp(fluxes, tuple(inputs), tuple(tangents))[1]
    slopes = jax.grad(fluxes, argnums=tuple(range(7)))(*inputs)
    reverse = sum(jnp.sum(x * t) for x, t in zip(slopes, tangents, strict=True))
    np.testing.assert_allclose(forward, reverse, rtol=1e-12)
    ahead, behind = (
        fluxes(*(x + step * t for x, t in zip(inputs, tangents, strict=True)))
        for step in (STEP, -STEP)
    )
    np.testing.assert_allclose(forward, (ahead - behind) / (2 * STEP), rtol=DIFFERENCES_AGREE)
