"""One pixel, and many at once."""

from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from veil import VEIL, veiled_pixels

from retrievals import Observation, Quantity, StateVector, Unbounded, measurement
from retrievals.inverse import SOLVERS, Minimiser, invert
from retrievals.kinds import BANDS
from retrievals.pixels import retrieve_pixels
from retrievals.prior import Prior
from retrievals.quantities import replaced
from retrievals.results import ResultCode

# What a last step below the tolerance of 1e-6 leaves, times the derivative of optical depth.
CONVERGED = 1e-8


def pixel(tree, index):
    return jax.tree.map(lambda x: jnp.asarray(x[index]), tree)


@pytest.fixture(scope="module")
def retrieved(columns, forward):
    """All columns by the batch driver."""
    observation, states, _ = columns
    return retrieve_pixels(forward, observation, states, exact=True)


def test_noise_free_recovery(columns, forward, retrieved):
    truth = columns[2]
    success = retrieved.codes == ResultCode.SUCCESS
    error = np.asarray(forward.vector.values(retrieved.inversion.x)["aod_550"]) - truth
    assert success.sum() >= 10
    assert set(retrieved.codes[~success]) <= {ResultCode.NOT_OBSERVABLE}
    np.testing.assert_allclose(error, 0, atol=CONVERGED)


def test_posterior_covariance_is_that_of_the_jacobian(columns, forward, retrieved):
    observation, states, truth = columns
    x, step = forward.vector.x(truth), 1e-4
    jacobian = (forward(x + step, states) - forward(x - step, states)) / (2 * step)
    whitened = np.asarray(jacobian) / observation.sigma
    expected = 1 / np.sum(whitened**2, axis=1)
    np.testing.assert_allclose(retrieved.inversion.covariance[1], expected[[1], None], rtol=1e-6)
    np.testing.assert_allclose(retrieved.inversion.averaging_kernel[1], [[1]], rtol=1e-12)


def test_a_pixel_that_is_not_finite_fails_alone(columns, forward, retrieved):
    observation, states, _ = columns
    pressure = states.atmosphere.pressure.copy()
    pressure[2] = np.nan
    broken = replace(states, atmosphere=replace(states.atmosphere, pressure=pressure))
    values = observation.measured.copy()
    values[5] = np.nan
    values[1, 0] = np.nan  # one band of three is left out
    given = replace(observation, measured=values)
    again = retrieve_pixels(forward, given, broken, exact=True)
    assert again.codes[2] == ResultCode.NONFINITE
    assert again.codes[5] == ResultCode.INVALID_INPUT
    others = np.delete(np.arange(len(values)), [2, 5])
    np.testing.assert_array_equal(again.codes[others], retrieved.codes[others])
    np.testing.assert_allclose(
        again.inversion.x[others], retrieved.inversion.x[others], atol=CONVERGED
    )


@pytest.fixture(scope="module")
def veiled():
    """Observations, states and true optical depths of pixels under a veil."""
    return veiled_pixels()


@pytest.fixture(scope="module")
def solve():
    """`invert` of one veiled pixel, mapped over three starts."""
    mapped = jax.jit(jax.vmap(partial(invert, VEIL), in_axes=(None, None, 0, None)))
    return lambda observation, state, starts, prior=None: mapped(observation, state, starts, prior)


def test_a_batch_is_its_pixels_one_by_one(veiled, solve):
    observation, states, truth = veiled
    together = retrieve_pixels(VEIL, observation, states, exact=True)
    np.testing.assert_array_equal(together.codes, ResultCode.SUCCESS)
    for index in range(len(truth)):
        starts = VEIL.vector.x(np.array([1.2, 1.1, 0.95]) * truth[index])
        found = solve(pixel(observation, index), pixel(states, index), starts)
        assert np.all(found.converged)
        inversion = pixel(together.inversion, index)
        for k in range(len(starts)):
            one = pixel(found, k)
            np.testing.assert_allclose(one.x, inversion.x, atol=CONVERGED)
            np.testing.assert_allclose(one.covariance, inversion.covariance, rtol=1e-5)


def test_steps_can_run_out(veiled):
    observation, states, _ = veiled
    few = retrieve_pixels(VEIL, observation, states, minimiser=Minimiser(max_steps=2))
    assert set(few.codes) == {ResultCode.NOT_CONVERGED}
    assert (few.inversion.num_steps <= 2).all()


def test_a_prior_pulls_as_linear_theory_says(veiled, solve):
    """x = x_a + A (x_true - x_a), for a prior so near that the forward model is linear."""
    observation, states, truth = veiled
    x_true = np.asarray(VEIL.vector.x(truth[4]))
    with_prior = Prior(jnp.asarray(x_true + 1e-4), jnp.array([[1e-4]]))
    starts = jnp.stack([jnp.asarray(x_true)] * 3)
    solution = pixel(solve(pixel(observation, 4), pixel(states, 4), starts, with_prior), 0)
    kernel = np.asarray(solution.averaging_kernel)
    assert 0.01 < kernel[0, 0] < 0.99
    expected = with_prior.x_prior + kernel @ (x_true - with_prior.x_prior)
    np.testing.assert_allclose(solution.x - x_true, expected - x_true, rtol=1e-3)
    np.testing.assert_allclose(solution.prior_cost + solution.measurement_cost, solution.cost)
    assert solution.prior_cost > 0


def test_a_solution_can_be_mapped_over_starts(veiled, solve):
    observation, states, truth = veiled
    starts = VEIL.vector.x(jnp.array([0.1, 0.5, 1.5]))
    solutions = solve(pixel(observation, 4), pixel(states, 4), starts)
    found = VEIL.vector.values(solutions.x)["aod_550"]
    np.testing.assert_allclose(found, truth[4], atol=CONVERGED)
    assert len(BANDS) == observation.sigma.shape[1]


def test_every_solver_leads_to_the_same_minimum(veiled):
    observation, states, truth = veiled
    prior = Prior(np.asarray(VEIL.vector.x(np.full(12, 0.3))), np.eye(1))
    tight = Minimiser(1e-8, 200, "levenberg_marquardt")
    expected = retrieve_pixels(VEIL, observation, states, prior=prior, minimiser=tight)
    assert expected.inversion.converged.all()
    sigma = np.sqrt(expected.inversion.covariance[:, 0, 0])
    for solver in SOLVERS:
        how = Minimiser(None, 40, solver, "prior")
        found = retrieve_pixels(VEIL, observation, states, prior=prior, minimiser=how)
        assert found.inversion.converged.all()
        departure = (found.inversion.x - expected.inversion.x)[:, 0] / sigma
        assert np.abs(departure).max() < 0.02, solver


def test_what_cannot_be_asked_of_a_minimiser_is_said(veiled):
    observation, states, _ = veiled
    for how, words in (
        (Minimiser(solver="newton"), "no solver 'newton'; choose from dogleg"),
        (Minimiser(starts="prior"), "starts must be 'scan', or with a prior 'prior'"),
        (Minimiser(tolerance=0.0), "tolerance must be above 0"),
    ):
        with pytest.raises(ValueError, match=words):
            retrieve_pixels(VEIL, observation, states, minimiser=how)


NUMBER = Quantity(
    "q", "1", "a number", "q", Unbounded(), replaced, sigma=1.0, mean=0.0, starts=(-3.0, 0.5, 2.0)
)


@dataclass(frozen=True)
class Parabola:
    """A forward model with two solutions: x and -x."""

    vector: StateVector = StateVector((NUMBER,))
    bands: tuple[str, ...] = ("C01",)

    def __call__(self, x, state):
        return 0.1 * x**2 + state


@dataclass(frozen=True)
class Arc(Parabola):
    """A forward model so flat far from 0 that a step of Gauss and Newton goes too far."""

    def __call__(self, x, state):
        return 0.1 * jnp.arctan(x) + state


@pytest.mark.parametrize("solver", SOLVERS)
def test_costs_are_those_at_x_where_steps_ran_out(solver):
    """Also after a second step that was rejected, as that from 3 is by what can reject one."""
    arc, sigma, starts = Arc(), jnp.array([1e-3]), np.array([[0.5], [3.0]])
    of_one = partial(invert, arc, Observation(0 * sigma, sigma), 0 * sigma)
    found = jax.vmap(lambda x: of_one(x, minimiser=Minimiser(None, 2, solver)))(starts)
    assert not found.converged.any()
    expected = (0.1 * np.arctan(found.x[:, 0]) / 1e-3) ** 2
    np.testing.assert_allclose(found.measurement_cost, expected, rtol=1e-12)
    slope = 100 / (1 + np.asarray(found.x[:, 0]) ** 2)
    np.testing.assert_allclose(found.covariance[:, 0, 0], slope**-2.0, rtol=1e-12)
    rejected = np.asarray(found.x == starts)[:, 0]
    assert rejected.tolist() == [False, solver != "gauss_newton"]


def test_both_of_two_solutions_are_given():
    truth = np.array([0.5, 1.0, 2.0])
    seen = measurement(0.1 * truth[:, None] ** 2, ("C01",))
    found = retrieve_pixels(Parabola(), seen, np.zeros((3, 1)), exact=True)
    assert set(found.codes) == {ResultCode.MULTIPLE_SOLUTIONS}
    both = np.sort(np.concatenate([found.inversion.x, found.other.x], axis=1), axis=1)
    np.testing.assert_allclose(both, np.stack([-truth, truth], axis=1), atol=CONVERGED)
    nothing = Prior(truth[:, None], np.full((1, 1), 0.01))
    alone = retrieve_pixels(Parabola(), seen, np.zeros((3, 1)), prior=nothing)
    assert set(alone.codes) == {ResultCode.SUCCESS}
