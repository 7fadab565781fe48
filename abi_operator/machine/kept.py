"""Compiled programs kept on disk by what they are called with, so that nothing has to be traced.

JAX's cache of compiled programs knows a program by its code, for which it must be traced and
lowered in every process. Here a program is known by the function, the values that it is compiled
for, the shapes of its arguments, and all that traces and compiles them: the files of the packages
that the function comes from, versions, settings. `Kept` are the programs of plain calls (`door`)
and those of a retrieval.

A process that exchanges functions of a package while it runs would be given the programs of its
files. So only a process of our own, the command line, switches this on (`use`); elsewhere a `Kept`
is a `jax.jit`, with JAX's cache (`speed.use_compilation_cache`). Files that have changed since this
process began are not what it has imported: nothing is read or written then.
"""

import hashlib
import importlib
import io
import os
import pickle
import sys
import time
from collections.abc import Callable, Hashable
from functools import cache, cached_property, partial, wraps
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax.experimental import serialize_executable
from jax.tree_util import PyTreeDef

from .._ending import unfinished
from . import compiler
from .plain import is_plain
from .processor import processor_key

# What may take part in a trace. What is pickled by its name alone must come from one of these.
_OTHERS = ("jax", "jaxlib", "numpy", "equinox", "jaxtyping", "lineax", "optimistix")
_PLAIN = ("builtins", "collections")

_began = time.time()
_folder: Path | None = None


def use(folder: Path) -> None:
    """Keep programs there from now on, in files that `speed` counts among JAX's."""
    global _folder
    _folder = folder


class Kept:
    """A function compiled for what it is called with, by `jax.jit`, or read from the disk.

    It is compiled as `compiler.options` say, and so called with values alone: inside another
    `jax.jit` JAX takes no options.

    Parameters
    ----------
    function
        Of something to be compiled for, which is hashable, and of pytrees of arrays. Of a module's
        own, closing over nothing.
    recorded
        Whether a GPU follows its loops and branches by itself, which has been tried with columns
        alone, and not with minimisations.
    """

    def __init__(self, function: Callable[..., Any], recorded: bool = False) -> None:
        # Another function, of which JAX knows no trace that was made for other options.
        self._function, self._alone = function, wraps(function)(lambda *x: function(*x))
        self._recorded = recorded
        self._found: dict[Any, Callable[..., Any]] = {}

    @cached_property
    def _options(self) -> dict[str, int | bool | str]:
        """Known when it is first called: they ask JAX for its device, which is not to be started
        by an import."""
        return compiler.options(self._recorded)

    @cached_property
    def _jitted(self) -> Any:
        return jax.jit(self._alone, static_argnums=0, compiler_options=self._options)

    def __call__(self, fixed: Hashable, *arguments: Any) -> Any:
        """What the function gives, compiled for `fixed` and for arrays of these shapes."""
        with compiler.traced_for(self._options):
            return self._program(fixed, arguments)(*arguments)

    def prepare(self, fixed: Hashable, *arguments: Any) -> None:
        """Compile or read what a call needs; `jax.jit` compiles in calling."""
        with compiler.traced_for(self._options):
            program = self._program(fixed, arguments)
            if _folder is None or is_plain():
                program(*arguments)

    def _program(self, fixed: Hashable, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        if _folder is None or is_plain():
            return partial(self._jitted, fixed)
        leaves, structure = jax.tree.flatten(arguments)
        shapes = tuple((x.shape, np.dtype(x.dtype).str) for x in leaves)
        x64 = jax.dtypes.canonicalize_dtype(np.float64) == np.float64
        key = fixed, structure, shapes, x64
        if key not in self._found:
            name = _name(self._function, (self._options, key))
            if name is None:
                self._found[key] = partial(self._jitted, fixed)
            else:
                function, path = partial(self._alone, fixed), _folder / name
                program = _read(path) or _compiled(function, self._options, arguments, path)
                self._found[key] = program
        return self._found[key]


def _compiled(
    function: Callable[..., Any],
    options: dict[str, Any] | None,
    arguments: tuple[Any, ...],
    path: Path,
) -> Callable[..., Any]:
    """Compile, and write what others will read."""
    structure: list[Any] = []

    def flat(leaves: list[Any]) -> list[Any]:
        results, tree = jax.tree.flatten(function(*jax.tree.unflatten(inputs, leaves)))
        structure.append(tree)
        return results

    # Of no other name, so that it is compiled: a program that JAX has read from its own cache would
    # be written without some of its kernels, and end whoever reads it ("Function ... not found").
    flat.__name__ = f"flat_{os.urandom(8).hex()}"
    leaves, inputs = jax.tree.flatten(arguments)
    program = jax.jit(flat, compiler_options=options).lower(leaves).compile()
    (tree,) = structure
    try:
        payload, _, _ = serialize_executable.serialize(program)
        example = jax.tree.unflatten(tree, range(tree.num_leaves))
        _write(path, pickle.dumps((payload, len(leaves), example)))
    except (ValueError, NotImplementedError, pickle.PicklingError, AttributeError, TypeError):
        pass  # of a kind that cannot be kept
    return partial(_call, program, tree)


def _call(program: Any, tree: Any, *arguments: Any) -> Any:
    """Give a program of flat lists what it takes."""
    return jax.tree.unflatten(tree, program(jax.tree.leaves(arguments)))


def _read(path: Path) -> Callable[..., Any] | None:
    """What another process has written, None where there is nothing that can be used."""
    try:
        payload, count, example = pickle.loads(path.read_bytes())
        leaves, tree = jax.tree.flatten(example)
        inputs = jax.tree.structure((([0] * count,), {}))
        outputs = jax.tree.structure(leaves)
        _find_lapack()
        program = serialize_executable.deserialize_and_load(
            payload, inputs, outputs, execution_devices=jax.local_devices()[:1]
        )
    except Exception:  # whatever ails the file, if there is one: it is written anew
        return None
    return partial(_call, program, tree)


def state_of_code() -> str | None:
    """Digest of this package's files, versions and the processor, on which numbers depend.

    None where files have changed since this process began, so that they do not tell what runs.
    """
    try:
        digest = hashlib.sha256(_digest(__name__.partition(".")[0]))
    except (ValueError, OSError):
        return None
    digest.update(f"{_environment()} {os.environ.get('XLA_FLAGS', '')}".encode())
    return digest.hexdigest()


@cache
def _find_lapack() -> None:
    """JAX looks for LAPACK where it lowers a call of it; a program read from a file needs it, too.

    Without, it ends in a segmentation fault (https://github.com/jax-ml/jax/issues/29610).
    """
    jax.jit(jax.lax.linalg.cholesky).lower(np.eye(1, dtype=np.float32))


def _write(path: Path, content: bytes) -> None:
    """All of it or nothing: others read at any time."""
    part = path.with_suffix(f".{os.getpid()}")
    try:
        with unfinished(part):
            part.write_bytes(content)
            part.chmod(0o600)
            part.replace(path)
    except OSError:  # a full disk: it will be compiled again
        part.unlink(missing_ok=True)


def _name(function: Callable[..., Any], key: Any) -> str | None:
    """Name of the file of a program; None where what it depends on cannot be told."""
    place = function.__module__, function.__qualname__
    if "<" in place[1]:  # made inside another function, of what is not known here
        return None
    settings = {k: repr(v) for k, v in sorted(jax.config.values.items()) if "cache" not in k}
    described = io.BytesIO()
    pickler = _Pickler(described)
    pickler.fast = True  # objects that are equal but not the same are written the same
    pickler.packages.add(place[0].partition(".")[0])
    try:
        pickler.dump((place, key, settings, os.environ.get("XLA_FLAGS", "")))
        digests = [_digest(name) for name in sorted(pickler.packages)]
    except (pickle.PicklingError, AttributeError, TypeError, ValueError, OSError):
        return None
    parts = [described.getvalue(), *digests, _environment().encode()]
    return f"columns-{hashlib.sha256(b''.join(parts)).hexdigest()}-cache"


class _Pickler(pickle.Pickler):
    """Writes what two processes write alike, and collects the packages that take part."""

    def __init__(self, file: io.BytesIO) -> None:
        super().__init__(file, protocol=5)
        self.packages = {__name__.partition(".")[0]}

    def reducer_override(self, obj: Any) -> Any:
        if isinstance(obj, PyTreeDef):
            return tuple, ([jax.tree.unflatten(obj, range(obj.num_leaves))],)
        if callable(obj) and hasattr(obj, "__qualname__"):
            package = obj.__module__.partition(".")[0]
            if package not in (*_OTHERS, *_PLAIN):
                self.packages.add(package)
        return NotImplemented


@cache
def _digest(package: str) -> bytes:
    """Hash of a package's files; `ValueError` where they are not what has been imported."""
    place = getattr(importlib.import_module(package), "__file__", None)
    if place is None or Path(place).name != "__init__.py" or not Path(place).is_file():
        raise ValueError(package)
    found = hashlib.sha256()
    for path in sorted(Path(place).parent.rglob("*")):
        if not path.is_file() or "__pycache__" in path.parts:
            continue
        if path.stat().st_mtime >= _began:
            raise ValueError(package)
        found.update(f"{path} {path.stat().st_size}\n".encode() + path.read_bytes())
    return found.digest()


@cache
def _environment() -> str:
    """What else a program depends on."""
    device = jax.local_devices()[0]
    versions = [device.platform, device.device_kind]
    for name in _OTHERS:
        try:
            versions.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    return " ".join([sys.version, processor_key(), *versions])
