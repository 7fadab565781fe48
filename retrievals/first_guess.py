"""Where to begin: the optical depths at which a coarse scan of the cost has its minima.

Reflectance need not grow with optical depth: over bright ground and cloud, smoke darkens first and
brightens later or the reverse, and the cost then has several minima. The scan finds their basins.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from abi_operator import State

from .forward import ForwardModel
from .observation import Observation

SCANNED_AOD_550 = (0.02, 0.06, 0.15, 0.35, 0.8, 1.8, 4.5)
"""Optical depths of the scan; those above the limit of the state vector are left out. [-]"""

FIRST_SSA_SHIFT = -0.4
"""Shift of the ssa at which scan and minimisation begin, if it is retrieved: smoke with half as
much absorption again, relative to scattering, as the scenario specifies. [-]"""


def guesses(forward: ForwardModel) -> Float[Array, "guess x"]:
    """State vectors of the scan."""
    aod_550 = [aod for aod in SCANNED_AOD_550 if aod < forward.vector.aod_limit]
    return forward.vector.x(np.array(aod_550), FIRST_SSA_SHIFT)


def scan(forward: ForwardModel, observation: Observation, state: State) -> Float[Array, " guess"]:
    """Sum of squared whitened residuals of one pixel at each of the `guesses`. [-]"""

    def cost(x: Float[Array, " x"]) -> Float[Array, ""]:
        departure = forward(x, state) - observation.reflectance_factor
        return jnp.sum((departure / observation.sigma) ** 2)

    return jax.lax.map(cost, guesses(forward))


def candidates(cost: Float[np.ndarray, "pixel guess"]) -> tuple[np.ndarray, np.ndarray]:
    """Pixel and guess of the lowest and, where there is another, second lowest minimum.

    The lowest of every pixel come first, in the order of pixels.
    """
    cost = np.nan_to_num(cost, nan=np.inf)
    beyond = np.full((len(cost), 1), np.inf)
    padded = np.concatenate([beyond, cost, beyond], axis=1)
    minimal = (cost < padded[:, :-2]) & (cost <= padded[:, 2:])
    best = np.argmin(cost, axis=1)
    pixels = np.arange(len(cost))
    minimal[pixels, best] = False
    second = np.argmin(np.where(minimal, cost, np.inf), axis=1)
    several = minimal.any(axis=1)
    return np.concatenate([pixels, pixels[several]]), np.concatenate([best, second[several]])
