"""Intervals of the posterior against its integral on a fine grid."""

import equinox as eqx
import numpy as np
import pytest
from veil import TIGHT, TWO, seen, veiled_pixels

from retrievals import Observation, Prior
from retrievals.intervals import LEVELS, NUM_POINTS, posterior_intervals, principal_axes
from retrievals.optimal_estimation import LARGEST_NONLINEARITY, estimates
from retrievals.pixels import retrieve_pixels

PRIOR = Prior(np.array([-1.5, 0.0]), np.diag([0.8**2, 0.05**2]))


@pytest.fixture(scope="module")
def noisy():
    """Pixels with thirty times the imager's noise: some of the posteriors are skewed."""
    observation, ground, _ = veiled_pixels()
    rng = np.random.default_rng(4)
    sigma = 30 * observation.sigma
    measured = observation.measured + sigma * rng.standard_normal(sigma.shape)
    observation = Observation(measured, sigma)
    inversion = retrieve_pixels(TWO, observation, ground, prior=PRIOR, minimiser=TIGHT).inversion
    x = np.asarray(inversion.x)
    return observation, ground, x, estimates(TWO, observation, ground, x, PRIOR)


def on_a_grid(observation, ground, x, sigma):
    """Quantiles (level, x) of the posterior of one pixel, by the sum over a grid."""
    first, second = (x[i] + sigma[i] * np.linspace(-7, 7, 561) for i in (0, 1))
    grid = np.stack(np.meshgrid(first, second, indexing="ij"), axis=-1)
    departure = (np.asarray(seen(TWO, grid, ground)) - observation.measured) / observation.sigma
    apart = (grid - PRIOR.x_prior) / np.sqrt(np.diag(PRIOR.S_prior))
    weight = np.exp(-((departure**2).sum(-1) + (apart**2).sum(-1)) / 2)
    bounds = []
    for axis, values in ((1, first), (0, second)):
        below = np.cumsum(weight.sum(axis)) / weight.sum()
        bounds.append(np.interp(list(LEVELS.values()), below, values))
    return np.array(bounds).T


@pytest.fixture(scope="module")
def exact(noisy):
    """The same of all pixels (pixel, level, x)."""
    observation, ground, x, found = noisy
    sigma = np.sqrt(np.diagonal(found.posterior_covariance, axis1=1, axis2=2))
    each = map(Observation, observation.measured, observation.sigma)
    return np.stack([on_a_grid(*of) for of in zip(each, ground, x, sigma, strict=True)])


@pytest.mark.parametrize("sampled", [False, True])
def test_bounds_are_those_of_the_posterior(noisy, exact, sampled):
    """Within a fifth of a standard deviation, to which a quantile of so many points in a tail is
    known; in the quadratic form the forward model's third derivatives are missing, too.
    """
    observation, ground, x, found = noisy
    forced = np.full(len(x), np.inf if sampled else 0.0)
    chosen = eqx.tree_at(lambda e: e.nonlinearity, found, forced)
    within = posterior_intervals(TWO, observation, ground, x, chosen, PRIOR)
    assert (within.sampled == sampled).all()
    assert (within.effective_points > NUM_POINTS / (8 if sampled else 4)).all()
    sigma = np.sqrt(np.diagonal(found.posterior_covariance, axis1=1, axis2=2))
    rows = np.arange(len(x)) if sampled else np.flatnonzero(found.nonlinearity < 0.05)
    assert len(rows) >= 4
    for i in rows:
        tolerance = (0.2 if sampled else 0.3) * sigma[i]
        assert (np.abs(within.bounds[i] - exact[i]) < tolerance).all()


def test_skewness_is_seen(noisy, exact):
    """Bounds are nearer the posterior's than those of the error bar, where that is skewed."""
    observation, ground, x, found = noisy
    within = posterior_intervals(TWO, observation, ground, x, found, PRIOR)
    assert (within.sampled == (found.nonlinearity > LARGEST_NONLINEARITY)).all()
    sigma = np.sqrt(np.diagonal(found.posterior_covariance, axis1=1, axis2=2))
    normal = x[:, None] + sigma[:, None] * np.array([-1.96, -1.0, 1.0, 1.96])[:, None]
    ours, theirs = (np.abs(bounds - exact) / sigma[:, None] for bounds in (within.bounds, normal))
    assert np.mean(ours) < np.mean(theirs) / 2
    assert np.max(theirs) > 0.3


def test_a_pixel_that_is_no_number_has_no_interval(noisy):
    observation, ground, x, found = noisy
    bad = ground.copy()
    bad[2] = np.nan
    within = posterior_intervals(TWO, observation, bad, x, found, PRIOR)
    assert np.isnan(within.bounds[2]).all() and within.effective_points[2] == 0
    assert np.isfinite(np.delete(within.bounds, 2, axis=0)).all()


@pytest.mark.parametrize("unknown", [np.nan, np.inf])
def test_a_covariance_that_is_no_number_spoils_no_other(unknown):
    """Of three unknowns, of which LAPACK gives up a matrix that is not finite."""
    covariance = np.stack([np.full((3, 3), unknown), np.diag([9.0, 4.0, 1.0]) + 0.5])
    axes = principal_axes(covariance)
    assert np.isnan(axes[0]).all()
    np.testing.assert_allclose(axes[1] @ axes[1].T, covariance[1], rtol=1e-12)
