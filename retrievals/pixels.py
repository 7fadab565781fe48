"""Retrieve many pixels: scan, minimise from the best starts, judge."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array

from abi_operator import State
from abi_operator.machine.sizes import chunk_of_pixels
from abi_operator.machine.speed import Kept

from .chunks import map_chunks, meanwhile
from .first_guess import candidates, num_starts, scan
from .forward import ForwardModel
from .input_checks import checked
from .inverse import DEFAULT_MINIMISER, Inversion, Minimiser, invert
from .observation import Observation
from .prior import Prior
from .quality import result_codes
from .results import ResultCode

ROUND_STEPS = 8
"""Steps after which the pixels that need more of them continue together, in chunks of their own: a
chunk lasts as long as its slowest pixel."""


class Retrieved(NamedTuple):
    """Solution of each pixel and its result code, and the other minimum that was found.

    The latter is the solution once more where there was none.
    """

    inversion: Inversion
    codes: np.ndarray
    other: Inversion


def retrieve_pixels(
    forward: ForwardModel,
    observations: Observation,
    states: State,
    *,
    prior: Prior | None = None,
    minimiser: Minimiser = DEFAULT_MINIMISER,
    exact: bool = False,
) -> Retrieved:
    """Retrieve every pixel on its own; one that cannot be retrieved spoils no other.

    Parameters
    ----------
    forward
        The forward model, with enough doublings (`prepared`).
    observations, states
        What was measured and what is known, pixels leading.
    prior
        What is known of x beforehand, of all pixels or of each; None for nothing.
    minimiser
        See `invert`.
    exact
        See `result_codes`.

    Raises
    ------
    ValueError
        Where there are no pixels, measurements are not of the bands, are in percent, or the prior
        is none of this state vector.
    """
    codes, observations, prior = checked(forward, observations, prior)
    starts_of = partial(_scan_chunk, forward)
    how = _in_rounds(forward, minimiser)
    first = _first_chunk(forward.vector.size, observations, states, prior)
    with meanwhile(partial(_invert_chunk.prepare, how, *first)):
        cost, starts = map_chunks(starts_of, observations, states)
    pixel, guess = candidates(cost, num_starts(forward.vector))
    order = np.lexsort((pixel, guess))  # chunks of similar pixels, which take as many steps
    rows = pixel[order]
    inputs = jax.tree.map(lambda x: np.asarray(x)[rows], (prior, observations, states))
    solutions = _minimise(
        partial(_invert_chunk, how), minimiser, inputs, starts[rows, guess[order]]
    )
    solutions = jax.tree.map(lambda x: x[np.argsort(order)], solutions)
    best, rival = _ranked(solutions, pixel, len(cost))
    judged = result_codes(forward.vector, best, rival, observations.num_values, exact=exact)
    attempted = codes == ResultCode.SUCCESS
    return Retrieved(best, np.where(attempted, judged, codes).astype(np.int8), rival)


def _in_rounds(forward: ForwardModel, minimiser: Minimiser) -> tuple[ForwardModel, Minimiser]:
    """For some steps of a minimisation; the damping of Levenberg-Marquardt begins anew."""
    return forward, minimiser._replace(max_steps=min(ROUND_STEPS, minimiser.max_steps))


def _first_chunk(
    size: int, observations: Observation, states: State, prior: Prior | None
) -> tuple[Any, ...]:
    """Pixels for which the program that minimises is compiled while another one scans."""
    chunk = chunk_of_pixels()
    rows = np.minimum(np.arange(chunk), len(observations.sigma) - 1)
    some = jax.tree.map(lambda x: np.asarray(x)[rows], (prior, observations, states))
    return *some, np.zeros((chunk, size), observations.sigma.dtype)


def _minimise(
    invert_chunk: Callable[..., Inversion],
    minimiser: Minimiser,
    inputs: tuple[Prior | None, Observation, State],
    x_first: np.ndarray,
) -> Inversion:
    """Minimise in rounds."""
    solutions = map_chunks(invert_chunk, *inputs, x_first)
    for _ in range(ROUND_STEPS, minimiser.max_steps, ROUND_STEPS):
        rows = np.flatnonzero(~solutions.converged & np.isfinite(solutions.cost))
        if rows.size == 0:
            break
        *some, before = jax.tree.map(lambda x, rows=rows: x[rows], (*inputs, solutions))
        after = map_chunks(invert_chunk, *some, before.x)
        after = eqx.tree_at(lambda s: s.num_steps, after, before.num_steps + after.num_steps)
        solutions = jax.tree.map(partial(_with_rows, rows), solutions, after)
    return solutions


def _with_rows(rows: np.ndarray, array: np.ndarray, values: np.ndarray) -> np.ndarray:
    array = array.copy()
    array[rows] = values
    return array


@Kept
def _scan_chunk(
    forward: ForwardModel, observations: Observation, states: State
) -> tuple[jax.Array, jax.Array]:
    return jax.vmap(partial(scan, forward))(observations, states)


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


def _ranked(
    solutions: Inversion, pixel: np.ndarray, num_pixels: int
) -> tuple[Inversion, Inversion]:
    """Solution of lower cost and the other one, of every pixel; the same twice if it has one."""
    first = np.arange(num_pixels)
    second = first.copy()
    second[pixel[num_pixels:]] = np.arange(num_pixels, len(pixel))
    rank = np.where(solutions.converged & np.isfinite(solutions.cost), solutions.cost, np.inf)
    swap = rank[second] < rank[first]
    best, rival = np.where(swap, second, first), np.where(swap, first, second)
    return jax.tree.map(lambda x: x[best], solutions), jax.tree.map(lambda x: x[rival], solutions)
