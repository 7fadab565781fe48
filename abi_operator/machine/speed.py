"""Full speed for programs of one's own, and compiled programs that are kept on disk.

Whatever is called with values (``reflectance_factor(state)``, ``toa_brf(tau, ...)``, `jax.jacrev`
of either) is cut among all cores and compiled for the widest vectors by itself. A `jax.jit` of
one's own is one program, which XLA runs on one core for each CPU device that JAX has, with vectors
as wide as LLVM likes them, in tiles that leave the cache (`compiler`), and is compiled for half as
long again: `use_full_speed` settles all of that before JAX starts.

`use_compilation_cache` keeps what is compiled, for the next process; the command line does so by
itself, and keeps what a `Kept` has compiled such that it need not be traced either (`kept`).
Importing this package sets nothing, and neither function changes what the user has set.
"""

import os
import tempfile
import warnings
from pathlib import Path
from typing import NamedTuple

import jax
from jax.experimental.compilation_cache.compilation_cache import reset_cache

from . import compiler
from .kept import Kept as Kept
from .processor import processor_key, vector_bits
from .processor import usable_cores as usable_cores

_HALF_WRITTEN = "Error reading persistent compilation cache entry"
_DEVICES = "xla_force_host_platform_device_count"

# Bytes of compiled programs that are kept. A demonstration leaves 7 MB, of 40 programs.
_KEPT = 512 * 2**20
# What the smallest file counts in it: there are some thousand files at most, which are soon listed.
_LEAST = 2**16
# Files that JAX names: a program, the hash of all that it depends on.
_PROGRAMS = f"*/*-{'[0-9a-f]' * 64}-cache"


class Speed(NamedTuple):
    """What JAX computes with on a CPU.

    Parameters
    ----------
    cores
        CPU devices of JAX, each of which keeps a core busy. [-]
    vector_bits
        Width of the vectors that XLA was told to use; None where it chooses. [bit]
    """

    cores: int
    vector_bits: int | None

    def __str__(self) -> str:
        cores = "1 core" if self.cores == 1 else f"{self.cores} cores"
        vectors = "as XLA chooses" if self.vector_bits is None else f"of {self.vector_bits} bits"
        return f"Programs under jax.jit run on {cores}, with vectors {vectors}."


def use_full_speed() -> Speed:
    """Let programs of one's own (`jax.jit`) use all cores and the widest vectors of a CPU.

    To be called before JAX is first used: right after the imports. It gives JAX one CPU device for
    each usable core (``jax_num_cpu_devices``), among which columns are shared under any `jax.jit`,
    and adds to ``XLA_FLAGS``, which child processes inherit, how to compile: for the processor's
    widest vectors where LLVM would not use them (``--xla_cpu_prefer_vector_width``), for tiles that
    stay in the cache and sooner (``--xla_backend_optimization_level``), and sooner again
    (``--xla_backend_extra_options``). What the user has set, in the environment or in `jax.config`,
    stays.

    Where JAX has been used already nothing can be changed: that is a warning, as all results are
    the same without, unless nothing is missing (a second call).

    Returns
    -------
    What is in force; printed, it is a sentence.
    """
    cores, bits = _chosen_cores(), compiler.chosen_bits()
    if not _jax_has_started():
        if cores is None:
            cores = usable_cores()
            jax.config.update("jax_num_cpu_devices", cores)
        return Speed(cores, use_compiler_flags())
    found = Speed(_cpu_devices(), bits)
    missing = cores is None and found.cores < usable_cores()
    missing |= bits is None and vector_bits() is not None
    if missing:
        warnings.warn(
            "JAX has been used already, so that use_full_speed() changes nothing; call it right "
            f"after the imports. {found}",
            stacklevel=2,
        )
    return found


def use_compiler_flags() -> int | None:
    """Let XLA compile all programs as this package does; nothing where JAX has started.

    Returns
    -------
    Width of vectors that XLA is told to use; None where it chooses. [bit]
    """
    if not _jax_has_started():
        compiler.use_flags()
    return compiler.chosen_bits()


def use_compilation_cache(folder: str | os.PathLike[str] | None = None) -> Path | None:
    """Keep compiled programs on disk: another process that needs them does not compile them.

    Any number of processes may use a folder at once: one that finds what another is writing, or
    what one that was killed has left, compiles it, and JAX's warning of that is not shown. What has
    not been used for longest is deleted beyond 512 MB. Programs are code: a folder should be one's
    own, which the default is. Where ``JAX_COMPILATION_CACHE_DIR`` is set, it stays, and so does
    what is set in `jax.config` unless a `folder` is given; ``JAX_ENABLE_COMPILATION_CACHE=0``
    switches all of it off. In a folder that cannot be written nothing is kept, which is a warning.
    Nor does JAX keep a program that calls Python, as `optimistix.least_squares` under `jax.jit`
    does unless given ``throw=False``.

    On processors with AVX-512, jaxlib 0.9 to 0.10.1 calls on stderr every program that it loads one
    for another machine, for want of ``prefer-no-gather``, which no machine has. That is harmless;
    earlier and later ones say nothing.

    Parameters
    ----------
    folder
        Where to keep them; None for `default_cache_folder`. Each kind of processor has a folder in
        it, as home folders are shared by machines that do not run each other's code.

    Returns
    -------
    The folder in use; None where there is none.
    """
    if not jax.config.jax_enable_compilation_cache:  # pyright: ignore[reportAttributeAccessIssue]
        return None
    warnings.filterwarnings("ignore", _HALF_WRITTEN, UserWarning)
    chosen = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    if chosen and (folder is None or "JAX_COMPILATION_CACHE_DIR" in os.environ):
        return Path(chosen)
    place = folder
    try:
        place = default_cache_folder() if folder is None else Path(folder).expanduser()
        place = place.absolute() / processor_key()
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=place).close()
    except (OSError, RuntimeError) as error:  # the latter where there is no home
        warnings.warn(f"compiled programs are not kept: {error}", stacklevel=2)
        return None
    if jax.config.jax_compilation_cache_max_size < 0:  # pyright: ignore[reportAttributeAccessIssue]
        _forget_oldest(place.parent)
    # Loading the smallest program takes a quarter of the time that compiling it does.
    if "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS" not in os.environ:
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_compilation_cache_dir", str(place))
    reset_cache()
    return place


def default_cache_folder() -> Path:
    """Where compiled programs of this user are kept."""
    caches = os.environ.get("XDG_CACHE_HOME", "")
    home = Path(caches) if os.path.isabs(caches) else Path.home() / ".cache"
    return home / "abi-operator" / "compiled"


def _chosen_cores() -> int | None:
    """CPU devices that somebody, perhaps this module, has asked for."""
    number = jax.config.jax_num_cpu_devices  # pyright: ignore[reportAttributeAccessIssue]
    return number if number >= 0 else compiler.number_of(_DEVICES)


def _jax_has_started() -> bool:
    """Whether the devices of JAX are settled, and the flags of XLA read."""
    number = jax.config.jax_num_cpu_devices  # pyright: ignore[reportAttributeAccessIssue]
    try:
        jax.config.update("jax_num_cpu_devices", number + 1)
    except RuntimeError:
        return True
    jax.config.update("jax_num_cpu_devices", number)
    return False


def _cpu_devices() -> int:
    """CPU devices of JAX, which has started; it may have been told to do without."""
    try:
        return jax.local_device_count("cpu")
    except RuntimeError:
        return 1


def _forget_oldest(folder: Path, kept: int = _KEPT) -> None:
    """Delete the programs, of any processor, that have not been used for longest."""
    entries = []
    for path in folder.glob(_PROGRAMS):
        try:
            state = path.stat()
        except OSError:  # another process was here
            continue
        entries.append((max(state.st_atime, state.st_mtime), max(state.st_size, _LEAST), path))
    excess = sum(size for _, size, _ in entries) - kept
    for _, size, path in sorted(entries):
        if excess <= 0:
            return
        try:
            path.unlink(missing_ok=True)
        except OSError:
            continue
        excess -= size
