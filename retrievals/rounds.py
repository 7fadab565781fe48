"""Minimise many pixels by one forward model, in rounds of a few steps."""

from functools import partial

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array

from abi_operator import State
from abi_operator.machine.sizes import chunk_of_pixels
from abi_operator.machine.speed import Kept

from .chunks import map_chunks, with_rows
from .forward import ForwardModel
from .inverse import Inversion, Minimiser, invert
from .observation import Observation
from .prior import Prior

ROUND_STEPS = 8
"""Steps after which the pixels that need more of them continue together, in chunks of their own: a
chunk lasts as long as its slowest pixel."""

Inputs = tuple[Prior | None, Observation, State]
"""Priors, measurements and states of pixels."""


def minimise(
    forward: ForwardModel, minimiser: Minimiser, inputs: Inputs, x_first: np.ndarray
) -> Inversion:
    """`invert` every pixel.

    Parameters
    ----------
    forward, minimiser
        As of `invert`.
    inputs, x_first
        The pixels, and where each begins. [-]
    """
    invert_chunk = partial(_invert_chunk, _in_rounds(forward, minimiser))
    solutions = map_chunks(invert_chunk, *inputs, x_first)
    for _ in range(ROUND_STEPS, minimiser.max_steps, ROUND_STEPS):
        rows = np.flatnonzero(~solutions.converged & np.isfinite(solutions.cost))
        if rows.size == 0:
            break
        *some, before = jax.tree.map(lambda x, rows=rows: x[rows], (*inputs, solutions))
        after = map_chunks(invert_chunk, *some, before.x)
        after = eqx.tree_at(lambda s: s.num_steps, after, before.num_steps + after.num_steps)
        solutions = jax.tree.map(partial(with_rows, rows), solutions, after)
    return solutions


def prepare_to_minimise(
    forward: ForwardModel, minimiser: Minimiser, inputs: Inputs, x: np.ndarray
) -> None:
    """Compile what `minimise` needs, to be done beside something else."""
    rows = np.minimum(np.arange(chunk_of_pixels()), len(x) - 1)
    some = jax.tree.map(lambda y: np.asarray(y)[rows], (*inputs, x))
    _invert_chunk.prepare(_in_rounds(forward, minimiser), *some)


def _in_rounds(forward: ForwardModel, minimiser: Minimiser) -> tuple[ForwardModel, Minimiser]:
    """For some steps of a minimisation; the damping of Levenberg-Marquardt begins anew."""
    return forward, minimiser._replace(max_steps=min(ROUND_STEPS, minimiser.max_steps))


@Kept
def _invert_chunk(
    how: tuple[ForwardModel, Minimiser],
    prior: Prior | None,
    observations: Observation,
    states: State,
    x_first: jax.Array,
) -> Inversion:
    forward, minimiser = how

    def solve(prior: Prior | None, observation: Observation, state: State, x: Array) -> Inversion:
        return invert(forward, observation, state, x, prior, minimiser)

    return jax.vmap(solve)(prior, observations, states, x_first)
