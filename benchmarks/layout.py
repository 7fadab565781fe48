"""How many columns to solve together, and how many pixels to retrieve together.

    python benchmarks/layout.py [--repeats 5]

prints microseconds per layer and azimuth mode of the solver against the tile of columns that stays
in the cache, and seconds of a retrieval against the chunk of pixels that waits for its slowest
member (both in `abi_operator.machine.sizes`). Float64; compiling apart.
"""

import argparse
import statistics
import tempfile
import time
from functools import partial
from pathlib import Path

import jax
import numpy as np
from first_light import read

from abi_operator.demo import write_demo
from abi_operator.machine import sizes
from abi_operator.scene import simulate
from abi_operator.solver import door, toa_brf
from retrievals import chunks, last_steps, retrieve_smoke, rounds

NUM_COLUMNS, NUM_LAYERS, NUM_DOUBLINGS = 1024, 24, 2


def columns(num_streams):
    """Random columns, every layer different; tau 1e-3 to 1."""
    rng = np.random.default_rng(1)
    shape = (NUM_COLUMNS, NUM_LAYERS)
    tau, ssa = 10 ** rng.uniform(-3, 0, shape), rng.uniform(0.5, 1, shape)
    moments = rng.uniform(0.3, 0.85, shape)[..., None] ** np.arange(num_streams + 1)
    mu0, mu = rng.uniform(0.2, 1, (2, NUM_COLUMNS))
    albedo, azimuth = rng.uniform(0, 1, NUM_COLUMNS), rng.uniform(0, np.pi, NUM_COLUMNS)
    return tau, ssa, moments, albedo, mu0, mu, azimuth


def median_seconds(function, repeats):
    """Median time of calls after a first one that compiles."""
    function()
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        jax.block_until_ready(function())
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds)


def solver_tiles(repeats):
    tiles = (16, 32, 64, 128)  # no larger ones: a layer of 16 streams would be no kernel any more
    print(f"| streams | {' | '.join(f'{t} columns' for t in tiles)} |")
    print("| --- |" + " --- |" * len(tiles))
    for num_streams in (4, 8, 16):
        arguments = columns(num_streams)
        cells = []
        for tile in tiles:
            for room in (sizes, door):
                room.tile_size = lambda *_, tile=tile: tile
            jax.clear_caches()
            solve = partial(
                toa_brf, *arguments, num_streams=num_streams, num_doublings=NUM_DOUBLINGS
            )
            work = NUM_COLUMNS * NUM_LAYERS * num_streams
            cells.append(f"{median_seconds(solve, repeats) / work * 1e6:.2f}")
        print(f"| {num_streams} | {' | '.join(cells)} |")


def retrieval_chunks(repeats):
    with tempfile.TemporaryDirectory() as folder:
        result = simulate(read(write_demo(Path(folder), size=28)))
    pixels = int((result["smoke_brightness"] > 0).sum())
    print(f"\n| pixels a chunk | seconds for {pixels} pixels x 3 bands |\n| --- | --- |")
    for chunk in (16, 32, 48, 96):
        for room in (chunks, rounds, last_steps):
            room.chunk_of_pixels = lambda chunk=chunk: chunk
        jax.clear_caches()
        seconds = median_seconds(lambda: retrieve_smoke(result)["aod_550"].values, repeats)
        print(f"| {chunk} | {seconds:.1f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=5)
    repeats = parser.parse_args().repeats
    jax.config.update("jax_enable_x64", True)
    print("microseconds per layer and azimuth mode:\n")
    solver_tiles(repeats)
    retrieval_chunks(repeats)


if __name__ == "__main__":
    main()
