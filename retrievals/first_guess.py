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
    the state of the pixel holds it.
    """
    starts = [quantity.starts or (quantity.mean,) for quantity in vector.quantities]
    columns = zip(vector.quantities, zip(*product(*starts), strict=True), strict=True)
    values = []
    for quantity, column in columns:
        if column[0] is not None:
            values.append(np.array(column))
        elif state is not None:
            values.append(vector.held(state, quantity.name))
        else:
            raise ValueError(f"{quantity.name} begins as a state holds it; give the state.")
    return vector.x(*values)


def num_starts(vector: StateVector) -> int:
    """Number of guesses of the first quantity."""
    return max(1, len(vector.quantities[0].starts))


def scan(
    forward: ForwardModel, observation: Observation, state: State
) -> tuple[Float[Array, " guess"], Float[Array, "guess x"]]:
    """Sum of squared whitened residuals of one pixel at each of its `guesses`. [-]"""
    starts = guesses(forward.vector, state)

    def cost(x: Float[Array, " x"]) -> Float[Array, ""]:
        return jnp.sum(observation.residual(forward(x, state)) ** 2)

    return jax.lax.map(cost, starts), starts


def candidates(
    cost: Float[np.ndarray, "pixel guess"], num_first: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Pixel and guess of the lowest and, where there is another, second lowest minimum.

    The lowest of every pixel come first, in the order of pixels.

    Parameters
    ----------
    cost
        Of every guess.
    num_first
        Number of guesses of the first quantity; of those of the others the best counts. None where
        there is no other.
    """
    cost = np.nan_to_num(cost, nan=np.inf)
    by_first = cost.reshape(len(cost), num_first or cost.shape[1], -1)
    others = np.argmin(by_first, axis=2)
    cost = np.min(by_first, axis=2)
    beyond = np.full((len(cost), 1), np.inf)
    padded = np.concatenate([beyond, cost, beyond], axis=1)
    minimal = (cost < padded[:, :-2]) & (cost <= padded[:, 2:])
    best = np.argmin(cost, axis=1)
    pixels = np.arange(len(cost))
    minimal[pixels, best] = False
    second = np.argmin(np.where(minimal, cost, np.inf), axis=1)
    several = minimal.any(axis=1)
    pixel = np.concatenate([pixels, pixels[several]])
    first = np.concatenate([best, second[several]])
    return pixel, first * by_first.shape[2] + others[pixel, first]
