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
from .first_guess import candidates, grid, scan
from .forward import ForwardModel
from .input_checks import checked
from .inverse import DEFAULT_MINIMISER, Inversion, Minimiser, invert
from .observation import Observation
from .prior import Prior
from .quality import result_codes, same_solution
from .results import ResultCode

ROUND_STEPS = 8
"""Steps after which the pixels that need more of them continue together, in chunks of their own: a
chunk lasts as long as its slowest pixel."""


_UNSOLVED = (ResultCode.NOT_CONVERGED, ResultCode.NONFINITE, ResultCode.POOR_FIT)


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
    minimiser = minimiser.chosen(prior is not None)
    codes, observations, prior = checked(forward, observations, prior)
    how = _in_rounds(forward, minimiser)
    several = np.zeros(len(codes), bool)
    if minimiser.starts == "prior" and prior is not None:
        starts, guess = np.asarray(prior.x_prior)[:, None], np.zeros((len(codes), 1), int)
    else:
        first = _first_chunk(forward.vector.size, observations, states, prior)
        with meanwhile(partial(_invert_chunk.prepare, how, *first)):
            cost, starts = map_chunks(partial(_scan_chunk, forward), observations, states)
        guess, several = candidates(cost, grid(forward.vector), minimiser.max_starts)
    attempted = codes == ResultCode.SUCCESS
    if prior is None:  # as many unknowns as measurements: several solutions may fit exactly
        determined = observations.num_values <= forward.vector.size
    else:
        determined = np.zeros(len(codes), bool)

    def begin(pixel: np.ndarray, guess: np.ndarray) -> Inversion:
        order = np.lexsort((pixel, guess))  # chunks of similar pixels, which take as many steps
        rows = pixel[order]
        inputs = jax.tree.map(lambda x: np.asarray(x)[rows], (prior, observations, states))
        x_first = starts[rows, guess[order]]
        solutions = _minimise(partial(_invert_chunk, how), minimiser, inputs, x_first)
        return jax.tree.map(lambda x: x[np.argsort(order)], solutions)

    def judged(best: Inversion, other: Inversion) -> np.ndarray:
        return result_codes(forward.vector, best, other, observations.num_values, exact=exact)

    best = begin(np.arange(len(codes)), guess[:, 0])
    other = best
    for k in range(1, guess.shape[1]):
        again = determined | np.isin(judged(best, other), _UNSOLVED)
        rows = np.flatnonzero(attempted & (again | several if k == 1 else again))
        if rows.size:
            found = begin(rows, guess[rows, k])
            best, other = _ranked(best, other, found, rows)
    final = np.where(attempted, judged(best, other), codes).astype(np.int8)
    # Of bounds, and nothing else, nothing is known on the other side but the prior.
    bounded = (observations.num_values == 0) & (final == ResultCode.SUCCESS)
    final[bounded] = ResultCode.NOT_OBSERVABLE
    return Retrieved(best, final, other)


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
    best: Inversion, other: Inversion, found: Inversion, rows: np.ndarray
) -> tuple[Inversion, Inversion]:
    """The best solution and another one, after one more was found of some pixels.

    The other is the best of those that are not the same as the first; the first once more where
    there is none.
    """

    def some(solutions: Inversion) -> Inversion:
        return jax.tree.map(lambda x: x[rows], solutions)

    first, second = some(best), some(other)
    better = _rank(found) < _rank(first)
    # What is not the first any more competes with the second.
    new_first = _either(better, found, first)
    loser = _either(better, first, found)
    vacant = same_solution(second, first) | same_solution(second, new_first)
    taken = ~same_solution(loser, new_first) & (vacant | (_rank(loser) < _rank(second)))
    kept = _either(vacant, new_first, second)
    new_second = _either(taken, loser, kept)
    put = partial(_with_rows, rows)
    return jax.tree.map(put, best, new_first), jax.tree.map(put, other, new_second)


def _rank(solutions: Inversion) -> np.ndarray:
    """Cost of what has converged, and no other."""
    fine = solutions.converged & np.isfinite(solutions.cost)
    return np.where(fine, solutions.cost, np.inf)


def _either(choice: np.ndarray, one: Inversion, two: Inversion) -> Inversion:
    """Rows of one where chosen, and of the other elsewhere."""
    return jax.tree.map(
        lambda a, b: np.where(choice.reshape(-1, *[1] * (a.ndim - 1)), a, b), one, two
    )
