"""Diagnostics against their formulas, by NumPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from veil import TWO, VEIL, Veil, seen, slopes, veiled_pixels

from retrievals import Bounded, Observation, Prior, Quantity, StateVector
from retrievals.optimal_estimation import estimates
from retrievals.quantities import replaced

EXACT = 1e-10


class GroundOf(StateVector):
    """The veil's ground, which is no state but an array: one number for all bands."""

    def state(self, x, state):
        return state + self.quantities[0].transform.value(x)

    def held(self, state, name):
        return jnp.zeros(len(state))


GROUND = GroundOf(
    (Quantity("ground", "1", "ground", "", Bounded(-1.0, 1.0), replaced, sigma=0.02, mean=0.0),)
)


@pytest.fixture(scope="module")
def diagnosed():
    """Estimates of pixels of which one has a missing band, and what they were made of."""
    observation, ground, truth = veiled_pixels()
    sigma = observation.sigma.copy()
    sigma[3, 1] = np.inf
    correlation = np.broadcast_to(0.6 * np.eye(3) + 0.4, (12, 3, 3))
    observation = Observation(observation.measured, sigma, correlation=correlation)
    x = np.asarray(TWO.vector.x(truth, 0.01)) + 0.05
    prior = Prior(np.array([-2.5, 0.0]), np.array([[0.8, 0.01], [0.01, 0.0025]]))
    return estimates(TWO, observation, ground, x, prior, GROUND), observation, ground, x, prior


@pytest.mark.parametrize("index", [0, 3, 11])
def test_diagnostics_are_their_formulas(diagnosed, index):
    """Rodgers (2000), sections 2.3 to 2.5 and 3.2, with all matrices written out."""
    found, observation, ground, x, prior = diagnosed
    one = jax.tree.map(lambda leaf: leaf[index], found)
    counts = np.isfinite(observation.sigma[index])
    K = np.asarray(slopes(TWO, x[index], ground[index]))[counts]
    sigma = observation.sigma[index][counts]
    S_obs = np.outer(sigma, sigma) * observation.correlation[index][np.ix_(counts, counts)]
    S_prior = prior.S_prior
    S_hat = np.linalg.inv(K.T @ np.linalg.inv(S_obs) @ K + np.linalg.inv(S_prior))
    G = S_hat @ K.T @ np.linalg.inv(S_obs)
    A = G @ K
    np.testing.assert_allclose(one.jacobian[counts], K, rtol=EXACT)
    np.testing.assert_allclose(one.posterior_covariance, S_hat, rtol=EXACT)
    np.testing.assert_allclose(one.gain[:, counts], G, rtol=EXACT)
    assert (one.gain[:, ~counts] == 0).all() and (one.residual[~counts] == 0).all()
    np.testing.assert_allclose(one.averaging_kernel, A, rtol=EXACT)
    np.testing.assert_allclose(one.degrees_of_freedom, np.trace(A), rtol=EXACT)
    information = 0.5 * np.log2(np.linalg.det(S_prior @ np.linalg.inv(S_hat)))
    np.testing.assert_allclose(one.information_content, information, rtol=EXACT)
    np.testing.assert_allclose(one.noise_covariance, G @ S_obs @ G.T, rtol=EXACT)
    lack = A - np.eye(2)
    smoothing = lack @ S_prior @ lack.T
    rounding = 1e-9 * np.abs(S_hat).max()  # a difference of nearly equal numbers
    np.testing.assert_allclose(one.smoothing_covariance, smoothing, atol=rounding)
    np.testing.assert_allclose(
        one.noise_covariance + one.smoothing_covariance, one.posterior_covariance, rtol=EXACT
    )
    departure = (np.asarray(seen(TWO, x[index], ground[index])) - observation.measured[index])[
        counts
    ]
    chi_square = departure @ np.linalg.inv(S_obs) @ departure
    np.testing.assert_allclose(one.chi_square, chi_square, rtol=EXACT)
    # dF / d ground is the transmittance; the transform's slope at 0 is 1 / 2
    lit, dark = (np.asarray(seen(TWO, x[index], ground[index] + a)) for a in (1, 0))
    transmittance = lit - dark
    error = np.abs(G @ transmittance[counts] * 0.5) * 0.02
    np.testing.assert_allclose(one.parameter_error[0], error, rtol=1e-9)


class Bare(Veil):
    """A veil that says what is there without it: the ground."""

    def measured(self, full, sun_distance=None):
        return full


def test_of_an_excess_the_errors_are_those_of_the_difference(diagnosed):
    """What the ground would show alone was measured, and is no error of the veil's."""
    _, observation, ground, x, prior = diagnosed
    bare = Bare(TWO.vector)
    found = estimates(bare, observation, ground, x, prior, GROUND, excess=True)
    whole = diagnosed[0]
    np.testing.assert_allclose(found.residual, whole.residual, rtol=EXACT)
    np.testing.assert_allclose(found.gain, whole.gain, rtol=EXACT)
    for i in (0, 11):
        lit, dark = (np.asarray(seen(TWO, x[i], ground[i] + a)) for a in (1, 0))
        error = np.abs(found.gain[i] @ (lit - dark - 1) * 0.5) * 0.02
        np.testing.assert_allclose(found.parameter_error[i, 0], error, rtol=1e-9)


class Edged(Veil):
    """A veil that is brighter, and steeper, where levels go with a plume's edges."""

    def __call__(self, x, state):
        return super().__call__(x, state) * (1.1 if self.plume_edges else 1)


class Moved(GroundOf):
    def moves_plumes(self, states):
        return True


def test_what_is_left_is_that_of_the_model_that_found_x(diagnosed):
    """Slopes are those with edges, of which the solution knew nothing."""
    whole, observation, ground, x, prior = diagnosed
    moved = Moved(GROUND.quantities)
    found = estimates(Edged(TWO.vector, plume_edges=None), observation, ground, x, prior, moved)
    np.testing.assert_allclose(found.residual, whole.residual, rtol=EXACT)
    np.testing.assert_allclose(found.chi_square, whole.chi_square, rtol=EXACT)
    np.testing.assert_allclose(found.jacobian, 1.1 * whole.jacobian, rtol=EXACT)


def test_the_linearity_test_sees_curvature(diagnosed):
    found, observation, ground, x, _ = diagnosed
    variances, axes = np.linalg.eigh(found.posterior_covariance[0])
    here, departures = np.asarray(seen(TWO, x[0], ground[0])), []
    for step in [*(axes * np.sqrt(variances)).T, *-(axes * np.sqrt(variances)).T]:
        moved = np.asarray(seen(TWO, x[0] + step, ground[0]))
        linear = here + found.jacobian[0] @ step
        departure = (moved - linear) / observation.sigma[0]
        departures.append(departure @ np.linalg.solve(observation.correlation[0], departure))
    np.testing.assert_allclose(found.nonlinearity[0], max(departures), rtol=1e-6)


def test_without_a_prior_the_kernel_is_the_unit_matrix(diagnosed):
    _, observation, ground, x, _ = diagnosed
    found = estimates(VEIL, observation, ground, x[:, :1])
    np.testing.assert_allclose(found.averaging_kernel, 1, rtol=EXACT)
    assert np.isinf(found.information_content).all() and found.parameter_error.shape == (12, 0, 1)
