"""Derivatives of the solver: finite everywhere, and under every transformation of JAX.

That they are right is in `test_derivative_study`.
"""

import columns
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest
from columns import SMALL, hard_columns

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
    return [jnp.asarray(x) for x in columns.small_columns(count)], solver(**SMALL)


@pytest.mark.parametrize(
    "num_streams", [4, *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 8))]
)
def test_finite_and_equal_in_both_modes_at_every_hard_place(num_streams):
    names, arguments = hard_columns(num_streams=num_streams)
    arguments = [jnp.asarray(x) for x in arguments]
    function = solver(num_streams, num_doublings=13)

    value, pull_back = jax.vjp(function, *arguments)
    value, reverse = jax.tree.map(np.asarray, (value, pull_back(jnp.ones_like(value))))
    assert np.all(np.isfinite(value)), dict(zip(names, value, strict=True))
    rng = np.random.default_rng(1)
    tangents = tuple(jnp.asarray(rng.normal(size=x.shape)) for x in arguments)
    _, forward = jax.jvp(function, tuple(arguments), tangents)
    backward = 0
    for name, gradient, tangent in zip(INPUTS, reverse, tangents, strict=True):
        per_column = np.reshape(gradient, (len(names), -1))
        broken = [n for n, g in zip(names, per_column, strict=True) if not np.isfinite(g).all()]
        assert not broken, f"derivative in {name} is not finite for: {broken}"
        backward = backward + np.sum(per_column * np.reshape(tangent, per_column.shape), axis=1)
    np.testing.assert_allclose(forward, backward, rtol=MODES_AGREE)


@pytest.mark.parametrize("jacobian", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize(
    "compiled", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["", "compiled"]
)
def test_vmap_of_jacobians_equals_the_gradient_of_the_batch(jacobian, compiled):
    """Of one column, mapped; columns of a batch do not mix.

    Compiled, forward mode is also in the loop of Gauss and Newton below, and reverse mode in
    `test_derivative`.
    """
    arguments, function = small_columns()
    jit = jax.jit if compiled else lambda f: f
    mapped = jit(jax.vmap(function))(*arguments)
    np.testing.assert_allclose(mapped, function(*arguments), rtol=1e-13)
    whole = jit(jax.grad(lambda *a: jnp.sum(function(*a)), argnums=ALL))(*arguments)
    mapped = jit(jax.vmap(jacobian(function, argnums=ALL)))(*arguments)
    for name, one, batch in zip(INPUTS, mapped, whole, strict=True):
        atol = MODES_AGREE * np.abs(batch).max()
        np.testing.assert_allclose(one, batch, rtol=MODES_AGREE, atol=atol, err_msg=name)


def test_vmap_compiled_is_the_batch():
    arguments, function = small_columns()
    mapped = jax.jit(jax.vmap(function))(*arguments)
    np.testing.assert_allclose(mapped, function(*arguments), rtol=1e-13)


@pytest.mark.parametrize(
    "order", ["forward over reverse", pytest.param("reverse over forward", marks=pytest.mark.slow)]
)
def test_second_derivatives(order):
    """Hessian times a direction, in all inputs, against differences of the gradient."""
    batch, function = small_columns(count=1)
    arguments = tuple(x[0] for x in batch)
    rng = np.random.default_rng(2)
    direction = tuple(jnp.asarray(rng.normal(size=x.shape)) for x in arguments)
    gradient = jax.grad(function, argnums=ALL)

    def slope(*arguments):
        return jax.jvp(function, arguments, direction)[1]

    if order == "forward over reverse":
        second = jax.jit(lambda *a: jax.jvp(gradient, a, direction)[1])(*arguments)
    else:
        second = jax.jit(jax.grad(slope, argnums=ALL))(*arguments)
    plus = gradient(*(x + STEP * d for x, d in zip(arguments, direction, strict=True)))
    minus = gradient(*(x - STEP * d for x, d in zip(arguments, direction, strict=True)))
    for name, result, p, m in zip(INPUTS, second, plus, minus, strict=True):
        atol = DIFFERENCES_AGREE * np.abs(result).max()
        np.testing.assert_allclose(result, (p - m) / (2 * STEP), rtol=0, atol=atol, err_msg=name)


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


@pytest.mark.slow  # optimistix's, below, maps one more loop
@pytest.mark.parametrize("jacobian", [jax.jacfwd, jax.jacrev])
def test_batched_gauss_newton_in_a_while_loop(jacobian):
    """Columns that need more steps than others keep the loop running for all."""
    residuals, args, truth, guess = retrieval()

    def twice(x, args):
        rest = residuals(x, args)
        return rest, rest

    def solve(x, args):
        def unfinished(carry):
            x, step, count = carry
            return (jnp.max(jnp.abs(step)) > 1e-10) & (count < 30)

        def advance(carry):
            x, _, count = carry
            slope, rest = jacobian(twice, has_aux=True)(x, args)
            step = -jnp.linalg.solve(slope.T @ slope, slope.T @ rest)
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
