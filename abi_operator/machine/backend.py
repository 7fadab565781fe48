"""Which device JAX computes on: asked as columns come, since it is settled when JAX is first used.

Programs for a CPU are laid out for its cache (`sizes`) and marked for its compiler (`algebra`,
`kernels`). A GPU has another: it fuses well what is not marked, and what it takes longest for is to
start kernels, of which it gets fewer so (`benchmarks/devices.py`).
"""

import jax

from .processor import usable_cores


def on_cpu() -> bool:
    """Whether JAX computes on a CPU, unless told otherwise."""
    return jax.default_backend() == "cpu"


def device_in_words() -> str:
    """What JAX computes on, such as "2 cores" or a GPU's name."""
    if on_cpu():
        cores = usable_cores()
        return f"{cores} core{'s' if cores > 1 else ''}"
    return jax.local_devices()[0].device_kind
