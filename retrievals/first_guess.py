"""Where to begin: the state vectors at which a coarse scan of the cost has its minima.

Reflectance need not grow with optical depth: over bright ground and cloud, smoke darkens first and
brightens later or the reverse, and the cost then has several minima. The scan finds their basins.
"""

from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from abi_operator import State

from .forward import ForwardModel
from .observation import Observation
from .state_vector import StateVector


def guesses(vector: StateVector, state: State | None = None) -> Float[Array, "guess x"]:
    """State vectors of the scan: all combinations of the quantities' own `starts`.

    Those of the first quantity vary slowest. What has none begins at the mean of its prior, or as
    the state of the pixel holds it, kept inside its limits as the prior's mean is: at a limit x is
    infinite, and no minimisation comes back from there.
    """
    starts = [quantity.starts or (quantity.mean,) for quantity in vector.quantities]
    columns = zip(vector.quantities, zip(*product(*starts), strict=True), strict=True)
    values = []
    for quantity, column in columns:
        if column[0] is not None:
            values.append(np.array(column))
        elif state is not None:
            held = jnp.asarray(vector.held(state, quantity.name), float)
            values.append(quantity.transform.inside(held))
        else:
            raise ValueError(f"{quantity.name} begins as a state holds it; give the state.")
    return vector.x(*values)


def grid(vector: StateVector) -> tuple[int, ...]:
    """Number of guesses of each quantity."""
    return tuple(max(1, len(quantity.starts)) for quantity in vector.quantities)


def scan(
    forward: ForwardModel, observation: Observation, state: State
) -> tuple[Float[Array, " guess"], Float[Array, "guess x"]]:
    """Sum of squared whitened residuals of one pixel at each of its `guesses`. [-]"""
    starts = guesses(forward.vector, state)

    def cost(x: Float[Array, " x"]) -> Float[Array, ""]:
        return jnp.sum(observation.departure(forward, x, state) ** 2)

    return jax.lax.map(cost, starts), starts


def candidates(
    cost: Float[np.ndarray, "pixel guess"], shape: tuple[int, ...], num_starts: int
) -> tuple[np.ndarray, np.ndarray]:
    """Guesses of each pixel from which to begin, the most promising first.

    The first is the lowest. The second is the second lowest minimum along the first quantity, of
    whose values the best guess of the others counts. After them, and in place of a second minimum
    that is not there, comes the lowest of those that are no neighbours of the ones before: two
    steps away along some quantity, as long as there are such.

    Parameters
    ----------
    cost
        Of every guess.
    shape
        Number of guesses of each quantity.
    num_starts
        How many are wanted.

    Returns
    -------
    Guesses (pixel, start), and which pixels have a second minimum.
    """
    cost = np.nan_to_num(cost, nan=np.inf)
    num_guesses = cost.shape[1]
    rank = np.argsort(np.argsort(cost, axis=1), axis=1)
    where = np.stack(np.unravel_index(np.arange(num_guesses), shape))
    apart = np.abs(where[:, :, None] - where[:, None, :]).max(axis=0)
    second, several = _second_minimum(cost, shape)
    chosen = [np.argmin(cost, axis=1)]
    for k in range(1, min(num_starts, num_guesses)):
        nearest = np.min([apart[guess] for guess in chosen], axis=0)
        # Neighbours come last, and what is chosen already never.
        key = rank + num_guesses * np.maximum(2 - nearest, 0)
        found = np.argmin(key, axis=1)
        chosen.append(np.where(several, second, found) if k == 1 else found)
    return np.stack(chosen, axis=1), several


def _second_minimum(cost: np.ndarray, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Guess at the second lowest minimum along the first quantity, and where there is one."""
    by_first = cost.reshape(len(cost), shape[0], -1)
    others = np.argmin(by_first, axis=2)
    profile = np.min(by_first, axis=2)
    beyond = np.full((len(cost), 1), np.inf)
    padded = np.concatenate([beyond, profile, beyond], axis=1)
    minimal = (profile < padded[:, :-2]) & (profile <= padded[:, 2:])
    pixels = np.arange(len(cost))
    minimal[pixels, np.argmin(profile, axis=1)] = False
    second = np.argmin(np.where(minimal, profile, np.inf), axis=1)
    return second * by_first.shape[2] + others[pixels, second], minimal.any(axis=1)
