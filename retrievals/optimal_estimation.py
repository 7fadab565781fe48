r"""What an optimal estimate is worth, pixel by pixel: errors, where they come from, information.

All of it is linear algebra with the Jacobian of the forward model at the solution, in the notation
of Rodgers (2000) [1]_: with K = dF/dx, measurement noise :math:`S_\epsilon` and prior covariance
:math:`S_a`,

.. math::
   \hat S &= (K^T S_\epsilon^{-1} K + S_a^{-1})^{-1}, \qquad
   G = \hat S K^T S_\epsilon^{-1}, \qquad A = G K, \\
   d_s &= \mathrm{tr} A, \qquad H = \tfrac12 \log_2 |S_a \hat S^{-1}|, \\
   \hat S &= \underbrace{(A - I) S_a (A - I)^T}_\text{smoothing}
           + \underbrace{G S_\epsilon G^T}_\text{noise}

(sections 2.3 to 2.5 and 3.2). To these add the errors of what is not retrieved but assumed: with
its covariance :math:`S_b` and the Jacobian :math:`K_b` with respect to it,
:math:`G K_b S_b K_b^T G^T`. What is assumed is a state vector as well, of other quantities.

Whether any of it holds is asked as in section 5.1: along each principal axis e of :math:`\hat S`,
to both sides, the forward model departs from its linear form by :math:`\delta = F(\hat x \pm e) -
F(\hat x) \mp K e`, which noise hides while :math:`\delta^T S_\epsilon^{-1} \delta` is well below 1.

References
----------
.. [1] C. D. Rodgers, "Inverse Methods for Atmospheric Sounding", World Scientific, 2000,
   doi:10.1142/3171
"""

from dataclasses import replace
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from abi_operator import State
from abi_operator.machine.speed import Kept

from .chunks import map_chunks
from .forward import ForwardModel
from .inverse import value_and_jacobian
from .observation import Observation, Seen
from .prior import Prior
from .state_vector import StateVector

LARGEST_NONLINEARITY = 0.5
"""Departure from a linear forward model up to which error bars are believed. [-]"""


class Estimate(eqx.Module):
    """Diagnostics of the pixels, of x; a quantity's own are those times its `slopes`.

    Parameters
    ----------
    jacobian
        K, zero in missing bands; in the unit of each measurement.
    posterior_covariance, noise_covariance, smoothing_covariance
        The posterior covariance and its two parts. [-]
    parameter_error
        Standard deviation of x due to each of the quantities that are assumed. [-]
    averaging_kernel, gain
        A [-], and G in the inverse of the unit of each measurement.
    degrees_of_freedom
        For signal. [-]
    information_content
        H; infinite without a prior. [bit]
    residual
        Whitened departure of the forward model from each measurement, 0 in missing bands. [-]
    chi_square
        Sum of their squares. [-]
    nonlinearity
        Largest departure from a linear forward model. [-]
    """

    jacobian: Float[Array, "*pixel band x"]
    posterior_covariance: Float[Array, "*pixel x x"]
    noise_covariance: Float[Array, "*pixel x x"]
    smoothing_covariance: Float[Array, "*pixel x x"]
    parameter_error: Float[Array, "*pixel parameter x"]
    averaging_kernel: Float[Array, "*pixel x x"]
    gain: Float[Array, "*pixel x band"]
    degrees_of_freedom: Float[Array, "*pixel"]
    information_content: Float[Array, "*pixel"]
    residual: Float[Array, "*pixel band"]
    chi_square: Float[Array, "*pixel"]
    nonlinearity: Float[Array, "*pixel"]


def estimates(
    forward: ForwardModel,
    observations: Observation,
    states: State,
    x: Float[Array | np.ndarray, "pixel x"],
    prior: Prior | None = None,
    assumed: StateVector | None = None,
    *,
    excess: bool = False,
) -> Estimate:
    """Diagnose the solutions of many pixels.

    Parameters
    ----------
    forward, observations, states, prior
        Those of `retrieve_pixels`.
    x
        Its solutions. [-]
    assumed
        What is not retrieved, with the covariance of its declarations; None for nothing. Where it
        moves a plume, slopes are those of levels that go with its edges unless the forward model
        says otherwise; what is left of the measurements is that of the model that found x.
    excess
        Whether what was measured is what x adds to the states, to which was added what the forward
        model makes of the states themselves (`fires`). Both depend on what is assumed, and its
        errors are those of the difference.

    Returns
    -------
    Estimate
        NumPy arrays, pixels leading.
    """
    dtype = jax.dtypes.canonicalize_dtype(np.float64)
    x = np.asarray(x, dtype)
    if prior is not None:
        prior = prior.of_pixels(len(x), forward.vector.names)
    about = None if assumed is None else assumed.prior(states).of_pixels(len(x), assumed.names)
    solved = forward
    if assumed is not None and forward.plume_edges is None and assumed.moves_plumes(states):
        forward = replace(forward, plume_edges=True)
    rows = (prior, about, observations, states)
    rows = jax.tree.map(np.asarray, rows)
    how = forward, solved, assumed, excess
    return map_chunks(lambda *chunk: _estimate_chunk(how, *chunk), *rows, x)


@Kept
def _estimate_chunk(
    how: tuple[ForwardModel, ForwardModel, StateVector | None, bool],
    prior: Prior | None,
    about: Prior | None,
    observations: Observation,
    states: State,
    x: jax.Array,
) -> Estimate:
    def of_one(*pixel: Any) -> Estimate:
        return _estimate(*how, *pixel)

    return jax.vmap(of_one)(prior, about, observations, states, x)


def _estimate(
    forward: ForwardModel,
    solved: ForwardModel,
    assumed: StateVector | None,
    excess: bool,
    prior: Prior | None,
    about: Prior | None,
    observation: Observation,
    state: State,
    x: Float[Array, " x"],
) -> Estimate:
    """One pixel's; `solved` is the model that found x, of which no slopes are taken."""
    size = x.size
    parameters = x[:0] if about is None else jnp.asarray(about.x_prior)

    def whitened(both: Float[Array, " x_and_parameter"], seen: Seen = forward) -> Array:
        known = state if assumed is None else assumed.state(both[size:], state)
        return observation.departure(seen, both[:size], known)

    def added(x: Array, known: State, *distance: Array) -> Array:
        """The same values, and the slopes of what x adds."""
        without = forward.measured(known, *distance)
        return forward(x, known, *distance) - (without - jax.lax.stop_gradient(without))

    both = jnp.concatenate([x, parameters])
    seen = added if excess and about is not None else forward
    residual, slopes = value_and_jacobian(partial(whitened, seen=seen), both)
    jacobian, of_parameters = slopes[:, :size], slopes[:, size:]
    inverse_prior = jnp.zeros((size, size), x.dtype)
    if prior is not None:
        inverse_prior = jnp.linalg.inv(prior.S_prior)
    inverse = jacobian.T @ jacobian + inverse_prior
    covariance = jnp.linalg.inv(inverse)
    gain = covariance @ jacobian.T  # of whitened measurements
    kernel = gain @ jacobian
    lack = kernel - jnp.eye(size, dtype=x.dtype)
    smoothing = jnp.zeros_like(covariance)
    information = jnp.full((), jnp.inf, x.dtype)
    if prior is not None:
        smoothing = lack @ prior.S_prior @ lack.T
        _, determinant = jnp.linalg.slogdet(prior.S_prior @ inverse)
        information = determinant / (2 * jnp.log(2.0).astype(x.dtype))
    left = residual if solved == forward else whitened(both, solved)
    # Whitened is the inverse of this, the root of S_obs, times what is measured.
    sigma = jnp.where(observation.present, jnp.asarray(observation.sigma, x.dtype), 1)
    root = sigma[:, None] * jnp.asarray(observation.root_correlation, x.dtype)
    errors = jnp.zeros((0, size), x.dtype)
    if about is not None:
        errors = jnp.abs(gain @ of_parameters).T * jnp.sqrt(jnp.diagonal(about.S_prior))[:, None]
    return Estimate(
        jacobian=root @ jacobian,
        posterior_covariance=covariance,
        noise_covariance=gain @ gain.T,
        smoothing_covariance=smoothing,
        parameter_error=errors,
        averaging_kernel=kernel,
        gain=jax.scipy.linalg.solve_triangular(root, gain.T, trans=1, lower=True).T,
        degrees_of_freedom=jnp.trace(kernel),
        information_content=information,
        residual=left,
        chi_square=jnp.sum(left**2),
        nonlinearity=_nonlinearity(whitened, both, residual, jacobian, covariance),
    )


def _nonlinearity(
    whitened: Any, both: Array, residual: Array, jacobian: Array, covariance: Array
) -> Float[Array, ""]:
    """Largest squared departure from the linear form along the axes of the covariance. [-]"""
    size = jacobian.shape[1]
    variances, axes = jnp.linalg.eigh(covariance)
    steps = (axes * jnp.sqrt(jnp.maximum(variances, 0))).T

    def departure(step: Array) -> Array:
        moved = whitened(both.at[:size].add(step))
        return jnp.sum((moved - residual - jacobian @ step) ** 2)

    return jnp.max(jax.lax.map(departure, jnp.concatenate([steps, -steps])))
