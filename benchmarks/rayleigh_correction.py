"""How well the Rayleigh corrections find the albedo of a ground under pure air.

    python benchmarks/rayleigh_correction.py [--columns 2000] [--num-streams 16]

Grounds of albedo 0 to 0.4 at 700 to 1030 hPa, sun and view at zenith angles up to 65 degrees and,
in a second table, to 80; their reflectance by the solver, corrected by `rayleigh_air` and by
crefl's formulas. Crefl's path reflectance was fitted to light with its polarisation, which the
solver leaves out: most of its error here is that. Then the time for a million pixels of a band.
"""

import argparse
import os
import platform
import statistics
import time

import jax
import numpy as np

from abi_operator import __version__
from abi_operator.constants import STANDARD_PRESSURE
from abi_operator.optics.rayleigh import BETA2, STANDARD_DEPTH
from abi_operator.products import rayleigh_corrected
from abi_operator.solver import surface_coupling

BANDS = ("C01", "green", "C02", "C03")
METHODS = ("operator", "crefl")
PIXELS = 1_000_000


def scene(columns, steepest, seed=0):
    rng = np.random.default_rng(seed)
    mu0, mu = np.cos(np.radians(rng.uniform(0, steepest, (2, columns))))
    angles = {"mu0": mu0, "mu": mu, "relative_azimuth": rng.uniform(0, np.pi, columns)}
    return angles, rng.uniform(7e4, 1.03e5, columns), rng.uniform(0, 0.4, columns)


def errors(band, columns, steepest, num_streams):
    """Of the albedo, by each method."""
    angles, pressure, albedo = scene(columns, steepest)
    moments = np.zeros((1, num_streams + 1))
    moments[0, [0, 2]] = 1, BETA2[band] / 5
    tau = STANDARD_DEPTH[band] * pressure / STANDARD_PRESSURE
    response = surface_coupling(
        tau[:, None], np.ones(1), moments, **angles, num_streams=num_streams, num_modes=3
    )
    brf = response.brf(albedo)
    for method in METHODS:
        found = rayleigh_corrected(band, brf, **angles, pressure=pressure, method=method)
        yield np.abs(np.asarray(found) - albedo)


def seconds(method, repeats=5):
    """Median time of a million pixels of C01, compiling apart."""
    angles, pressure, albedo = scene(PIXELS, 65)
    run = jax.jit(
        lambda brf, angles, pressure: rayleigh_corrected(
            "C01", brf, **angles, pressure=pressure, method=method
        )
    )
    run(albedo, angles, pressure).block_until_ready()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run(albedo, angles, pressure).block_until_ready()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--columns", type=int, default=2000)
    parser.add_argument("--num-streams", type=int, default=16)
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    print(
        f"abi-operator {__version__}, jax {jax.__version__}, {jax.default_backend()}, "
        f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}, float64"
    )
    for steepest in (65, 80):
        print(f"\nerror of albedo, zenith angles up to {steepest} degrees: rms and largest\n")
        print("| band | operator | | crefl | |\n| --- | --- | --- | --- | --- |")
        for band in BANDS:
            found = errors(band, options.columns, steepest, options.num_streams)
            cells = [f"{np.sqrt(np.mean(x**2)):.1e} | {x.max():.1e}" for x in found]
            print(f"| {band} | {' | '.join(cells)} |")
    print("\n| method | seconds for a million pixels |\n| --- | --- |")
    for method in METHODS:
        print(f"| {method} | {seconds(method):.2f} |")


if __name__ == "__main__":
    main()
