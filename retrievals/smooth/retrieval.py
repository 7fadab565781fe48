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
from .linear import Linearised, joint_cost, linearised
from .precision import Smoothness
from .system import joint_step, posterior_blocks

_DAMPING = 10.0  # by which the damping grows where a step fails, and shrinks where one succeeds
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
        How neighbours are alike.
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
        not followed up.
    """
    alone = retrieve_pixels(forward, observations, states, prior=prior, minimiser=minimiser)
    num_values = observations.num_values
    _, usable, own = checked(forward, observations, prior)
    assert own is not None
    root = np.linalg.cholesky(own.S_prior)
    departure = np.asarray(alone.inversion.x) - np.asarray(own.x_prior)
    z = np.linalg.solve(root, departure[..., None])[..., 0]
    z = np.where(np.isfinite(z).all(axis=1, keepdims=True), z, 0)
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
        (np.asarray(alone.inversion.num_steps) + steps, np.full(len(z), converged)),
    )
    codes = result_codes(forward.vector, inversion, inversion, num_values, exact=False)
    codes[~np.asarray(here.fine) & (num_values > 0)] = ResultCode.NONFINITE
    codes = np.where(np.isin(alone.codes, _KEPT), alone.codes, codes).astype(np.int8)
    return Retrieved(inversion, codes, inversion)


def _descended(
    linearise: partial[Linearised],
    smooth: Smoothness,
    z: np.ndarray,
    tolerance: float,
    max_steps: int,
) -> tuple[np.ndarray, Linearised, int, bool]:
    """z at the minimum, what is linear there, evaluations, and whether it was reached.

    A step after which a pixel is no number that was one before is none: what it measures would be
    missing in the sum, and so make it less. One that becomes a number is not held against a step.
    """
    here = linearise(z)
    cost, damping = joint_cost(here, smooth, z), 0.0
    for evaluation in range(1, max_steps + 1):
        step, square = joint_step(here, smooth, jnp.asarray(z), jnp.asarray(damping, z.dtype))
        if not np.isfinite(float(square)):
            return z, here, evaluation, False
        if damping < 1 and float(square) <= tolerance**2 * z.size:
            return z, here, evaluation, True
        there = z + np.asarray(step)
        moved = linearise(there)
        fine = np.asarray(here.fine)
        both = moved._replace(residual=np.where(fine[:, None], moved.residual, 0))
        if not (fine & ~moved.fine).any() and joint_cost(both, smooth, there) <= cost:
            z, here, cost = there, moved, joint_cost(moved, smooth, there)
            damping = damping / _DAMPING if damping > 1e-3 else 0.0
        else:
            damping = max(damping * _DAMPING, 1e-2)
    return z, here, max_steps, False


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
