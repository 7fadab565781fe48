"""Derivatives of the solver: finite, the same forward and backward, and through transformations."""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from columns import hard_columns, simple_columns

from abi_operator.solver import toa_brf

INPUTS = ("tau", "ssa", "moments", "albedo", "mu0", "mu", "relative_azimuth")
ALL = tuple(range(len(INPUTS)))
# The two sweeps round differently; each sums some 1e4 products.
MODES_AGREE = 1e-10
# Central differences of step h err by h^2 / 6 times a third derivative and by rounding / h.
STEP, DIFFERENCES_AGREE = 1e-5, 1e-6


def solver(num_streams=8, num_doublings=5, **options):
    def function(*arguments):
        return toa_brf(*arguments, num_streams=num_streams, num_doublings=num_doublings, **options)

    return function


def small_columns(count=3):
    """Two layers at two streams: programs that transform the solver twice compile fast."""
    columns = simple_columns(count=count, num_layers=2, num_moments=5)
    return [jnp.asarray(x) for x in columns], solver(num_streams=2, num_doublings=3)


def gradients(function, arguments):
    """Derivative of every column's value in its own inputs (columns do not mix)."""
    return jax.grad(lambda *a: jnp.sum(function(*a)), argnums=ALL)(*arguments)


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


def test_jacobians_and_their_vmap_agree():
    """jacfwd, jacrev and grad, over the batch and mapped over columns, are one derivative."""
    arguments, function = small_columns()
    expected = gradients(function, arguments)
    count = len(arguments[0])
    diagonal = np.arange(count)
    # Columns do not mix, so that Jacobians of the whole batch are diagonal in it.
    for jacobian in (jax.jacfwd, jax.jacrev):
        whole = jax.jit(jacobian(function, argnums=ALL))(*arguments)
        mapped = jax.jit(jax.vmap(jacobian(function, argnums=ALL)))(*arguments)
        for name, batch, one, gradient in zip(INPUTS, whole, mapped, expected, strict=True):
            scale = np.abs(gradient).max()
            close = {"rtol": MODES_AGREE, "atol": MODES_AGREE * scale, "err_msg": name}
            np.testing.assert_allclose(batch[diagonal, diagonal], gradient, **close)
            np.testing.assert_allclose(one, gradient, **close)
            others = np.array(batch)
            others[diagonal, diagonal] = 0
            np.testing.assert_array_equal(others, 0, err_msg=name)


def test_second_derivatives_in_both_orders():
    """Forward over reverse = reverse over forward = differences of the first, in all inputs."""
    (columns, function) = small_columns(count=1)
    arguments = tuple(x[0] for x in columns)
    rng = np.random.default_rng(2)
    direction = tuple(jnp.asarray(rng.normal(size=x.shape)) for x in arguments)
    gradient = jax.grad(function, argnums=ALL)

    def slope(*arguments):
        return jax.jvp(function, arguments, direction)[1]

    # Hessian times direction.
    outside_forward = jax.jit(lambda *a: jax.jvp(gradient, a, direction)[1])(*arguments)
    outside_reverse = jax.jit(jax.grad(slope, argnums=ALL))(*arguments)
    first = jax.jit(gradient)
    plus = first(*(x + STEP * d for x, d in zip(arguments, direction, strict=True)))
    minus = first(*(x - STEP * d for x, d in zip(arguments, direction, strict=True)))
    for name, ahead, back, p, m in zip(
        INPUTS, outside_forward, outside_reverse, plus, minus, strict=True
    ):
        scale = np.abs(ahead).max()
        np.testing.assert_allclose(back, ahead, rtol=0, atol=MODES_AGREE * scale, err_msg=name)
        difference = (p - m) / (2 * STEP)
        np.testing.assert_allclose(
            ahead, difference, rtol=0, atol=DIFFERENCES_AGREE * scale, err_msg=name
        )


def test_vmap_of_value_and_gradient_equals_the_batch():
    arguments, function = small_columns()
    np.testing.assert_allclose(jax.vmap(function)(*arguments), function(*arguments), rtol=1e-13)
    single = jax.vmap(jax.grad(function, argnums=ALL))(*arguments)
    for mapped, batch in zip(single, gradients(function, arguments), strict=True):
        np.testing.assert_allclose(mapped, batch, rtol=1e-10, atol=1e-14)


# A retrieval in small: the optical depth of the upper layer and the albedo of the ground from the
# reflectances in three directions.
VIEWS = jnp.array([0.35, 0.6, 0.9])


def retrieval(count=4):
    """Residuals of one column, with the truth and a first guess for each of `count` columns."""
    (tau, ssa, moments, albedo, mu0, _, azimuth), function = small_columns(count)
    tau = jnp.stack([jnp.linspace(0.1, 0.6, count), tau[:, 1]], axis=1)
    fixed = (tau[:, 1], ssa, moments, mu0, azimuth)

    def reflectances(x, fixed):
        below, ssa, moments, mu0, azimuth = fixed
        tau = jnp.stack([jnp.exp(x[0]), below])
        return function(tau, ssa, moments, x[1], mu0, VIEWS, azimuth)

    truth = jnp.stack([jnp.log(tau[:, 0]), albedo], axis=1)
    measured = jax.vmap(reflectances)(truth, fixed)
    guess = jnp.stack([jnp.full(count, jnp.log(0.25)), jnp.full(count, 0.4)], axis=1)
    return lambda x, args: reflectances(x, args[0]) - args[1], (fixed, measured), truth, guess


@pytest.mark.parametrize("jacobian", [jax.jacfwd, jax.jacrev])
def test_batched_gauss_newton_in_a_while_loop(jacobian):
    """Columns that need more steps than others keep the loop running for all."""
    residuals, args, truth, guess = retrieval()

    def solve(x, args):
        def unfinished(carry):
            x, step, count = carry
            return (jnp.max(jnp.abs(step)) > 1e-10) & (count < 30)

        def advance(carry):
            x, _, count = carry
            slope = jacobian(residuals)(x, args)
            step = -jnp.linalg.solve(slope.T @ slope, slope.T @ residuals(x, args))
            return x + jnp.clip(step, -0.5, 0.5), step, count + 1

        return jax.lax.while_loop(unfinished, advance, (x, jnp.ones_like(x), 0))

    found, _, counts = jax.jit(jax.vmap(solve))(guess, args)
    assert len(set(counts.tolist())) > 1
    # Rounding of the reflectances, 1e-15, times the condition of the normal equations.
    np.testing.assert_allclose(found, truth, atol=1e-9)


def test_optimistix_levenberg_marquardt_with_its_defaults_under_vmap():
    residuals, args, truth, guess = retrieval()
    optimiser = optx.LevenbergMarquardt(rtol=1e-10, atol=1e-10)

    def solve(x, args):
        return optx.least_squares(residuals, optimiser, x, args).value

    np.testing.assert_allclose(jax.jit(jax.vmap(solve))(guess, args), truth, atol=1e-7)
