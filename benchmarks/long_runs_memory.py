"""Does a run of thousands of blocks take more and more memory?

    python long_runs_memory.py FOLDER BLOCKS

Reads a model's file again and again, as times of a series, simulates each in blocks of one row,
writes a result and pictures, and keeps parts, as `abi-operator simulate` does. Prints, JSON:
blocks, memory at a third and at the end [MB], and the slope of a line through the second two
thirds, with its standard error [kB a block].
"""

import json
import os
import sys
from pathlib import Path

import jax
import numpy as np

from abi_operator import scene, use_compilation_cache
from abi_operator.demo import write_demo
from abi_operator.drawing import Painter
from abi_operator.files import Parts, ResultWriter, open_wrf_series, read_mcd43a1, rounded, stored

BANDS = ("C01", "C03")
SIZE = 8
EVERY = 10  # blocks between two looks


def resident():
    """Memory of this process. [byte]"""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def simulate(folder, num_blocks):
    """Memory after each EVERY blocks. [byte]"""
    demo = write_demo(folder / "in", size=SIZE)
    albedo = read_mcd43a1(demo.albedo, BANDS)
    num_times = -(-num_blocks // SIZE)
    times = np.datetime64("2007-10-23T18:00:00", "ns") + np.arange(num_times) * np.timedelta64(
        1, "s"
    )
    out = folder / "out"
    out.mkdir()
    painter = Painter(out, times, SIZE)
    seen, done = [], 0

    def read_block(time, rows):
        model = open_wrf_series(demo.wrf).read(0, rows).assign_coords(time=times[time])
        return rounded(
            scene.scenario(
                model, albedo=albedo, ocean_albedo=0.03, bands=BANDS, rows=rows, gases=()
            )
        )

    with ResultWriter(out / "result.nc", times=times, shape=(SIZE, SIZE)) as writer:

        def write_block(time, rows, result):
            nonlocal done
            writer.write(time, rows, stored(result, ("image",)))
            painter.add(time, rows, result)
            done += 1
            if done % EVERY == 0:
                seen.append(resident())

        scene.run(
            read_block,
            times,
            (SIZE, SIZE),
            write_block,
            num_streams=4,
            block_columns=SIZE,
            parts=Parts(out),
        )
    return np.array(seen)


def main():
    folder, num_blocks = Path(sys.argv[1]), int(sys.argv[2])
    jax.config.update("jax_enable_x64", True)
    use_compilation_cache()
    seen = simulate(folder, num_blocks)
    third = len(seen) // 3
    blocks = EVERY * np.arange(third, len(seen))
    (slope, _), covariance = np.polyfit(blocks, seen[third:] / 1e3, 1, cov=True)
    megabytes = [round(float(x) / 1e6, 1) for x in (seen[third], seen[-1])]
    print(json.dumps([len(seen) * EVERY, *megabytes, float(slope), float(covariance[0, 0] ** 0.5)]))


if __name__ == "__main__":
    main()
