"""An off-switch: the same numbers by plain JAX, without operations of our own.

The door makes of a program one operation with rules of its own (`door`), which knows the slopes of
columns (`slopes`); a layer is one kernel (`kernels`), of smaller ones that are fenced (`algebra`).
All of that is for speed alone. Under `plain_jax` none of it is traced: programs are what is written
for a tile of columns, whatever there are and however they lie, under JAX's own derivatives and its
own `jax.vmap`. So a doubt about any of these rules is settled by a comparison, and a version of JAX
or a device that they do not suit can be used all the same. What is differentiated by hand in the
solver (`solver.gradient`) stays, as JAX's own `jax.custom_jvp`.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import jax

from .chunks import forget_compiled

_depth = 0


@contextmanager
def plain_jax() -> Iterator[None]:
    """In this block, and in all threads of this process, trace plain JAX.

        with plain_jax():
            brf = toa_brf(tau, ssa, moments, albedo, mu0, mu, azimuth, num_doublings=8)

    Values and derivatives are the same to rounding. They take longer, and so does compiling: JAX
    has to forget all that it has compiled, at both ends of the block. Under derivatives columns are
    not read before they are solved, so that without `num_doublings` they are solved as inside
    `jax.jit`.
    """
    global _depth
    _switch(_depth + 1)
    try:
        yield
    finally:
        _switch(_depth - 1)


def is_plain() -> bool:
    """Whether the switch is off: no operations of our own."""
    return _depth > 0


def _switch(depth: int) -> None:
    global _depth
    changes = (_depth > 0) != (depth > 0)
    _depth = depth
    if changes:
        jax.clear_caches()  # in which functions are as they were traced before
        forget_compiled()
