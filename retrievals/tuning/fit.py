r"""A few numbers of a plume, each the same in all pixels, fitted to what was observed of them.

Minimised is, over all pixels p and bands b that count,

.. math:: \sum_{pb} \frac{((1 + g_b) F_{pb}(x) - y_{pb})^2}{\sigma_{pb}^2}
   + (x - x_a)^T S_a^{-1} (x - x_a) + \sum_b \frac{g_b^2}{\sigma_g^2},

with the gains g of the bands where the calibration counts as unknown. The image never is one
matrix: of each block of pixels the normal equations :math:`J^T J` and :math:`J^T r` are kept, of
whitened residuals r and their exact forward derivatives J, and added up band by band; steps are
those of Levenberg and Marquardt on their sums (Rodgers 2000, doi:10.1142/3171, section 5.7), as the
solvers of optimistix want all residuals at once. The posterior covariance is
:math:`(J^T J + 1)^{-1}` in unknowns whitened by the prior.

:math:`\sigma` is that of the prediction. It is kept through a minimisation, so that there is a cost
to be lowered, and taken anew for a second one, from what the first has found.

A plume is spread over the layers that its edges lie in, as it was when the scene was simulated:
height moves an image smoothly within a layer, and its slope in steps from one to the next.

There may be several minima (two heights, with gains to make up for the difference). So the fit
begins at several points, with few of the pixels, and goes on with all of them from the two lowest
minima that differ.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Float

from abi_operator import State
from abi_operator.machine.speed import Kept

from ..chunks import map_chunks
from ..forward import ForwardModel, prepared
from ..inverse import value_and_jacobian
from .plume_pixels import PlumePixels

TOLERANCE = 1e-2
"""Length of the last step in posterior standard deviations; what is left is far smaller. [-]"""
MAX_STEPS = 30
SCOUTS = 64
"""Pixels with which the minima are looked for. [-]"""
STARTS = {"strength": (-1.5, 1.5), "height": (-1.0, 1.0, 2.0), "top": (-1.0, 1.0, 2.0)}
"""Where a fit begins beside the prior's mean, in standard deviations of the prior. [-]"""
_DAMPING = 10.0  # by which the damping grows where a step fails, and shrinks where one succeeds

ErrorOf = Callable[[np.ndarray], np.ndarray]


class Normal(NamedTuple):
    """Sums over the pixels, band by band, in unknowns whitened by their prior.

    Parameters
    ----------
    matrix, slope, square
        :math:`J^T J` (band, z, z), :math:`J^T r` (band, z) and :math:`r^T r` (band).
    predicted, residual
        Of each pixel and band, without and with gains; the residual is 0 where nothing counts.
    """

    matrix: np.ndarray
    slope: np.ndarray
    square: np.ndarray
    predicted: np.ndarray
    residual: np.ndarray


class Fitted(NamedTuple):
    """Outcome of a fit, in unknowns z whitened by their prior: those of x first, then gains.

    Parameters
    ----------
    z, covariance
        The solution and its posterior covariance. [-]
    normal
        Sums at the solution.
    num_steps
        Evaluations of the image with its Jacobian, of all pixels.
    converged
        Whether the last step was negligible.
    other
        The second lowest minimum, None where none was found.
    """

    z: np.ndarray
    covariance: np.ndarray
    normal: Normal
    num_steps: int
    converged: bool
    other: "Fitted | None" = None

    @property
    def cost(self) -> float:
        """What was minimised. [-]"""
        return float(self.normal.square.sum() + self.z @ self.z)

    def same_as(self, other: "Fitted") -> bool:
        """Whether it is the same minimum, within its errors. [-]"""
        apart = np.abs(self.z - other.z)
        return bool(np.all(apart < np.sqrt(np.diag(self.covariance))))


class Problem(NamedTuple):
    """What is fitted to what.

    Parameters
    ----------
    forward
        The forward model, `ready`; its state vector is that of the plume's numbers.
    pixels
        Where, and what was observed there.
    x_prior, sigma_prior
        Mean and standard deviation of the prior of x. [-]
    gain_sigma
        Standard deviation of each band's gain, 0 where it is known. [-]
    error_of
        Standard deviations of measurements, of predictions (pixel, band). [-]
    """

    forward: ForwardModel
    pixels: PlumePixels
    x_prior: np.ndarray
    sigma_prior: np.ndarray
    gain_sigma: np.ndarray
    error_of: ErrorOf

    @property
    def free_gains(self) -> np.ndarray:
        """Which bands have an unknown gain."""
        return np.flatnonzero(self.gain_sigma > 0)

    def x(self, z: np.ndarray) -> np.ndarray:
        """State vector of whitened unknowns."""
        size = self.x_prior.size
        return self.x_prior + self.sigma_prior * z[:size]

    def gains(self, z: np.ndarray) -> np.ndarray:
        """Gains of all bands, less 1. [-]"""
        gains = np.zeros(len(self.pixels.bands))
        free = self.free_gains
        gains[free] = self.gain_sigma[free] * z[self.x_prior.size :]
        return gains


def ready(forward: ForwardModel, pixels: PlumePixels) -> ForwardModel:
    """The forward model with doublings that suffice for every pixel and every x."""
    found = [prepared(forward, states).num_doublings or 0 for _, states in pixels.blocks()]
    return replace(forward, num_doublings=max(found))


def fit(problem: Problem) -> Fitted:
    """Minimise from several starts."""
    few = problem._replace(pixels=problem.pixels.thinned(SCOUTS))
    minima: list[Fitted] = []
    for start in _starts(problem):
        found = _fit_from(few, start)
        if not any(found.same_as(one) for one in minima):
            minima.append(found)
    minima.sort(key=lambda found: found.cost if found.converged else np.inf)
    best, *others = sorted(
        (_fit_from(problem, found.z) for found in minima[:2]),
        key=lambda found: found.cost if found.converged else np.inf,
    )
    rivals = [other for other in others if other.converged and not other.same_as(best)]
    return best._replace(other=rivals[0] if rivals else None)


def _starts(problem: Problem) -> list[np.ndarray]:
    """The prior's mean, and from there each number by itself where it may have several minima."""
    origin = np.zeros(problem.x_prior.size + problem.free_gains.size)
    found = [origin]
    for k, name in enumerate(problem.forward.vector.names):
        found += [origin + by * np.eye(origin.size)[k] for by in STARTS.get(name, ())]
    return found


def _fit_from(problem: Problem, z: np.ndarray) -> Fitted:
    """Minimise from one start, and once more with the errors of what was found."""
    predicted, _ = image_of(problem, problem.x(z))
    first = _descended(problem, problem.error_of(predicted), z)
    last = _descended(problem, problem.error_of(first.normal.predicted), first.z)
    return last._replace(num_steps=1 + first.num_steps + last.num_steps)


def image_of(problem: Problem, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reflectance factors (pixel, band) at x, and their derivatives (pixel, band, x)."""
    values, jacobians = [], []
    for _, states in problem.pixels.blocks():
        value, jacobian = _image_of_block(problem, states, x)
        values.append(value)
        jacobians.append(jacobian)
    return np.concatenate(values), np.concatenate(jacobians)


def _image_of_block(
    problem: Problem, states: State, x: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    count = states.geometry.solar_zenith.shape[0]
    rows = np.broadcast_to(x, (count, x.size))
    return map_chunks(lambda *chunk: _image_chunk(problem.forward, *chunk), states, rows)


@Kept
def _image_chunk(forward: ForwardModel, states: State, x: jax.Array) -> tuple[jax.Array, jax.Array]:
    def of_one(state: State, x: Float[Array, " x"]) -> tuple[Array, Array]:
        return value_and_jacobian(lambda x: forward(x, state), x)

    return jax.vmap(of_one)(states, x)


def _normal(problem: Problem, sigma: np.ndarray, z: np.ndarray) -> Normal:
    """Sums at z, of residuals whitened by given standard deviations (pixel, band)."""
    pixels, free = problem.pixels, problem.free_gains
    size, num_bands = z.size, len(pixels.bands)
    gains, x = problem.gains(z), problem.x(z)
    matrix, slope = np.zeros((num_bands, size, size)), np.zeros((num_bands, size))
    predicted, residual = np.empty_like(pixels.measured), np.empty_like(pixels.measured)
    for rows, states in pixels.blocks():
        value, jacobian = _image_of_block(problem, states, x)
        counts = pixels.counts[rows]
        # An error may be no number where nothing counts, and such a quotient would not be 0.
        scale = np.where(counts, sigma[rows], 1)
        departure = np.where(counts, (1 + gains) * value - pixels.measured[rows], 0) / scale
        by_x = (1 + gains)[:, None] * jacobian * problem.sigma_prior
        by_gain = np.zeros((*value.shape, free.size))
        by_gain[:, free, np.arange(free.size)] = (value * problem.gain_sigma)[:, free]
        slopes = np.concatenate([by_x, by_gain], axis=-1) / scale[..., None]
        slopes = np.where(counts[..., None], slopes, 0)
        matrix += np.einsum("pbi,pbj->bij", slopes, slopes)
        slope += np.einsum("pbi,pb->bi", slopes, departure)
        predicted[rows], residual[rows] = value, departure
    return Normal(matrix, slope, np.sum(residual**2, axis=0), predicted, residual)


def _descended(problem: Problem, sigma: np.ndarray, z: np.ndarray) -> Fitted:
    """The minimum for given standard deviations (pixel, band)."""
    here, damping = _normal(problem, sigma, z), 0.0
    cost, converged = here.square.sum() + z @ z, False
    steps = 1
    while steps <= MAX_STEPS:
        inverse = here.matrix.sum(axis=0) + np.eye(z.size)
        slope = here.slope.sum(axis=0) + z
        step = -np.linalg.solve(inverse + damping * np.diag(np.diag(inverse)), slope)
        converged = bool(damping < 1 and step @ inverse @ step <= TOLERANCE**2 * z.size)
        if converged or not np.isfinite(step).all():
            break
        there = _normal(problem, sigma, z + step)
        steps += 1
        new = there.square.sum() + (z + step) @ (z + step)
        if new <= cost:
            z, here, cost = z + step, there, new
            damping = damping / _DAMPING if damping > 1e-3 else 0.0
        else:
            damping = max(damping * _DAMPING, 1e-2)
    covariance = np.linalg.inv(here.matrix.sum(axis=0) + np.eye(z.size))
    return Fitted(z, covariance, here, steps, converged)
