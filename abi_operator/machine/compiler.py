"""Which of XLA's ways of compiling serve this package, where the user has not chosen them.

Vectors as wide as the processor has them: a solve gains about a third. The older of XLA's two ways
from a fusion to LLVM: a solve's kernels hold some hundred fusions each, which the newer one
optimises one by one before LLVM does it all again; JAX 0.11 has the newer way alone. And the first
of LLVM's three levels of optimisation. At the third it unrolls a loop over 32 columns with little
in it number by number, before it could make vectors of it, so that tiles had to be of 64 and left
the cache next to the processor (`shortest_loop`). At the first values of 8 and 16 streams take 0.95
and 0.87 of the time, slopes 0.9 and 0.84, slopes in single precision 0.8 to 0.95, and all is
compiled sooner: compare ``time abi-operator --no-cache demo`` with the same under

    XLA_FLAGS="--xla_cpu_use_fusion_emitters=true --xla_backend_optimization_level=3"

On a GPU loops and branches that the GPU follows by itself: otherwise each step of a loop waits for
the host to read how it goes on. Values take 0.7 of the time then, gradients 0.8 to 0.85 (programs
that are compiled by a `jax.jit` of the caller's do without, unless ``XLA_FLAGS`` has the option).
"""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache

import jax

from .backend import on_cpu
from .processor import vector_bits

_WIDTH, _EMITTERS = "xla_cpu_prefer_vector_width", "xla_cpu_use_fusion_emitters"
_LEVEL, _LEAST, _MOST = "xla_backend_optimization_level", 1, 3  # the last is XLA's own choice
_OURS = _WIDTH, _EMITTERS, _LEVEL

# XLA passes over names in xla_ here that it does not know; other flags would end the process.
_EXTRA = "xla_backend_extra_options"
_OLDER = "xla_cpu_disable_new_fusion_emitters=true"

# What is recorded once and started as one: XLA's own choice, and loops and branches.
_RECORDED = {"xla_gpu_enable_command_buffer": "FUSION,CUBLAS,CUSTOM_CALL,CONDITIONAL,WHILE"}

SOON_COMPILED: dict[str, int | bool] = {_LEVEL: 0}
"""Options of `jax.jit` for programs that are compiled for longer than they will ever run: compiled
without optimisation, in half the time. What that does to results is rounding."""


def options(recorded: bool = True) -> dict[str, int | bool | str]:
    """Options of `jax.jit`; `recorded`: a GPU follows loops and branches by itself."""
    found: dict[str, int | bool | str] = dict(_RECORDED) if recorded else {}
    if on_cpu():
        found = {_EMITTERS: False}
        if _chosen_level() is None:
            found[_LEVEL] = _LEAST
        bits = vector_bits()
        if bits is not None:
            found[_WIDTH] = bits
    return {k: x for k, x in found.items() if not _is_chosen(k) and _is_known(k, x)}


SHORTEST = 32  # as programs that are called with values are compiled
_traced_for: ContextVar[dict[str, int | bool | str] | None] = ContextVar(
    "_traced_for", default=None
)


@contextmanager
def traced_for(options: dict[str, int | bool | str]) -> Iterator[None]:
    """What is traced in this block is compiled with these options of `jax.jit`."""
    token = _traced_for.set(options)
    try:
        yield
    finally:
        _traced_for.reset(token)


def shortest_loop() -> int:
    """Columns from which on every loop of what is traced here is one of vectors.

    LLVM unrolls shorter ones, of as little as a sum, as scalars. It does so up to 150 instructions,
    and up to 300 at its third level of optimisation.
    """
    level = (_traced_for.get() or {}).get(_LEVEL, _chosen_level())
    return 2 * SHORTEST if level is None or int(level) >= _MOST else SHORTEST


def _chosen_level() -> int | None:
    """Level of optimisation that the user has chosen."""
    least = jax.config.read("jax_disable_most_optimizations")
    return 0 if least else number_of(_LEVEL)


@cache
def _is_known(name: str, value: int | bool | str) -> bool:
    """Whether this XLA has an option: asked by a program of nothing, as each version knows others.

    One that it does not know would end every call. Versions up to 0.10 know ours and are not asked.
    """
    if name in _OURS and jax.__version_info__ < (0, 11):
        return True

    def nothing(x: float) -> float:
        return x

    try:
        jax.jit(nothing, compiler_options={name: value}).lower(0.0).compile()
    except jax.errors.JaxRuntimeError:
        return False
    return True


def use_flags() -> None:
    """Put them into ``XLA_FLAGS``, which XLA reads when JAX starts and child processes inherit."""
    flags = [os.environ.get("XLA_FLAGS", "")]
    if vector_bits() is not None and not _is_chosen(_WIDTH):
        flags.append(f"--{_WIDTH}={vector_bits()}")
    if not _is_chosen(_LEVEL):
        flags.append(f"--{_LEVEL}={_LEAST}")
    if not _is_chosen(_EXTRA):
        flags.append(f"--{_EXTRA}={_OLDER}")
    os.environ["XLA_FLAGS"] = " ".join(flags).strip()


def chosen_bits() -> int | None:
    """Width of vectors that ``XLA_FLAGS`` asks for. [bit]"""
    return number_of(_WIDTH)


def number_of(flag: str) -> int | None:
    """Number that ``XLA_FLAGS`` gives an option; of several, XLA takes the last."""
    found = re.findall(rf"--{flag}=(\d+)", os.environ.get("XLA_FLAGS", ""))
    return int(found[-1]) if found else None


def _is_chosen(name: str) -> bool:
    return f"--{name}" in os.environ.get("XLA_FLAGS", "")
