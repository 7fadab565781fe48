"""Our exact Jacobian in pyOptimalEstimation (`userJacobian`), its diagnostics beside ours.

    pip install pyOptimalEstimation
    python examples/user_jacobian.py

M. Maahn et al., "Optimal Estimation Retrievals and Their Uncertainties", Bull. Amer. Meteor. Soc.,
101, E1512-E1523, 2020, doi:10.1175/BAMS-D-19-0027.1.
"""

import jax
import numpy as np
import pyOptimalEstimation as pyOE
from smoky_pixels import BANDS, smoky_pixels

from retrievals import ForwardModel, measurement, prepared
from retrievals.declarations import plume
from retrievals.inverse import value_and_jacobian
from retrievals.optimal_estimation import Estimate, estimates


def study(num_pixels: int = 20, num_streams: int = 8) -> tuple[list, Estimate]:
    """Retrievals by pyOptimalEstimation, and our diagnostics of what they found."""
    rng, states = np.random.default_rng(0), smoky_pixels(num_pixels)
    vector = plume("smoke", ssa=True)
    prior = vector.prior()
    forward = prepared(ForwardModel(vector, BANDS, num_streams, gases=()), states)
    truth = prior.x_prior + 0.3 * rng.standard_normal((num_pixels, 2))
    seen = np.asarray(forward(truth, states))
    observation = measurement(seen + 0.003 * rng.standard_normal(seen.shape), BANDS)
    both = jax.jit(lambda x, state: value_and_jacobian(lambda x: forward(x, state), x))
    found = []
    for index in range(num_pixels):
        state = jax.tree.map(lambda leaf, index=index: leaf[index], states)
        oe = pyOE.optimalEstimation(
            list(vector.names),
            prior.x_prior,
            prior.S_prior,
            list(BANDS),
            observation.measured[index],
            np.diag(observation.sigma[index] ** 2),
            lambda x, state=state: np.asarray(both(x.to_numpy(), state)[0]),
            userJacobian=lambda x, *_, state=state: np.asarray(both(x.to_numpy(), state)[1]),
            gammaFactor=[100.0, 10.0, 3.0],  # damped at first
            convergenceFactor=1e3,
            verbose=False,
        )
        oe.doRetrieval(maxIter=30)
        found.append(oe)
    x = np.stack([oe.x_i[oe.convI].to_numpy() for oe in found])
    return found, estimates(forward, observation, states, x, prior)


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    print("degrees of freedom, theirs and ours | information, theirs and ours [bit]")
    theirs, ours = study()
    for k, oe in enumerate(theirs):
        print(f"{oe.dgf:.6f} {ours.degrees_of_freedom[k]:.6f}", end=" | ")
        print(f"{oe.H_i[oe.convI] / np.log(2):.6f} {ours.information_content[k]:.6f}")
