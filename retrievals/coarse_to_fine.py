r"""The first steps by a coarse forward model, the last ones by the whole: for pixels with a prior.

Most of a minimisation need not be exact: only where it ends counts. So it begins with a forward
model F' of few streams, whose minimum, :math:`z_0`, is some posterior standard deviations at most
away from that of F. There F is evaluated once without slopes, for a step with those of F' (z is x
whitened by its prior, and stands among the residuals r),

.. math:: z_1 = z_0 - (J'^T J')^{-1} J'^T r(z_0),

and at :math:`z_1` with its own, for the last step, of Gauss and Newton, and for the posterior
covariance. A pixel whose last step is small has converged; others take one more with the slopes
that they have, or damped ones.
"""

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from abi_operator import State
from abi_operator.machine.speed import Kept

from .chunks import map_chunks, meanwhile, with_rows
from .forward import ForwardModel
from .inverse import Inversion, Minimiser, Pixel
from .last_steps import (
    FEWEST_STEPS,
    chunk_size,
    finish,
    in_sigmas,
    prepare_chord,
    prepare_to_finish,
)
from .observation import Observation
from .prior import Prior
from .rounds import minimise

COARSE_STREAMS = 4
"""Streams of the coarse forward model, whose minimum is a posterior standard deviation or two away
from that of 8 streams: near enough for a step with its slopes, too far to be the last."""

COARSE_BUDGET = 1e-3
"""Its error budget: small beside what so few streams leave. [-]"""

_MOST_COARSE = 6
"""Evaluations of the coarse forward model; after each the pixels that need more go on together."""

# The coarse minimum is near enough after a step of so many posterior standard deviations; and a
# step from round to round is no longer than one of the prior.
_NEAR, _LONGEST = 1.0, 1.0


class Begun(NamedTuple):
    """Where a minimisation of the coarse forward model is.

    Parameters
    ----------
    x
        Where to go on. [-]
    jacobian
        Of all residuals in z, at the last evaluation, from which x is a step. [-]
    num_steps
        Evaluations. [-]
    near
        Whether x is the minimum, nearly.
    """

    x: Float[Array | np.ndarray, "*batch x"]
    jacobian: Float[Array | np.ndarray, "*batch residual x"]
    num_steps: Int[Array | np.ndarray, "*batch"]
    near: Bool[Array | np.ndarray, "*batch"]


def coarse(forward: ForwardModel) -> ForwardModel | None:
    """The forward model of the first steps; None where it would be no cheaper, or is not known."""
    if not isinstance(forward, ForwardModel) or forward.num_streams <= COARSE_STREAMS:
        return None
    return replace(forward, num_streams=COARSE_STREAMS, error_budget=COARSE_BUDGET)


def minimise_coarsely(
    forward: ForwardModel,
    minimiser: Minimiser,
    inputs: tuple[Prior, Observation, State],
    x_first: np.ndarray,
) -> Begun:
    """Minimise the forward model of the first steps, of many pixels.

    Parameters
    ----------
    forward, minimiser
        `coarse` and as of `invert`; two of the evaluations are left for the last steps.
    inputs
        Priors, measurements and states of the pixels.
    x_first
        Where to begin. [-]
    """
    begin, chunk = partial(_begin_chunk, forward), chunk_size(len(x_first))
    begun = map_chunks(begin, *inputs, x_first, chunk=chunk)
    for _ in range(1, min(_MOST_COARSE, minimiser.max_steps - FEWEST_STEPS)):
        rows = np.flatnonzero(~begun.near & np.isfinite(begun.x).all(axis=1))
        if rows.size == 0:
            break
        *some, before = jax.tree.map(lambda x, rows=rows: x[rows], (*inputs, begun))
        after = map_chunks(begin, *some, before.x, chunk=chunk)
        after = after._replace(num_steps=before.num_steps + after.num_steps)
        begun = jax.tree.map(partial(with_rows, rows), begun, after)
    return begun


def minimise_from_coarse(
    first_steps: ForwardModel,
    forward: ForwardModel,
    minimiser: Minimiser,
    inputs: tuple[Prior, Observation, State],
    x_first: np.ndarray,
) -> Inversion:
    """Minimise every pixel.

    Parameters
    ----------
    first_steps, forward
        The coarse forward model and the whole one.
    minimiser
        As of `invert`.
    inputs, x_first
        Priors, measurements and states of the pixels; where each begins. [-]
    """
    with meanwhile(partial(prepare_to_finish, forward, inputs, x_first)):
        begun = minimise_coarsely(first_steps, minimiser, inputs, x_first)
        x, jacobian = np.asarray(begun.x), np.asarray(begun.jacobian)
        prepare_chord(forward, inputs, x, jacobian)
    num_steps = np.asarray(begun.num_steps)
    solutions = finish(forward, inputs, x, jacobian, num_steps, minimiser.max_steps)
    rows = np.flatnonzero(~np.isfinite(solutions.cost))  # few streams may not have been a number
    if rows.size == 0:
        return solutions
    *some, before = jax.tree.map(lambda x: x[rows], (*inputs, solutions))
    after = minimise(forward, minimiser, (some[0], some[1], some[2]), x_first[rows])
    after = eqx.tree_at(lambda s: s.num_steps, after, before.num_steps + after.num_steps)
    return jax.tree.map(partial(with_rows, rows), solutions, after)


@Kept
def _begin_chunk(
    forward: ForwardModel,
    prior: Prior,
    observations: Observation,
    states: State,
    x_first: jax.Array,
) -> Begun:
    def of_one(prior: Prior, observation: Observation, state: State, x: Array) -> Begun:
        pixel = Pixel.of(forward, observation, state, x, prior)
        here = pixel.linear(pixel.z(x))
        step = here.step
        length = jnp.sqrt(jnp.sum(step**2))
        step = step * jnp.minimum(1, _LONGEST / jnp.where(length > 0, length, 1))
        near = in_sigmas(here.jacobian, here.step) < _NEAR
        return Begun(pixel.x(here.z + step), here.jacobian, jnp.ones((), int), near)

    return jax.vmap(of_one)(prior, observations, states, x_first)
