"""The operator under `optimistix.minimise`: any function of its output has a gradient.

    python examples/minimise.py

What is minimised is one's own: here the sum of squares of an optimal estimate of two unknowns, as a
number only. That it is a sum of squares `retrievals.invert` knows, and takes fewer steps.
"""

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from smoky_pixels import BANDS, smoky_pixels

from retrievals import ForwardModel, measurement
from retrievals.declarations import plume

TRUTH = 0.9, 0.4


def study(num_streams: int = 8) -> tuple[np.ndarray, int]:
    """Optical depth and shift of the single-scattering albedo at the minimum, and the steps."""
    vector = plume("smoke", ssa=True)
    state = jax.tree.map(lambda x: jnp.asarray(x[0]), smoky_pixels(1))
    forward = ForwardModel(vector, BANDS, num_streams, num_doublings=3, gases=())
    seen = measurement(forward(vector.x(*TRUTH), state), BANDS)
    x_prior, sigma = vector.x(0.4, 0.0), jnp.array([1.5, 0.7])

    def cost(x: jax.Array, _: None) -> jax.Array:
        departure = seen.departure(forward, x, state)
        return jnp.sum(departure**2) + jnp.sum(((x - x_prior) / sigma) ** 2)

    found = optx.minimise(cost, optx.BFGS(rtol=1e-6, atol=1e-6), x_prior, throw=False)
    values = vector.values(found.value)
    return np.stack(list(values.values())), int(found.stats["num_steps"])


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    (aod_550, shift), steps = study()
    print(f"optical depth {aod_550:.4f}, in truth {TRUTH[0]}; shift of the logit of the ", end="")
    print(f"single-scattering albedo {shift:.3f}, in truth {TRUTH[1]}; {steps} steps")
