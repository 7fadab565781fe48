"""How much air is in each layer."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


def counted_pressure(
    pressure: Float[Array | np.ndarray, "level *batch"],
) -> Float[Array, "level *batch"]:
    """Pressure at the levels, 0 at the first: its steps are the air of the layers. [Pa]

    So air above the first level is counted in the uppermost layer, and the pressure of that level
    itself moves nothing that goes with the mass of air.

    Parameters
    ----------
    pressure
        At the levels, top first. [Pa]
    """
    below = jnp.asarray(pressure)[1:]
    return jnp.concatenate([jnp.zeros_like(below[:1]), below])
