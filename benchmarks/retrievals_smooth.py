"""An image retrieved as a whole beside the same pixel by pixel.

    python benchmarks/retrievals_smooth.py [--size 64] [--streams 4] [--length 4] [--seed 1]

Smoke over a square of pixels, each with a ground, air and geometry of its own
(`retrievals_pixels.py`); optical depth and single-scattering albedo are fields drawn from the prior
(0.7 in ln aod, 0.5 in the logit of ssa, correlation length as given) on a square twice as wide.
Measured are C01 C02 C03 with the imager's noise. Both retrievals have the prior of single pixels;
the joint one knows the correlation as well. Printed are root mean square errors, in x and in
optical depth, coverage by one posterior sigma, the gradient of the joint cost against central
differences, times, and the most memory that the process had.
"""

import argparse
import resource
import time

import jax
import jax.numpy as jnp
import numpy as np
from retrievals_pixels import random_states

from abi_operator.machine.speed import use_compilation_cache, use_compiler_flags
from retrievals import ForwardModel, Prior, ResultCode, measurement, prepared, retrieve_pixels
from retrievals.declarations import plume
from retrievals.input_checks import checked
from retrievals.smooth import (
    joint_cost,
    joint_gradient,
    linearised,
    retrieve_smooth,
    smoothness,
)

BANDS = ("C01", "C02", "C03")
SIGMA = np.array([0.7, 0.5])


def field(rng, size, length):
    """A field of the prior's correlation and unit variance, (y, x), by Fourier series."""
    wide = 2 * size
    wave = 2 - 2 * np.cos(2 * np.pi * np.arange(wide) / wide)
    amplitude = 1 / (1 + length**2 * (wave[:, None] + wave))
    amplitude /= np.sqrt(np.mean(amplitude**2))
    white = np.fft.fft2(rng.standard_normal((wide, wide)))
    return np.fft.ifft2(amplitude * white).real[:size, :size]


def gradient_error(forward, observation, states, prior, smooth, rng):
    """Relative difference of the joint gradient from central differences, along a random line."""
    _, usable, own = checked(forward, observation, prior)
    z, along = rng.standard_normal((2, len(own.x_prior), len(SIGMA)))
    here = linearised(forward, usable, states, own, z)
    slope = 2 * float(jnp.sum(joint_gradient(here, smooth, jnp.asarray(z)) * along))
    step = 1e-5
    costs = [
        joint_cost(linearised(forward, usable, states, own, there), smooth, there)
        for there in (z + step * along, z - step * along)
    ]
    return abs((costs[0] - costs[1]) / (2 * step) / slope - 1)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=64)
    parser.add_argument("--streams", type=int, default=4)
    parser.add_argument("--length", type=float, default=4.0)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    use_compiler_flags()
    use_compilation_cache()
    jax.config.update("jax_enable_x64", True)
    rng, size = np.random.default_rng(arguments.seed), arguments.size
    states = random_states(rng, size**2, BANDS)
    vector = plume("smoke", ssa=True)
    prior = Prior(np.asarray(vector.x(0.4, 0.0)), np.diag(SIGMA**2))
    fields = [field(rng, size, arguments.length).ravel() for _ in SIGMA]
    truth = prior.x_prior + SIGMA * np.stack(fields, axis=-1)
    forward = ForwardModel(vector, BANDS, arguments.streams, gases=())
    forward = prepared(forward, states)
    seen = np.asarray(forward(jnp.asarray(truth), states))
    noise = measurement(seen, BANDS).sigma * rng.standard_normal(seen.shape)
    observation = measurement(seen + noise, BANDS)
    smooth = smoothness(np.ones((size, size), bool), arguments.length)
    error = gradient_error(forward, observation, states, prior, smooth, rng)
    print(
        f"{size} x {size} x 2 = {2 * size**2} unknowns; gradient within {error:.1e} of differences"
    )
    print("\n| retrieval | rmse ln aod | rmse logit ssa | rmse aod | 68 % | success [%] | s |")
    print(f"|{' --- |' * 7}")
    aod = np.asarray(vector.values(jnp.asarray(truth))["aod_550"])
    for label, retrieve in (
        ("pixel by pixel", lambda: retrieve_pixels(forward, observation, states, prior=prior)),
        (
            "joint",
            lambda: retrieve_smooth(forward, observation, states, prior=prior, smooth=smooth),
        ),
    ):
        retrieve()  # compiles
        start = time.perf_counter()
        found = retrieve()
        seconds = time.perf_counter() - start
        x = np.asarray(found.inversion.x)
        sigma = np.sqrt(np.diagonal(found.inversion.covariance, axis1=1, axis2=2))
        departure = x - truth
        of_aod = np.asarray(vector.values(jnp.asarray(x))["aod_550"]) - aod
        cells = (
            *(f"{np.sqrt(np.mean(departure[:, i] ** 2)):.4f}" for i in range(2)),
            f"{np.sqrt(np.mean(of_aod**2)):.4f}",
            f"{100 * np.mean(np.abs(departure) <= sigma):.1f} %",
            f"{100 * np.mean(found.codes == ResultCode.SUCCESS):.1f}",
            f"{seconds:.1f}",
        )
        print(f"| {label} | {' | '.join(cells)} |", flush=True)
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"\nmost memory {most:.2f} GiB; the joint retrieval begins with the one pixel by pixel")


if __name__ == "__main__":
    main()
