"""Which bands tell of smoke: degrees of freedom and information, band by band.

    python examples/information_content.py

The Jacobians of all bands are computed once; which bands are used is then linear algebra (Rodgers
2000, doi:10.1142/3171, section 2.5): with k_b its row of the Jacobian, each band b adds
k_b k_b^T / sigma_b^2 to the inverse of the posterior covariance.
"""

import jax
import numpy as np
from smoky_pixels import BANDS, smoky_pixels

from retrievals import ForwardModel, measurement, prepared
from retrievals.declarations import plume
from retrievals.optimal_estimation import estimates


def study(num_streams: int = 8) -> list[tuple[str, float, float]]:
    """The most telling band, then the one that adds most to it, and so on, in the mean of pixels.

    With each band the degrees of freedom of all up to it, and their information [bit].
    """
    states = smoky_pixels(12)
    vector = plume("smoke", ssa=True)
    forward = prepared(ForwardModel(vector, BANDS, num_streams, gases=()), states)
    x, prior = np.broadcast_to(vector.x(0.8, 0.0), (12, 2)), vector.prior()
    observation = measurement(forward(x, states), BANDS)
    found = estimates(forward, observation, states, x, prior)
    whitened = found.jacobian / np.asarray(observation.sigma)[..., None]
    each = np.einsum("pbx,pby->bpxy", whitened, whitened)
    S_prior = np.asarray(prior.S_prior)

    def worth(bands: list[int]) -> tuple[float, float]:
        inverse = np.linalg.inv(S_prior) + each[bands].sum(axis=0)
        degrees = 2 - np.trace(np.linalg.solve(inverse, np.linalg.inv(S_prior)), axis1=1, axis2=2)
        bits = np.linalg.slogdet(S_prior @ inverse)[1] / (2 * np.log(2))
        return float(degrees.mean()), float(bits.mean())

    chosen, told = [], []
    while len(chosen) < len(BANDS):
        others = [k for k in range(len(BANDS)) if k not in chosen]
        chosen.append(max(others, key=lambda k: worth([*chosen, k])[1]))
        told.append((BANDS[chosen[-1]], *worth(chosen)))
    return told


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    print("bands, each with those above it | degrees of freedom | information [bit]")
    for band, degrees, bits in study():
        print(f"{band} | {degrees:.2f} | {bits:.1f}")
