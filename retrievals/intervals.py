r"""Intervals that hold the truth as often as they say, of posteriors that are not normal.

The error bar of a linear estimate is symmetric and of the width that the Jacobian has at the
solution. But the sensitivity to one quantity may depend on another (single-scattering albedo on
optical depth), so that the posterior is skewed and its tails are longer: of 10,000 pixels drawn
from the prior, 92 % lay within 1.96 standard deviations of ssa. So the posterior itself,

.. math:: p(x | y) \propto \exp \left( -\tfrac12 |r(x)|^2
          - \tfrac12 (x - x_a)^T S_a^{-1} (x - x_a) \right),

with whitened residuals r, is sampled by importance: points x = x_hat + E t, with E the principal
axes of the posterior covariance times their standard deviations, t of a Student's distribution
wider than the posterior (Geweke 1989 [1]_), weighted by the posterior over the density that they
were drawn from. Quantiles of the weighted points bound the intervals.

Residuals at the points come from a quadratic form, which takes 2n + n (n - 1) evaluations of the
forward model for n unknowns,

.. math:: r(t) = r(0) + \sum_i b_i t_i + \tfrac12 \sum_{ij} c_{ij} t_i t_j,

by central differences at t of unit length; where the forward model departs too far from its linear
form for that (`LARGEST_NONLINEARITY`), from the forward model at every point.

References
----------
.. [1] J. Geweke, "Bayesian inference in econometric models using Monte Carlo integration",
   Econometrica, 57, 1317-1339, 1989, doi:10.2307/1913710
"""

from functools import cache, partial

import equinox as eqx
import jax
import numpy as np
import scipy.stats
from jaxtyping import Array, Bool, Float

from abi_operator import State
from abi_operator.machine.speed import Kept

from .chunks import map_chunks
from .forward import ForwardModel
from .observation import Observation
from .optimal_estimation import LARGEST_NONLINEARITY, Estimate
from .prior import Prior

LEVELS = {"lower_95": 0.025, "lower_68": 0.1587, "upper_68": 0.8413, "upper_95": 0.975}
"""Bounds of the intervals, and the probability that the truth is below. [-]"""

NUM_POINTS = 1024
"""Points of the quadratic form; half as many of the forward model."""

FEWEST_POINTS = 20.0
"""Effective points below which there is no interval."""

_FREEDOM, _WIDTH = 5, 1.3  # of Student's distribution: tails, and width beside the posterior's
_PIXELS = 256  # in memory at once, with all their points


class Intervals(eqx.Module):
    """Where the truth is, of x.

    Parameters
    ----------
    bounds
        Quantiles of the posterior at `LEVELS`, NaN where too few points count. [-]
    effective_points
        How many points of one weight would say as much: the square of the sum of weights over the
        sum of their squares.
    sampled
        Whether the forward model was evaluated at every point.
    """

    bounds: Float[np.ndarray, "pixel level x"]
    effective_points: Float[np.ndarray, " pixel"]
    sampled: Bool[np.ndarray, " pixel"]


def posterior_intervals(
    forward: ForwardModel,
    observations: Observation,
    states: State,
    x: Float[Array | np.ndarray, "pixel x"],
    found: Estimate,
    prior: Prior | None = None,
) -> Intervals:
    """Bound the truth of many pixels.

    Parameters
    ----------
    forward, observations, states, x, prior
        As of `estimates`.
    found
        What that returned.
    """
    x = np.asarray(x)
    num_pixels, size = x.shape
    axes = principal_axes(np.asarray(found.posterior_covariance, np.float64))
    # A row of steps is one call, and all have as many: one program serves both ways.
    steps = _steps(size)
    residual = partial(_residuals, forward, observations, states, x, axes)
    at_steps = residual(np.broadcast_to(steps, (num_pixels, *steps.shape)), slice(None))
    sampled = ~(np.asarray(found.nonlinearity) <= LARGEST_NONLINEARITY)
    of_prior = None if prior is None else prior.of_pixels(num_pixels, forward.vector.names)
    bounds = np.full((num_pixels, len(LEVELS), size), np.nan)
    effective = np.zeros(num_pixels)

    def settle(rows: np.ndarray, points: np.ndarray, density: np.ndarray, r: np.ndarray) -> None:
        places = x[rows, None] + np.einsum("nij,kj->nki", axes[rows], points)
        cost = np.sum(r**2, axis=2)
        if of_prior is not None:
            mean, covariance = (np.asarray(a)[rows] for a in (of_prior.x_prior, of_prior.S_prior))
            apart = places - mean[:, None]
            inverse = np.linalg.inv(covariance)
            cost = cost + np.einsum("nki,nij,nkj->nk", apart, inverse, apart)
        bounds[rows], effective[rows] = _quantiles(places, -cost / 2 - density)

    for rows in _parts(np.flatnonzero(~sampled), _PIXELS):
        points, density = _points(size, NUM_POINTS)
        settle(rows, points, density, _quadratic(at_steps[rows], points))
    if sampled.any():
        points, density = _points(size, NUM_POINTS // 2)
        rows = np.flatnonzero(sampled)
        settle(rows, points, density, _in_calls(residual, points, len(steps), rows))
    return Intervals(bounds, effective, sampled)


def principal_axes(covariance: Float[np.ndarray, "pixel x x"]) -> Float[np.ndarray, "pixel x x"]:
    """Principal axes times their standard deviations; NaN of a pixel whose covariance is no number,
    of which one would end the decomposition of all.
    """
    fine = np.isfinite(covariance).all(axis=(1, 2), keepdims=True)
    variances, vectors = np.linalg.eigh(np.where(fine, covariance, 0))
    return np.where(fine, vectors * np.sqrt(np.maximum(variances, 0))[:, None, :], np.nan)


def _steps(size: int) -> np.ndarray:
    """Where the quadratic form is read: the solution, both ways along each axis and each pair."""
    unit = np.eye(size)
    pairs = [unit[i] + unit[j] for i in range(size) for j in range(i)]
    one_way = np.array([*unit, *pairs])
    return np.concatenate([np.zeros((1, size)), one_way, -one_way])


def _quadratic(
    at_steps: Float[np.ndarray, "pixel step residual"], points: Float[np.ndarray, "point x"]
) -> Float[np.ndarray, "pixel point residual"]:
    """Residuals of the quadratic form through those at `_steps`."""
    size, half = points.shape[1], (at_steps.shape[1] - 1) // 2
    here = at_steps[:, :1]
    forth, back = at_steps[:, 1 : half + 1], at_steps[:, half + 1 :]
    odd, even = (forth - back) / 2, forth + back - 2 * here
    terms = [points, points**2 / 2]
    curves = [even[:, :size]]
    pairs = [(i, j) for i in range(size) for j in range(i)]
    if pairs:
        first, second = (np.array(k) for k in zip(*pairs, strict=True))
        terms.append(points[:, first] * points[:, second])
        curves.append((even[:, size:] - even[:, first] - even[:, second]) / 2)
    slopes = np.concatenate([odd[:, :size], *curves], axis=1)
    return here + np.einsum("kt,ntb->nkb", np.concatenate(terms, axis=1), slopes)


def _in_calls(
    residual: partial[np.ndarray], points: np.ndarray, width: int, rows: np.ndarray
) -> Float[np.ndarray, "pixel point residual"]:
    """Residuals of the forward model at all points, a few of them a call."""
    found = []
    for some in _parts(np.arange(len(points)), width):
        filled = points[np.resize(some, width)]
        here = residual(np.broadcast_to(filled, (len(rows), *filled.shape)), rows)
        found.append(here[:, : len(some)])
    return np.concatenate(found, axis=1)


def _residuals(
    forward: ForwardModel,
    observations: Observation,
    states: State,
    x: np.ndarray,
    axes: np.ndarray,
    steps: Float[np.ndarray, "pixel step x"],
    rows: np.ndarray | slice,
) -> Float[np.ndarray, "pixel step residual"]:
    """Whitened residuals after steps in standard deviations along the axes, of some pixels."""
    some = jax.tree.map(lambda a: np.asarray(a)[rows], (observations, states))
    places = x[rows, None] + np.einsum("nij,nkj->nki", axes[rows], steps)
    chunk = partial(_residual_chunk, forward)
    return np.asarray(map_chunks(chunk, *some, places.astype(x.dtype)), np.float64)


@Kept
def _residual_chunk(
    forward: ForwardModel,
    observations: Observation,
    states: State,
    places: Float[Array, "pixel step x"],
) -> Float[Array, "pixel step residual"]:
    def of_one(observation: Observation, state: State, x: Array) -> Array:
        return jax.lax.map(lambda at: observation.departure(forward, at, state), x)

    return jax.vmap(of_one)(observations, states, places)


@cache
def _points(size: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points t of Student's distribution, the same for all pixels, and the logarithm of its density
    but for a constant.

    They follow a Halton sequence, so that few of them fill the space evenly.
    """
    halton = scipy.stats.qmc.Halton(size + 1, scramble=False).fast_forward(1).random(count)
    normal = scipy.stats.norm.ppf(halton[:, :size])
    spread = scipy.stats.chi2.ppf(halton[:, size:], _FREEDOM) / _FREEDOM
    unit = normal / np.sqrt(spread)
    density = -(_FREEDOM + size) / 2 * np.log1p(np.sum(unit**2, axis=1) / _FREEDOM)
    return _WIDTH * unit, density


def _quantiles(
    places: Float[np.ndarray, "pixel point x"], log_weights: Float[np.ndarray, "pixel point"]
) -> tuple[Float[np.ndarray, "pixel level x"], Float[np.ndarray, " pixel"]]:
    """Quantiles of weighted points, and how many count; what is not a number has no weight."""
    log_weights = np.where(np.isfinite(log_weights), log_weights, -np.inf)
    largest = np.max(log_weights, axis=1, keepdims=True)
    weights = np.exp(log_weights - np.where(np.isfinite(largest), largest, 0))
    total = np.sum(weights, axis=1, keepdims=True)
    weights /= np.where(total > 0, total, 1)
    square = np.sum(weights**2, axis=1)
    effective = np.where(square > 0, 1 / np.where(square > 0, square, 1), 0)
    order = np.argsort(places, axis=1)
    ordered = np.take_along_axis(places, order, axis=1)
    cumulated = np.cumsum(np.take_along_axis(weights[..., None], order, axis=1), axis=1)
    last = places.shape[1] - 1
    bounds = []
    for level in LEVELS.values():
        index = np.minimum(np.sum(cumulated < level, axis=1), last)[:, None]
        bounds.append(np.take_along_axis(ordered, index, axis=1)[:, 0])
    enough = (effective >= FEWEST_POINTS)[:, None, None]
    return np.where(enough, np.stack(bounds, axis=1), np.nan), effective


def _parts(rows: np.ndarray, size: int) -> list[np.ndarray]:
    """Rows, so many at a time."""
    return [rows[start : start + size] for start in range(0, len(rows), size)]
