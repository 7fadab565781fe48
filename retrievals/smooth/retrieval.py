"""All pixels of an image, retrieved together."""

from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from abi_operator import State

from ..forward import ForwardModel
from ..input_checks import checked
from ..inverse import DEFAULT_MINIMISER, Inversion, Minimiser
from ..observation import Observation
from ..pixels import Retrieved, retrieve_pixels
from ..prior import Prior
from ..quality import result_codes
from ..results import ResultCode
from .linear import Linearised, linearised
from .precision import Smoothness
from .system import STUCK, joint_step, posterior_blocks

# Steps are to be as long as lets what is not linear in a pixel be so much of what it moves,
_NONLINEAR = 0.25
# and 1 + damping may change so much from one to the next.
_LEAST, _MOST = 0.1, 100.0
_MOST_LEFT = 3  # times that a pixel may be led where it is no number
_KEPT = (ResultCode.INVALID_INPUT, ResultCode.NONFINITE, ResultCode.TOO_FEW_BANDS)


def retrieve_smooth(
    forward: ForwardModel,
    observations: Observation,
    states: State,
    *,
    prior: Prior,
    smooth: Smoothness,
    minimiser: Minimiser = DEFAULT_MINIMISER,
    seed: int = 0,
) -> Retrieved:
    """Retrieve all pixels together.

    Parameters
    ----------
    forward, observations, states, prior
        As of `retrieve_pixels`; the prior is that of single pixels.
    smooth
        How neighbours are alike, of as many pixels.
    minimiser
        That of the single pixels with which it begins; its tolerance is that of the joint steps,
        too: their root mean square in posterior standard deviations.
    seed
        Of the draws for the posterior covariance.

    Returns
    -------
    Retrieved
        As `retrieve_pixels`: a pixel's own share of the joint cost, its block of the posterior
        covariance and of the averaging kernel. What single pixels found as a second solution is
        not followed up. A pixel that has not converged, though neighbours have, stayed where
        it could go no further.

    Raises
    ------
    ValueError
        Where `smooth` is of another number of pixels, and as `retrieve_pixels`.
    """
    if len(smooth.sigma) != len(observations.sigma):
        raise ValueError(
            f"smooth is of {len(smooth.sigma)} pixels, and the observations are of "
            f"{len(observations.sigma)}; both must be of the same."
        )
    alone = retrieve_pixels(forward, observations, states, prior=prior, minimiser=minimiser)
    num_values = observations.num_values
    _, usable, own = checked(forward, observations, prior)
    assert own is not None
    root = np.linalg.cholesky(own.S_prior)
    departure = np.asarray(alone.inversion.x) - np.asarray(own.x_prior)
    z = np.linalg.solve(root, departure[..., None])[..., 0]
    # What was not attempted, or ended where nothing is a number, begins as its neighbours tell.
    lost = np.isin(alone.codes, _KEPT) | ~np.isfinite(z).all(axis=1)
    z = np.where(lost[:, None], 0, z)
    how = minimiser.chosen(True)
    z, here, steps, converged = _descended(
        partial(linearised, forward, usable, states, own),
        smooth,
        z,
        how.tolerance or 1e-2,
        how.max_steps,
    )
    blocks = posterior_blocks(here, smooth, jax.random.key(seed))
    inversion = _inversion(own, root, z, here, smooth, np.asarray(blocks))
    inversion = eqx.tree_at(
        lambda i: (i.num_steps, i.converged),
        inversion,
        (np.asarray(alone.inversion.num_steps) + steps, converged),
    )
    codes = result_codes(forward.vector, inversion, inversion, num_values, exact=False)
    codes[~np.asarray(here.fine) & (num_values > 0)] = ResultCode.NONFINITE
    codes = np.where(np.isin(alone.codes, _KEPT), alone.codes, codes).astype(np.int8)
    # Of bounds, and nothing else, a pixel knows what its neighbours do.
    codes[(num_values == 0) & (codes == ResultCode.SUCCESS)] = ResultCode.NOT_OBSERVABLE
    return Retrieved(inversion, codes, inversion)


def _descended(
    linearise: partial[Linearised],
    smooth: Smoothness,
    z: np.ndarray,
    tolerance: float,
    max_steps: int,
) -> tuple[np.ndarray, Linearised, int, np.ndarray]:
    """z at the minimum, what is linear there, evaluations, and which pixels have reached it.

    A step after which a pixel is no number that was one before is none: what it measures would be
    missing in the sum, and so make it less. One that becomes a number is not held against a step.

    Each pixel is damped as its own measurements need it: one that no smoke explains, or that would
    leave where the operator is a number, holds no other up. In the end it is left where it is.
    """
    here, damping = linearise(z), np.zeros(len(z), z.dtype)
    settled, times_left = np.zeros(len(z), bool), np.zeros(len(z), int)
    for evaluation in range(1, max_steps + 1):
        found = joint_step(here, smooth, jnp.asarray(z), jnp.asarray(damping))
        step, own, square = np.asarray(found.step), np.asarray(found.own), float(found.square)
        if not np.isfinite(square):
            return z, here, evaluation, np.zeros(len(z), bool)
        if square <= tolerance**2 * z.size:
            return z, here, evaluation, damping < STUCK
        settled = (own <= tolerance**2 * z.shape[1]) & (damping < STUCK)
        there = z + step
        moved = linearise(there)
        before, linear, after = _measurement_costs(here, moved, step)
        rough = np.asarray(smooth.root(jnp.asarray(np.stack([z, there], axis=-1))))
        prior_costs = np.sum(rough[..., 1] ** 2 - rough[..., 0] ** 2, axis=1)
        # As a sum of differences: of one pixel the cost may be so large that no other's counts.
        refused = not np.sum(after - before + prior_costs) <= 0
        allowed = _NONLINEAR * np.maximum(own / (1 + damping), tolerance**2 * z.shape[1])
        factor = np.clip((after - linear) / allowed, _LEAST, _MOST)
        wanted = np.minimum(np.maximum((1 + damping) * factor, 1) - 1, STUCK)
        if not refused:
            z, here = there, moved
        elif (wanted <= damping).all():  # no one's fault alone
            wanted = np.minimum(4 * damping + 1, STUCK)
        times_left += np.isinf(after)
        damping = np.where((times_left < _MOST_LEFT) & (damping < STUCK), wanted, STUCK)
    return z, here, max_steps, settled


def _measurement_costs(
    here: Linearised, moved: Linearised, step: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of each pixel the sum of squares before a step, after it if it were linear, and after it:
    infinite where it is no number any more, and 0 all three where it was none before.
    """
    fine = np.asarray(here.fine)
    residual, jacobian = np.asarray(here.residual), np.asarray(here.jacobian)
    linear = residual + np.einsum("pbx,px->pb", jacobian, step)
    after = np.sum(np.asarray(moved.residual) ** 2, axis=1)
    after = np.where(np.asarray(moved.fine), after, np.inf)
    return np.sum(residual**2, axis=1), np.sum(linear**2, axis=1), np.where(fine, after, 0)


def _inversion(
    prior: Prior,
    root: np.ndarray,
    z: np.ndarray,
    here: Linearised,
    smooth: Smoothness,
    blocks: np.ndarray,
) -> Inversion:
    """Of x, pixel by pixel."""
    normal = np.einsum("pbx,pby->pxy", here.jacobian, here.jacobian)
    kernel = root @ blocks @ normal @ np.linalg.inv(root)
    rough = np.asarray(smooth.root(jnp.asarray(z)))
    covariance: Any = root @ blocks @ np.swapaxes(root, 1, 2)
    nothing: Any = np.zeros(len(z), int)  # whoever calls knows
    return Inversion(
        x=prior.x_prior + np.einsum("pxy,py->px", root, z),
        covariance=covariance,
        averaging_kernel=kernel,
        measurement_cost=np.sum(np.asarray(here.residual) ** 2, axis=1),
        prior_cost=np.sum(rough**2, axis=1),
        num_steps=nothing,
        converged=nothing == 0,
    )
