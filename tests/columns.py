"""Columns for the solver's tests."""

import numpy as np

from abi_operator.solver import half_range


def simple_columns(count=4, num_layers=5, num_moments=33, seed=3):
    """Hazy layers over grey ground: arguments of `toa_brf`, batch first, nothing extreme."""
    rng = np.random.default_rng(seed)
    tau = 10 ** rng.uniform(-2, 0.5, (count, num_layers))
    ssa = rng.uniform(0.6, 1, (count, num_layers))
    g = rng.uniform(0.2, 0.8, (count, num_layers, 1))
    moments = g ** np.arange(num_moments)
    albedo, azimuth = rng.uniform(0, 0.8, count), rng.uniform(0.1, 3, count)
    mu0, mu = rng.uniform(0.2, 0.95, (2, count))
    return tau, ssa, moments, albedo, mu0, mu, azimuth


# What most of the solver's tests share, so that they share its compiled programs.
STANDARD = {"num_streams": 4, "num_doublings": 4}
SMALL = {"num_streams": 2, "num_doublings": 1}


def standard_columns(count=4):
    """Columns for the options `STANDARD`, with moments enough for their phase functions."""
    return simple_columns(count, num_layers=5, num_moments=65)


def small_columns(count=3):
    """Columns for the options `SMALL`: what transforms the solver twice compiles fast.

    One doubling is not exact for them, but as differentiable as many.
    """
    return simple_columns(count, num_layers=2, num_moments=5)


def hard_columns(num_moments=33, num_streams=8):
    """Columns at every place where a formula might break; 50 layers, padded with empty ones.

    Two nodes of `num_streams` streams are the cosines of "mu0 at a node".
    """
    rng = np.random.default_rng(11)
    names = [
        "tau 0", "ssa 0", "ssa 1", "mu0 = mu", "mu0 at a node", "exact backscatter",
        "glint azimuth", "50 equal layers", "tau 1e5", "nadir", "overhead sun", "both vertical",
        "g 0", "grazing sun",
    ]  # fmt: skip
    count, layers = len(names), 50
    tau = 10 ** rng.uniform(-3, 0, (count, layers))
    tau[:, 6:] = 0
    ssa, g = rng.uniform(0.5, 1, (count, layers)), rng.uniform(0.2, 0.85, (count, layers))
    albedo, azimuth = rng.uniform(0.05, 0.8, count), rng.uniform(0.2, 3, count)
    mu0, mu = rng.uniform(0.2, 0.95, (2, count))
    at = {name: i for i, name in enumerate(names)}
    tau[at["tau 0"]] = 0
    ssa[at["ssa 0"]] = 0
    ssa[at["ssa 1"]] = 1
    mu0[at["mu0 = mu"]] = mu[at["mu0 = mu"]]
    nodes = half_range(num_streams)[0]
    mu0[at["mu0 at a node"]], mu[at["mu0 at a node"]] = nodes[(nodes.size - 1) // 2], nodes[-1]
    mu0[at["exact backscatter"]] = mu[at["exact backscatter"]]
    azimuth[at["exact backscatter"]] = 0
    azimuth[at["glint azimuth"]] = np.pi
    equal = at["50 equal layers"]
    tau[equal], ssa[equal], g[equal] = 0.1, 0.95, 0.7
    tau[at["tau 1e5"], 2] = 1e5
    mu[at["nadir"]] = mu0[at["overhead sun"]] = 1
    mu0[at["both vertical"]] = mu[at["both vertical"]] = 1
    g[at["g 0"]] = 0
    mu0[at["grazing sun"]] = 1e-3
    moments = g[..., None] ** np.arange(num_moments)
    return names, (tau, ssa, moments, albedo, mu0, mu, azimuth)
