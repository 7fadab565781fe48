"""Random columns over all that the solver promises."""

import numpy as np

MAX_LAYERS = 50
NUM_MOMENTS = 641


def random_columns(rng, count):
    """Layers, ground and directions over all that the solver promises; tau 0 pads to 50 layers."""
    layers = rng.integers(1, MAX_LAYERS + 1, count)
    exists = np.arange(MAX_LAYERS) < layers[:, None]
    thickest = 10 ** rng.uniform(-3, np.log10(200), (count, 1))
    tau = np.exp(rng.uniform(np.log(1e-6), np.log(thickest), exists.shape)) * exists
    special = rng.choice([0.0, 1.0, 1 - 1e-12], exists.shape)
    floor = rng.choice([0.0, 0.9, 0.999], (count, 1))
    ssa = np.where(rng.random(exists.shape) < 0.3, special, rng.uniform(floor, 1, exists.shape))
    g = rng.uniform(-0.5, 0.95, exists.shape)
    haze = rng.choice([0.0, 0.5, 1.0], exists.shape, p=[0.15, 0.15, 0.7])[..., None]
    rayleigh = np.zeros(NUM_MOMENTS)
    rayleigh[[0, 2]] = 1, 0.1
    moments = haze * g[..., None] ** np.arange(NUM_MOMENTS) + (1 - haze) * rayleigh
    mu0, mu = rng.uniform(0.02, 1, (2, count))
    mu[rng.random(count) < 0.05] = 1
    same = rng.random(count) < 0.05
    mu[same] = mu0[same]
    albedo, azimuth = rng.uniform(0, 1, count), rng.uniform(0, np.pi, count)
    return tau, ssa, moments, albedo, mu0, mu, azimuth
