"""A forward model of retrievals that costs nothing, and pixels of it."""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from retrievals import Minimiser, Quantity, StateVector, Unbounded, measurement
from retrievals.declarations import aod_550, plume
from retrievals.kinds import BANDS
from retrievals.quantities import replaced


@dataclass(frozen=True)
class Veil:
    """Smoke that hides the ground it is mixed with.

    The state is the reflectance of the ground, by band.
    """

    vector: StateVector = plume("smoke")  # noqa: RUF009
    bands: tuple[str, ...] = BANDS
    plume_edges: bool | None = False

    def __call__(self, x, state):
        values = self.vector.values(x)
        aod_550 = values["aod_550"][..., None]
        if "brighter" in values:
            state = state + values["brighter"][..., None] * jnp.array([0.5, 1.0, 2.0], x.dtype)
        transmittance = jnp.exp(-aod_550 * jnp.array([1.4, 0.7, 0.3], x.dtype))
        return state * transmittance + (1 - transmittance) * jnp.array([0.35, 0.4, 0.3], x.dtype)


VEIL = Veil()
_BRIGHTER = Quantity("brighter", "1", "ground", "", Unbounded(), replaced, sigma=0.05, mean=0.0)
TWO = Veil(StateVector((aod_550("smoke"), _BRIGHTER)))
"""The same with the ground's brightness unknown, too."""

TIGHT = Minimiser(1e-8, 200, starts="prior")
"""Steps that end at the minimum; the same for all, so that one program serves them."""


@partial(jax.jit, static_argnums=0)
def seen(forward, x, ground):
    """What a veil shows at x: one program, and not one for every operation."""
    return forward(x, ground)


@partial(jax.jit, static_argnums=0)
def slopes(forward, x, ground):
    """Derivatives of that in one x (band, x)."""
    return jax.jacfwd(lambda x: forward(x, ground))(x)


def veiled_pixels():
    """Observations, states and true optical depths of pixels under a veil."""
    ground, truth = np.linspace(0.02, 0.2, 12)[:, None] * np.ones(3), np.geomspace(0.05, 2, 12)
    measured = np.asarray(seen(VEIL, VEIL.vector.x(truth), ground))
    return measurement(measured, BANDS), ground, truth
