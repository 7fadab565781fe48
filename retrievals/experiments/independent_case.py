"""A retrieval whose truth is of another model than the inversion: what its pixels are made of."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from abi_operator import State

from ..prior import Prior
from ..state_vector import StateVector

STRIPS = 5
"""Columns of 400 m in a pixel. [-]"""
RAISED = 500.0
"""How much higher than believed a plume is. [m]"""
UNEVEN_GROUND = 0.15
"""Relative standard deviation of the albedo among the strips. [-]"""

Reported = tuple[Float[np.ndarray, "quantity pixel"], Float[np.ndarray, "quantity pixel"]]
"""Values, and their posterior standard deviations."""


class Drawn(NamedTuple):
    """Pixels as they are, and as they are believed.

    Parameters
    ----------
    cells
        The strips of all pixels, those of a pixel side by side.
    believed
        The pixels, without the quantities that are retrieved.
    x
        The truth in the words of the inversion, (pixel, x). [-]
    truth
        What is to be found, (quantity, pixel).
    """

    cells: State
    believed: State
    x: np.ndarray
    truth: np.ndarray


class Case(NamedTuple):
    """A retrieval, and how its pixels are drawn.

    Parameters
    ----------
    bands, gases, vector, prior
        Of the inversion; the truth has the same bands and gases.
    quantities
        What is scored.
    draw
        From a generator and the number of pixels.
    report
        From solutions and their covariances, (pixel, x) and (pixel, x, x), and the pixels as they
        are believed.
    """

    bands: tuple[str, ...]
    gases: tuple[str, ...]
    vector: StateVector
    prior: Prior
    quantities: tuple[str, ...]
    draw: Callable[[np.random.Generator, int], Drawn]
    report: Callable[[np.ndarray, np.ndarray, State], Reported]


def uneven(rng: np.random.Generator, num_pixels: int, spread: float) -> np.ndarray:
    """Positive factors of the strips of pixels, whose mean is 1. [-]"""
    factors = np.exp(spread * rng.standard_normal((num_pixels, STRIPS)))
    return factors / factors.mean(axis=1, keepdims=True)


def as_retrieved(
    vector: StateVector, x: np.ndarray, covariance: np.ndarray, believed: State
) -> Reported:
    """A `Case.report` of the quantities of a state vector as they are; the state adds nothing."""
    variance = np.diagonal(covariance, axis1=-2, axis2=-1)
    values = vector.values(jnp.asarray(x))
    sigma = np.asarray(vector.slopes(jnp.asarray(x))) * np.sqrt(variance)
    return np.stack([np.asarray(values[name]) for name in vector.names]), sigma.T
