"""How near the machine's limits the solver works.

    python benchmarks/roofline.py [--streams 4 8 16 32] [--columns 1000]

counts the multiplications of the value and of value and gradient (`roofline_count.py`), times both
on the columns of `solver.py`, and sets their rates beside two of the same cores in the same run: a
large matrix product (all that the processor can do), and nothing but products of the solver's own
small matrices, by its own kernel, one tile of columns a core. In values, the arithmetic of a
gradient is what its time would be if both ran at one rate. Float64; one CPU device of JAX for each
core that the command may use.
"""

import argparse
import platform
import time

import jax
import jax.numpy as jnp
import numpy as np
import workload
from roofline_count import up_and_down
from rounds import table

from abi_operator.machine.algebra import matmul
from abi_operator.machine.sizes import tile_size

LAYERS = 20


def fastest(call, repeats=7):
    """Seconds of the fastest of some calls, after one that compiles."""
    jax.block_until_ready(call())
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        jax.block_until_ready(call())
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def arithmetic(cores):
    """Multiply-adds per second of all cores, in a large matrix product."""
    size = 2048
    a = jnp.asarray(np.random.default_rng(0).normal(size=(cores, size, size)))
    one = jax.jit(lambda x: x @ x)
    devices = [jax.device_put(x, d) for x, d in zip(a, jax.local_devices(), strict=True)]
    return cores * size**3 / fastest(lambda: [one(x) for x in devices])


def small_products(num_streams, cores):
    """Multiply-adds per second of all cores in products of cores, one tile after the other."""
    n, tile, rounds = num_streams // 2, tile_size(num_streams, np.float64), 1000
    a = np.random.default_rng(0).uniform(0, 1 / n, (n, n, tile))
    a = [jax.device_put(a, d) for d in jax.local_devices()]
    one = jax.jit(lambda a: jax.lax.fori_loop(0, rounds, lambda _, x: matmul(a, x), a))
    return cores * rounds * tile * n**3 / fastest(lambda: [one(x) for x in a])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--streams", type=int, nargs="+", default=[4, 8, 16, 32])
    parser.add_argument("--columns", type=int, default=1000)
    options = parser.parse_args()
    cores = workload.use_all_cores()
    highest = arithmetic(cores)
    print(f"jax {jax.__version__}, {platform.machine()}, {cores} cores, float64, {LAYERS} layers")
    print(f"A large matrix product: {highest / 1e9:.1f} 10^9 multiply-adds per second.\n")
    rows = []
    for n in options.streams:
        given = workload.columns(options.columns, LAYERS, seed=1)
        arrays = workload.arguments(given, n)
        doublings = workload.num_doublings(n)
        solved = {"num_streams": n, "num_doublings": doublings}
        up, down = (n * LAYERS * count for count in up_and_down(n, doublings))
        programs = {
            "value": (workload.value(solved), up),
            "value + gradient": (workload.gradient(solved), up + down),
        }
        small, alone = small_products(n, cores), None
        for name, (program, work) in programs.items():
            seconds = fastest(lambda program=program, arrays=arrays: program(*arrays))
            alone = alone or seconds
            rate = work * options.columns / seconds
            rows.append(
                [
                    n,
                    name,
                    f"{work:,}",
                    f"{work / up:.2f}",
                    f"{seconds / options.columns * 1e6:.1f}",
                    f"{seconds / alone:.2f}",
                    f"{rate / 1e9:.1f}",
                    f"{rate / highest:.0%}",
                    f"{rate / small:.0%}",
                ]
            )
    head = ["streams", "program", "multiplications a column", "in values", "microseconds"]
    table([*head, "in values", "10^9 a second", "of a large product", "of small products"], rows)


if __name__ == "__main__":
    main()
