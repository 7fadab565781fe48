"""Where the time of a scene goes: reading, optics, solving, writing.

    python benchmarks/first_light.py [--size 64] [--num-streams 10] [--error-budget 1e-3]
        [--repeats 5]

writes the demonstration's inputs, takes them through each stage by itself and prints, for every
stage, the seconds of the first call (compiling included) and the median of `repeats` further ones
with their spread, on the same arrays. Streams and error budget are those of a scene unless told
otherwise; a budget of 0 solves everything. Beside the time stands the error of both: the brf of 128
columns of the same scene against 32 streams.
"""

import argparse
import platform
import statistics
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import jax
import numpy as np

from abi_operator import BANDS, GRASSO2013, __version__, brf, smoke
from abi_operator.demo import write_demo
from abi_operator.files import (
    ResultWriter,
    read_mcd43a1,
    read_plume,
    read_wrf,
    stored,
    wrf_coordinates,
)
from abi_operator.machine.speed import usable_cores
from abi_operator.optics import mixture
from abi_operator.pictures import write_png
from abi_operator.products import natural_color
from abi_operator.scene import (
    ERROR_BUDGET,
    PlumeSpecification,
    column_states,
    scenario,
    simulate,
)
from abi_operator.settings import NUM_STREAMS
from abi_operator.solver import cos_scattering_angle, toa_brf

OCEAN_ALBEDO = 0.03
REFERENCE_STREAMS = 32
REFERENCE_COLUMNS = 128


def read(inputs):
    """Files to a scenario."""
    shape = tuple(wrf_coordinates(inputs.wrf).sizes[d] for d in ("y", "x"))
    plume = PlumeSpecification(smoke(2.0), read_plume(inputs.plume, shape))
    return scenario(
        read_wrf(inputs.wrf, 0),
        albedo=read_mcd43a1(inputs.albedo, GRASSO2013),
        ocean_albedo=OCEAN_ALBEDO,
        plumes={"smoke": plume},
        gases=(),
    )


@partial(jax.jit, static_argnames="num_moments")
def optics(states, num_moments):
    """What the solver reads of every column and band."""

    def column(state):
        geometry = state.geometry
        angle = cos_scattering_angle(geometry.mu0, geometry.mu, geometry.relative_azimuth)
        layers = [
            mixture(state.atmosphere, BANDS[name], (), num_moments, angle) for name in GRASSO2013
        ]
        arrays = [(x.tau[0], x.ssa[0], x.moments, x.phase_function) for x in layers]
        return tuple(jax.numpy.stack(a) for a in zip(*arrays, strict=True))

    return jax.vmap(column)(states)


def solve(states, layers, how):
    """Layers to brf."""
    tau, ssa, moments, phase = layers
    albedo = np.stack([states.albedo[name] for name in GRASSO2013], axis=1)
    geometry = states.geometry
    directions = [
        np.asarray(x)[:, None] for x in (geometry.mu0, geometry.mu, geometry.relative_azimuth)
    ]
    return toa_brf(tau, ssa, moments, albedo, *directions, phase_function=phase, **how)


def write(result, folder):
    """Result to NetCDF and a picture."""
    shape = result.sizes["y"], result.sizes["x"]
    times = np.atleast_1d(result["time"].values)
    with ResultWriter(folder / "result.nc", times=times, shape=shape) as writer:
        writer.write(0, slice(None), stored(result))
    by_band = {str(b): result["brf"].sel(band=b).values for b in result["band"].values}
    write_png(folder / "picture.png", natural_color(by_band))


def timed(function, repeats):
    """First call, median and range of the others in seconds, and the last result."""
    seconds = []
    for _ in range(repeats + 1):
        start = time.perf_counter()
        result = jax.block_until_ready(function())
        seconds.append(time.perf_counter() - start)
    return seconds[0], statistics.median(seconds[1:]), (min(seconds[1:]), max(seconds[1:])), result


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=64)
    parser.add_argument("--num-streams", type=int, default=NUM_STREAMS)
    parser.add_argument("--error-budget", type=float, default=ERROR_BUDGET)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    how = {"num_streams": options.num_streams, "error_budget": options.error_budget or None}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        inputs = write_demo(folder, size=options.size)
        rows = {}
        *rows["reading"], scene = timed(lambda: read(inputs), options.repeats)
        states = column_states(scene, GRASSO2013)
        moments = options.num_streams + 1
        *rows["optics"], layers = timed(lambda: optics(states, moments), options.repeats)
        *rows["solving"], values = timed(lambda: solve(states, layers, how), options.repeats)
        result = simulate(scene, **how)
        *rows["writing"], _ = timed(lambda: write(result, folder), options.repeats)
    every = np.linspace(0, values.shape[0] - 1, REFERENCE_COLUMNS).astype(int)
    few = jax.tree.map(lambda x: x[every], states)
    reference = np.asarray(brf(few, num_streams=REFERENCE_STREAMS))
    error = np.abs(np.asarray(values)[every] - reference) / np.maximum(np.abs(reference), 0.01)

    count, layers_count = values.size, layers[0].shape[-1]
    print(
        f"abi-operator {__version__}, jax {jax.__version__}, {jax.devices()[0].platform}, ", end=""
    )
    print(f"{platform.machine()}, {usable_cores()} cores, Python {sys.version.split()[0]}, float64")
    print(
        f"{options.size} x {options.size} columns x {len(GRASSO2013)} bands, "
        f"{layers_count} layers, ",
        end="",
    )
    print(f"{options.num_streams} streams, error budget {how['error_budget']}\n")
    whole = sum(median for _, median, _ in rows.values())
    print("| stage | first call [s] | median [s] | range [s] | share | columns x bands / s |")
    print("| --- | --- | --- | --- | --- | --- |")
    for stage, (first, median, (low, high)) in rows.items():
        print(
            f"| {stage} | {first:.2f} | {median:.3f} | {low:.3f}-{high:.3f} "
            f"| {median / whole:.1%} | {count / median:,.0f} |"
        )
    print(f"| all | | {whole:.3f} | | | {count / whole:,.0f} |\n")
    print(
        f"error of brf at {options.num_streams} streams against {REFERENCE_STREAMS} on "
        f"{REFERENCE_COLUMNS} columns x {len(GRASSO2013)} bands, relative to max(brf, 0.01): "
        f"median {np.median(error):.1e}, p99 {np.percentile(error, 99):.1e}, max {error.max():.1e}"
    )


if __name__ == "__main__":
    main()
