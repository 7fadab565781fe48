"""Retrieve many pixels: scan, minimise from the best starts, judge."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np

from abi_operator import State
from abi_operator.machine.sizes import chunk_of_pixels
from abi_operator.machine.speed import Kept

from .chunks import map_chunks, meanwhile
from .first_guess import candidates, guesses, scan
from .forward import ForwardModel
from .inverse import DEFAULT_MINIMISER, Inversion, Minimiser, invert
from .observation import Observation
from .quality import result_codes
from .state_vector import Prior

ROUND_STEPS = 8
"""Steps after which the pixels that need more of them continue together, in chunks of their own: a
chunk lasts as long as its slowest pixel."""


class Retrieved(NamedTuple):
    """Solution of each pixel and its result code."""

    inversion: Inversion
    codes: np.ndarray


def retrieve_pixels(
    forward: ForwardModel,
    observations: Observation,
    states: State,
    *,
    prior: Prior | None = None,
    minimiser: Minimiser = DEFAULT_MINIMISER,
    exact: bool = False,
) -> Retrieved:
    """Retrieve every pixel on its own.

    Parameters
    ----------
    forward
        The forward model, with enough doublings (`prepared`).
    observations, states
        What was measured and what is known, pixels leading.
    prior, minimiser
        See `invert`.
    exact
        See `result_codes`.
    """
    starts = np.asarray(guesses(forward))
    how = _in_rounds(forward, minimiser, prior, starts.dtype)
    invert_chunk = partial(_invert_chunk, *how)
    first = _first_chunk(observations, states, starts)
    with meanwhile(partial(_invert_chunk.prepare, *how, *first)):
        cost = map_chunks(partial(_scan_chunk, forward), observations, states)
    pixel, guess = candidates(cost)
    order = np.lexsort((pixel, guess))  # chunks of similar pixels, which take as many steps
    rows = pixel[order]
    observations, states = jax.tree.map(lambda x: np.asarray(x)[rows], (observations, states))
    solutions = _minimise(invert_chunk, minimiser, observations, states, starts[guess[order]])
    solutions = jax.tree.map(lambda x: x[np.argsort(order)], solutions)
    best, rival = _ranked(solutions, pixel, len(cost))
    codes = result_codes(forward.vector, best, rival, len(forward.bands), exact=exact)
    return Retrieved(best, codes)


def _in_rounds(
    forward: ForwardModel, minimiser: Minimiser, prior: Prior | None, dtype: Any
) -> tuple[tuple[ForwardModel, Minimiser], Prior | None]:
    """For some steps of a minimisation; the damping of Levenberg-Marquardt begins anew."""
    this_round = minimiser._replace(max_steps=min(ROUND_STEPS, minimiser.max_steps))
    prior = jax.tree.map(lambda x: np.asarray(x, dtype), prior)
    return (forward, this_round), prior


def _first_chunk(observations: Observation, states: State, starts: np.ndarray) -> tuple[Any, ...]:
    """Pixels for which the program that minimises is compiled while another one scans."""
    chunk = chunk_of_pixels()
    rows = np.minimum(np.arange(chunk), len(observations.sigma) - 1)
    some = jax.tree.map(lambda x: np.asarray(x)[rows], (observations, states))
    return *some, np.repeat(starts[:1], chunk, axis=0)


def _minimise(
    invert_chunk: Callable[..., Inversion],
    minimiser: Minimiser,
    observations: Observation,
    states: State,
    x_first: np.ndarray,
) -> Inversion:
    """Minimise in rounds."""
    solutions = map_chunks(invert_chunk, observations, states, x_first)
    for _ in range(ROUND_STEPS, minimiser.max_steps, ROUND_STEPS):
        rows = np.flatnonzero(~solutions.converged & np.isfinite(solutions.cost))
        if rows.size == 0:
            break
        chosen = jax.tree.map(lambda x, rows=rows: x[rows], (observations, states, solutions))
        *inputs, before = chosen
        after = map_chunks(invert_chunk, *inputs, before.x)
        after = eqx.tree_at(lambda s: s.num_steps, after, before.num_steps + after.num_steps)
        solutions = jax.tree.map(partial(_with_rows, rows), solutions, after)
    return solutions


def _with_rows(rows: np.ndarray, array: np.ndarray, values: np.ndarray) -> np.ndarray:
    array = array.copy()
    array[rows] = values
    return array


@Kept
def _scan_chunk(forward: ForwardModel, observations: Observation, states: State) -> jax.Array:
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

    def solve(observation: Observation, state: State, x: jax.Array) -> Inversion:
        return invert(forward, observation, state, x, prior, minimiser)

    return jax.vmap(solve)(observations, states, x_first)


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
