"""Retrieve many pixels: scan, minimise from the best starts, judge."""

from functools import partial
from typing import NamedTuple

import jax
import numpy as np

from abi_operator import State
from abi_operator.machine.speed import Kept

from .chunks import map_chunks, meanwhile, with_rows
from .coarse_to_fine import coarse, minimise_from_coarse
from .first_guess import candidates, grid, scan
from .forward import ForwardModel
from .input_checks import checked
from .inverse import DEFAULT_MINIMISER, Inversion, Minimiser
from .last_steps import prepare_to_finish
from .observation import Observation
from .prior import Prior
from .quality import result_codes, same_solution
from .results import ResultCode
from .rounds import minimise, prepare_to_minimise

# Below this the first steps are by the whole forward model, too. [-]
_TOLERANCE_OF_COARSE = 1e-2

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
    inputs = prior, observations, states
    first_steps = _coarse(forward, minimiser, prior)
    starts, guess, several = _starts(forward, first_steps, minimiser, inputs)
    attempted = codes == ResultCode.SUCCESS
    bounded = np.asarray(observations.present).sum(axis=-1) > observations.num_values
    if prior is None:  # as many unknowns as measurements: several solutions may fit exactly
        determined = observations.num_values <= forward.vector.size
    else:
        determined = np.zeros(len(codes), bool)

    def begin(pixel: np.ndarray, guess: np.ndarray) -> Inversion:
        order = np.lexsort((pixel, guess))  # chunks of similar pixels, which take as many steps
        rows = pixel[order]
        some = jax.tree.map(lambda x: np.asarray(x)[rows], inputs)
        x_first = starts[rows, guess[order]]
        if first_steps is None:
            solutions = minimise(forward, minimiser, some, x_first)
        else:
            solutions = minimise_from_coarse(first_steps, forward, minimiser, some, x_first)
        return jax.tree.map(lambda x: x[np.argsort(order)], solutions)

    def judged(best: Inversion, other: Inversion) -> np.ndarray:
        values = observations.num_values
        return result_codes(forward.vector, best, other, values, exact=exact, bounded=bounded)

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
    alone = (observations.num_values == 0) & (final == ResultCode.SUCCESS)
    final[alone] = ResultCode.NOT_OBSERVABLE
    return Retrieved(best, final, other)


def _coarse(
    forward: ForwardModel, minimiser: Minimiser, prior: Prior | None
) -> ForwardModel | None:
    """The forward model of the first steps; None where all of them are by the whole."""
    wanted = minimiser.coarse_to_fine and (minimiser.tolerance or 0.0) >= _TOLERANCE_OF_COARSE
    return coarse(forward) if wanted and prior is not None else None


def _starts(
    forward: ForwardModel,
    first_steps: ForwardModel | None,
    minimiser: Minimiser,
    inputs: tuple[Prior | None, Observation, State],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where pixels may begin, in which order, and which of them have a second minimum."""
    prior, observations, states = inputs
    num_pixels = len(observations.sigma)
    if minimiser.starts == "prior" and prior is not None:
        none = np.zeros(num_pixels, bool)
        return np.asarray(prior.x_prior)[:, None], np.zeros((num_pixels, 1), int), none
    x = np.zeros((num_pixels, forward.vector.size), observations.sigma.dtype)
    if first_steps is None:
        prepare = partial(prepare_to_minimise, forward, minimiser, inputs, x)
    else:
        prepare = partial(prepare_to_finish, forward, inputs, x)
    with meanwhile(prepare):
        scan = partial(_scan_chunk, first_steps or forward)
        cost, starts = map_chunks(scan, observations, states)
    return starts, *candidates(cost, grid(forward.vector), minimiser.max_starts)


@Kept
def _scan_chunk(
    forward: ForwardModel, observations: Observation, states: State
) -> tuple[jax.Array, jax.Array]:
    return jax.vmap(partial(scan, forward))(observations, states)


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
    put = partial(with_rows, rows)
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
