"""Derivatives of the solver: finite, the same forward and backward, and right."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from columns import hard_columns, simple_columns

from abi_operator.solver import toa_brf

INPUTS = ("tau", "ssa", "moments", "albedo", "mu0", "mu", "relative_azimuth")
# The two sweeps round differently; each sums some 1e4 products.
MODES_AGREE = 1e-10
# Central differences of step h err by h^2 / 6 times a third derivative and by rounding / h.
STEP, DIFFERENCES_AGREE = 1e-5, 1e-6


def solver(num_doublings=5, **options):
    def function(*arguments):
        return toa_brf(*arguments, num_streams=8, num_doublings=num_doublings, **options)

    return function


def gradients(function, arguments):
    """Derivative of every column's value in its own inputs (columns do not mix)."""
    return jax.grad(lambda *a: jnp.sum(function(*a)), argnums=tuple(range(7)))(*arguments)


@pytest.mark.parametrize("scattering", ["tms", None])
def test_reverse_equals_forward_and_differences(scattering):
    arguments = [jnp.asarray(x) for x in simple_columns()]
    function = jax.jit(solver(single_scattering=scattering))
    reverse = gradients(function, arguments)
    forward = jax.jit(lambda a, t: jax.jvp(function, a, t)[1])
    rng = np.random.default_rng(0)
    for k, name in enumerate(INPUTS):
        direction = rng.normal(size=arguments[k].shape)
        tangents = [jnp.zeros_like(x) for x in arguments]
        tangents[k] = jnp.asarray(direction)
        slope = forward(tuple(arguments), tuple(tangents))
        columns = (len(slope), -1)
        backward = np.sum(np.reshape(reverse[k] * direction, columns), axis=1)
        np.testing.assert_allclose(slope, backward, rtol=MODES_AGREE, atol=1e-14, err_msg=name)
        plus, minus = ([*arguments] for _ in range(2))
        plus[k] = arguments[k] + STEP * direction
        minus[k] = arguments[k] - STEP * direction
        difference = (function(*plus) - function(*minus)) / (2 * STEP)
        scale = np.abs(reverse[k]).reshape(columns).max(axis=1)
        np.testing.assert_array_less(np.abs(slope - difference), DIFFERENCES_AGREE * scale, name)


def test_finite_and_equal_in_both_modes_at_every_hard_place():
    names, arguments = hard_columns()
    arguments = [jnp.asarray(x) for x in arguments]
    function = solver(num_doublings=13)
    value, pull_back = jax.vjp(function, *arguments)
    reverse = pull_back(jnp.ones_like(value))
    assert np.all(np.isfinite(value)), dict(zip(names, value, strict=True))
    rng = np.random.default_rng(1)
    tangents = tuple(jnp.asarray(rng.normal(size=x.shape)) for x in arguments)
    forward = jax.jvp(function, tuple(arguments), tangents)[1]
    backward = 0
    for name, gradient, tangent in zip(INPUTS, reverse, tangents, strict=True):
        per_column = np.reshape(gradient, (len(names), -1))
        broken = [n for n, g in zip(names, per_column, strict=True) if not np.isfinite(g).all()]
        assert not broken, f"derivative in {name} is not finite for: {broken}"
        backward = backward + np.sum(per_column * np.reshape(tangent, per_column.shape), axis=1)
    np.testing.assert_allclose(forward, backward, rtol=MODES_AGREE)


def test_second_derivatives_reverse_over_forward():
    arguments = [jnp.asarray(x[0]) for x in simple_columns(num_layers=2, num_moments=17)]

    def slope(albedo):
        point = [*arguments]
        point[3] = albedo
        tangents = [jnp.zeros_like(x) for x in point]
        tangents[0] = jnp.ones_like(point[0])
        return jax.jvp(solver(num_doublings=3), tuple(point), tuple(tangents))[1]

    curvature = jax.grad(slope)(arguments[3])
    difference = (slope(arguments[3] + STEP) - slope(arguments[3] - STEP)) / (2 * STEP)
    np.testing.assert_allclose(curvature, difference, rtol=1e-6)


def test_vmap_of_value_and_gradient_equals_the_batch():
    arguments = [jnp.asarray(x) for x in simple_columns()]
    function = solver()
    np.testing.assert_allclose(jax.vmap(function)(*arguments), function(*arguments), rtol=1e-13)
    single = jax.vmap(jax.grad(function, argnums=tuple(range(7))))(*arguments)
    for mapped, batch in zip(single, gradients(function, arguments), strict=True):
        np.testing.assert_allclose(mapped, batch, rtol=1e-10, atol=1e-14)
