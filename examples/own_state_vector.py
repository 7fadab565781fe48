"""A state vector of one's own: smoke, and a factor by which the ground is brighter than assumed.

    python examples/own_state_vector.py

Nothing but the declaration is new: where in a State the number belongs, what is done with it there,
between which limits it lies, and what is known of it beforehand.
"""

import jax
import numpy as np
from smoky_pixels import BANDS, smoky_pixels

from retrievals import (
    Bounded,
    ForwardModel,
    Minimiser,
    Quantity,
    StateVector,
    measurement,
    prepared,
    retrieve_pixels,
)
from retrievals.declarations import aod_550
from retrievals.quantities import scaled

WORDS = "factor of the ground's albedo"
GROUND = Quantity("ground", "1", WORDS, "albedo", Bounded(0.2, 5.0, True), scaled, 0.5, mean=1.0)


def study(num_streams: int = 8) -> dict[str, np.ndarray]:
    """Truth, retrieval and posterior sigma of both quantities, at twelve pixels."""
    vector = StateVector((aod_550("smoke"), GROUND))
    states = smoky_pixels(12)
    truth = np.geomspace(0.2, 1.0, 12), np.linspace(0.7, 1.5, 12)
    forward = prepared(ForwardModel(vector, BANDS, num_streams, gases=()), states)
    seen = measurement(forward(vector.x(*truth), states), BANDS)
    how = Minimiser(starts="prior")
    found = retrieve_pixels(forward, seen, states, prior=vector.prior(), minimiser=how).inversion
    sigma = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2)) * vector.slopes(found.x)
    values = np.stack(list(vector.values(found.x).values()), axis=1)
    return {"truth": np.stack(truth, axis=1), "retrieved": values, "sigma": np.asarray(sigma)}


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    for rows in zip(*study().values(), strict=True):
        for name, true, value, sigma in zip(("aod_550", "ground"), *rows, strict=True):
            print(f"{name} {value:.3f} +- {sigma:.3f}, in truth {true:.3f}", end="   ")
        print()
