"""The derivative of thermal light, written out, against forward mode and differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiles import (
    AGREE,
    DIFFERENCES_AGREE,
    arguments,
    assert_slopes_agree,
    differences,
    direction,
    options,
    tile,
    value_and_slopes_by_forward_mode,
    value_and_slopes_of,
)

from abi_operator.solver import toa_radiance
from abi_operator.solver.program import emerging, radiance_of_one_view

# Some 1e4 products in float32, relative to the largest slope.
SINGLE = 3e-5

OPTIONS = {"num_streams": 2, "num_doublings": 2}


def plain(column, how):
    """The radiance by the program that has no derivative of its own."""
    brf, emitted = emerging(column, how)
    return (column.solar_irradiance * column.mu0 / np.pi * brf + emitted)[0]


@pytest.mark.slow  # differences, below, and forward mode of the sun's part in `test_adjoint`
@pytest.mark.parametrize(
    ("num_streams", "num_doublings", "tms", "general"),
    [
        (2, 2, True, True),
        (2, 0, False, False),
        (4, 3, False, True),
        (6, 3, True, False),
        (8, 4, True, True),
    ],
)
def test_equals_forward_mode(num_streams, num_doublings, tms, general):
    column, how = tile(num_streams, general), options(num_streams, num_doublings, tms)
    expected, slopes = value_and_slopes_by_forward_mode(plain, how)(column)
    value, ours = value_and_slopes_of(radiance_of_one_view, how)(column)
    np.testing.assert_allclose(value, expected, rtol=AGREE)
    assert_slopes_agree(ours, slopes)


NAMES = ("tau", "ssa", "moments", "albedo", "mu0", "mu", "relative_azimuth")
NAMES += ("solar_irradiance", "planck_levels", "surface_emission", "isotropic_top")
ALL = tuple(range(len(NAMES)))


def radiance(*arguments, **more):
    named = dict(zip(NAMES, arguments, strict=True))
    positions = [named.pop(name) for name in NAMES[:7]]
    return toa_radiance(*positions, **named, single_scattering=None, **OPTIONS, **more)


def total(*arguments):
    return jnp.sum(radiance(*arguments))


# Values are those that come with slopes: one program for both.
BOTH = jax.value_and_grad(total, argnums=ALL)


def gradient(*arguments):
    return [np.asarray(x) for x in BOTH(*arguments)[1]]


def test_forward_reverse_and_differences_agree():
    inputs = arguments()
    tangents = direction(inputs)
    slopes = gradient(*inputs)
    forward = jax.jvp(total, tuple(inputs), tuple(tangents))[1]
    reverse = sum(np.sum(x * np.asarray(t)) for x, t in zip(slopes, tangents, strict=True))
    np.testing.assert_allclose(forward, reverse, rtol=1e-12)
    (difference,) = differences(lambda *x: [BOTH(*x)[0]], inputs, tangents)
    np.testing.assert_allclose(forward, difference, rtol=DIFFERENCES_AGREE)


def test_an_empty_layer_is_the_limit_of_a_thin_one():
    """Although the Planck function jumps across it; all that is left is the next order in tau."""
    inputs = arguments()
    thin = [jnp.where(inputs[0] == 0, 1e-9, inputs[0]), *inputs[1:]]
    for name, empty, limit in zip(NAMES, gradient(*inputs), gradient(*thin), strict=True):
        assert np.isfinite(empty).all(), name
        np.testing.assert_allclose(empty, limit, atol=3e-8 * np.abs(limit).max(), err_msg=name)


def test_compiled_and_mapped_it_is_the_gradient_of_the_batch():
    inputs = arguments()
    mapped = jax.jit(jax.vmap(jax.grad(radiance, argnums=ALL)))(*inputs)
    for name, found, expected in zip(NAMES, mapped, gradient(*inputs), strict=True):
        atol = AGREE * np.abs(expected).max()
        np.testing.assert_allclose(found, expected, rtol=0, atol=atol, err_msg=name)


@pytest.mark.slow
def test_two_views_have_the_slopes_of_each_alone():
    inputs = arguments()
    mu, azimuth = inputs[5:7]
    views = jnp.stack([mu, inputs[4]], axis=1), jnp.stack([azimuth, 0.5 * azimuth], axis=1)

    def of_both(*inputs):
        return jnp.sum(radiance(*inputs, multiple_views=True), axis=0)

    together = jax.jacrev(of_both, argnums=ALL)(*inputs[:5], *views, *inputs[7:])
    for k in range(2):
        alone = gradient(*inputs[:5], views[0][:, k], views[1][:, k], *inputs[7:])
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
    for name, found, expected in zip(NAMES, gradient(*one), gradient(*two), strict=True):
        if name == "planck_levels":
            expected = jnp.stack([expected[:, 0], expected[:, 1] + expected[:, 2]], axis=1)
        elif found.ndim > 1:
            expected = expected[:, :1]
        atol = AGREE * np.abs(expected).max()
        np.testing.assert_allclose(found, expected, rtol=0, atol=atol, err_msg=name)


@pytest.mark.slow
def test_single_precision():
    """Finite and as accurate as the type allows, in the empty layer with its jump, too."""
    expected, slopes = BOTH(*arguments())
    value, single = BOTH(*arguments(dtype=jnp.float32))
    np.testing.assert_allclose(value, expected, rtol=1e-6)
    for name, found, right in zip(NAMES, single, slopes, strict=True):
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

    slopes = jax.grad(total, argnums=ALL)

    def along(*inputs):
        return sum(jnp.sum(x * t) for x, t in zip(slopes(*inputs), tangents, strict=True))

    if order == "forward":
        second = jax.jit(lambda *x: jax.jvp(slopes, x, tangents)[1])(*inputs)
    else:
        second = jax.jit(jax.grad(along, argnums=ALL))(*inputs)
    expected = differences(gradient, inputs, tangents)
    for name, found, difference in zip(NAMES, second, expected, strict=True):
        atol = DIFFERENCES_AGREE * (np.abs(found).max() + 1)
        np.testing.assert_allclose(found, difference, rtol=0, atol=atol, err_msg=name)
