"""The way into a program for columns that do not see each other.

Each result depends on its own column alone. Its slope in every argument then is all there is to a
first derivative: forward mode multiplies slopes by tangents, reverse mode by cotangents, a Jacobian
takes them as they are, and `jax.vmap` joins the axis that it maps to the batch. So two functions of
a `Program` serve every transformation, its value and its value with slopes, and where columns can
be read both are compiled for a few numbers of columns and no others (`chunks`). That holds for
derivatives and `jax.vmap` as well, the rules of which know the values that they transform; but what
puts slopes together and multiplies them (`slopes`), small programs, is compiled for each number of
columns. Under `jax.jit` and in loops nobody knows values, and so is the program itself.

Traced, a program is one operation with a name and shapes (`_columns`). Only what is left of it when
all transformations are done is traced inside, once, as it is compiled: `jax.custom_jvp` and
`jax.custom_batching.custom_vmap` would trace it beforehand for every step of the way.
"""

import math
from collections.abc import Sequence
from functools import cache, lru_cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import ShapedArray, Tracer, eval_context
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir
from jaxtyping import Array

from .batching import announced, tile_by_tile
from .checked import refuse_checked
from .chunks import begin_chunks, can_be_cut, map_chunks
from .cutting import as_it_lies
from .kept import Kept
from .plain import is_plain
from .program import Program
from .slopes import Leaves, Slopes, assembled, chosen, contracted, joined


def enter(program: Program, leaves: Leaves) -> Any:
    """Solve columns, differentiable in every argument and under every transformation of JAX."""
    return _bound(program, "value", leaves)


def _bound(program: Program, what: Any, leaves: Leaves) -> Any:
    """What is wanted of a program: at once of values, else as one operation of what is traced."""
    refuse_checked(leaves)
    if is_plain():
        return _plain(program, leaves)
    if not any(isinstance(x, Tracer) for x in leaves):
        return _call(program, what, leaves)
    # Even a conversion that does nothing is linearised where derivatives are taken (`converted`).
    arrays = [x if isinstance(x, jax.Array) else jnp.asarray(x) for x in leaves]
    arrays = announced(arrays, math.prod(_batch_of(program, leaves)))
    found = _columns.bind(*arrays, program=program, what=what)
    value = program.own_result(leaves)
    like = value if what == "value" else (value, 0)
    return jax.tree.unflatten(jax.tree.structure(like), found)


def _plain(program: Program, leaves: Leaves) -> Any:
    """The value by plain JAX (`plain`), of which derivatives may be taken where it is traced."""
    if math.prod(_batch_of(program, leaves)) == 0:
        return _nothing(program, "value", leaves)
    traced = any(isinstance(x, Tracer) for x in leaves)
    every = (True,) * len(leaves)
    fixed = program.unknown(every) if traced else _known(program, "value", leaves)
    return _inside((fixed, "value"), [jnp.asarray(x) for x in leaves])


_columns = Primitive("columns")
_columns.multiple_results = True


@_columns.def_impl
def _impl(*leaves: Any, program: Program, what: Any) -> list[Array]:
    return jax.tree.leaves(_call(program, what, leaves))


@_columns.def_abstract_eval
def _abstract_eval(*leaves: Any, program: Program, what: Any) -> list[ShapedArray]:
    shapes = jax.tree.leaves(_shapes(program, what, leaves))
    return [ShapedArray(x.shape, x.dtype) for x in shapes]


def _batch_of(program: Program, leaves: Leaves) -> tuple[int, ...]:
    """Shape of the batch that the arguments' own ones broadcast to."""
    pairs = zip(leaves, program.own_axes, strict=True)
    return np.broadcast_shapes(*(np.shape(x)[: np.ndim(x) - n] for x, n in pairs))


def _shapes(program: Program, what: Any, leaves: Leaves) -> Any:
    """Shapes of what is wanted of a program, slopes `joined`."""
    axes, batch = program.own_axes, _batch_of(program, leaves)
    own = program.own_result(leaves)

    def with_batch(x: Any, *more: int) -> jax.ShapeDtypeStruct:
        return jax.ShapeDtypeStruct((*batch, *more), x.dtype)

    value = jax.tree.map(lambda x: with_batch(x, *x.shape), own)
    if what == "value":
        return value
    count = sum(math.prod(x.shape) for x in jax.tree.leaves(own))
    some = [(x, n) for x, n, use in zip(leaves, axes, what, strict=True) if use]
    number = sum(math.prod(x.shape[x.ndim - n :]) for x, n in some)
    dtype = jnp.result_type(*(x.dtype for x, _ in some))
    return value, jax.ShapeDtypeStruct((*batch, count, number), dtype)


def _nothing(program: Program, what: Any, leaves: Leaves) -> Any:
    """What is wanted of no columns at all."""
    return jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), _shapes(program, what, leaves))


def _inlined(*leaves: Array, program: Program, what: Any) -> list[Array]:
    if math.prod(_batch_of(program, leaves)) == 0:
        return jax.tree.leaves(_nothing(program, what, leaves))
    return jax.tree.leaves(_inside((program.unknown(what), what), list(leaves)))


mlir.register_lowering(_columns, mlir.lower_fun(_inlined, multiple_results=True))


def _jvp(primals: Leaves, tangents: Leaves, *, program: Program, what: Any) -> Any:
    """Slopes beside values; second derivatives are JAX's own of the program of both."""
    if what != "value":
        fixed = _fixed(program, what, primals)
        full = [_with_zeros(x, t) for x, t in zip(primals, tangents, strict=True)]

        def both(*leaves: Array) -> list[Array]:
            return jax.tree.leaves(_inside((fixed, what), list(leaves)))

        return jax.jvp(both, tuple(primals), tuple(full))
    wanted = tuple(_perturbs(x) for x in tangents)
    if not any(wanted):
        value = _bound(program, "value", primals)
        rows = jax.tree.leaves(value)
        return rows, [jnp.zeros_like(x) for x in rows]
    found = _begun(program, wanted, primals)
    if found is None:
        value, whole = _bound(program, wanted, primals)
        found = value, Slopes([whole])
    value, slopes = found
    rows, axes = jax.tree.leaves(value), chosen(program.own_axes, wanted)
    shapes = tuple(x.shape for x in rows)
    return rows, contracted(slopes, chosen(tangents, wanted), axes, shapes)


ad.primitive_jvps[_columns] = _jvp


def _with_zeros(primal: Array, tangent: Any) -> Any:
    if not isinstance(tangent, ad.Zero):
        return tangent
    floating = jnp.issubdtype(primal.dtype, jnp.floating)
    return np.zeros(primal.shape, primal.dtype if floating else jax.dtypes.float0)


def _batch(leaves: Leaves, axes: Sequence[Any], *, program: Program, what: Any) -> Any:
    """Axes that `jax.vmap` maps over are more axes of the batch."""
    given = list(zip(leaves, axes, program.own_axes, strict=True))
    num_axes = max(np.ndim(x) - own - (axis is not None) for x, axis, own in given)

    def full(x: Array, axis: int | None, own: int) -> Array:
        if axis is None:
            return x
        x = jnp.moveaxis(x, axis, 0)
        shape = x.shape[0], *(1,) * (num_axes + own + 1 - x.ndim), *x.shape[1:]
        return x if shape == x.shape else x.reshape(shape)

    found = jax.tree.leaves(_bound(program, what, [full(*x) for x in given]))
    return found, [0] * len(found)


batching.primitive_batchers[_columns] = _batch


def _perturbs(tangent: Any) -> bool:
    """Whether there is a derivative to take: not for constants, nor for integers."""
    return not isinstance(tangent, ad.Zero) and tangent.dtype != jax.dtypes.float0


def _fixed(program: Program, what: Any, leaves: Leaves) -> Program:
    """The program, with nothing left open."""
    traced = any(isinstance(x, Tracer) for x in leaves)
    return program.unknown(what) if traced else _known(program, what, leaves)


def _known(program: Program, what: Any, leaves: Leaves) -> Program:
    """The program of columns with values, which are read even where `jax.jit` traces others."""
    with eval_context():
        return program.known(leaves, what)


def _begun(program: Program, what: Any, leaves: Leaves) -> tuple[Any, Slopes] | None:
    """Value and slopes of columns with values, which may still be computed when it returns.

    What JAX does with a derivative before anybody reads it takes as long as a hundred columns of 4
    streams, and is done meanwhile. None where cores have several chunks each, or columns cannot be
    read.
    """
    if any(isinstance(x, Tracer) for x in leaves):
        return None
    call = _in_memory(program, what, leaves)
    begun = None if call is None else begin_chunks(**call)
    if call is None or begun is None:
        return None
    counts, found = begun
    values = [jax.tree.leaves(value) for value, _ in found]
    with eval_context():  # in the midst of a derivative a call takes ten times as long
        rows = [assembled(list(x), counts, call["batch"]) for x in zip(*values, strict=True)]
    value = jax.tree.unflatten(jax.tree.structure(found[0][0]), rows)
    return value, Slopes([slopes for _, slopes in found], counts, call["batch"])


def _call(program: Program, what: Any, leaves: Leaves) -> Any:
    """The program of columns with values, chunk by chunk where that can be."""
    call = _in_memory(program, what, leaves)
    if call is None:
        if math.prod(_batch_of(program, leaves)) == 0:
            return _nothing(program, what, leaves)
        return _inside((_known(program, what, leaves), what), [jnp.asarray(x) for x in leaves])
    found = map_chunks(**call)
    if what == "value":
        return jax.device_put(found)
    # Slopes are read by `contracted` alone, which takes them as they are.
    value, slopes = found
    return jax.device_put(value), slopes


def _in_memory(program: Program, what: Any, leaves: Leaves) -> dict[str, Any] | None:
    """Arguments of `chunks`, None where columns cannot be cut."""
    batch, own = _layout(program.own_axes, tuple(np.shape(x) for x in leaves))
    if math.prod(batch) == 0 or not can_be_cut(leaves):
        return None
    with eval_context():  # where `jax.jit` traces others, this would become a part of their program
        flat = [
            _flat(as_it_lies(x), number, batch if each else ())
            for x, number, each in zip(leaves, program.own_axes, own, strict=True)
        ]
        fixed = program.known(leaves, what)
    return {
        "function": partial(_alone(), (fixed, what)),
        "key": (fixed, what),
        "arrays": flat,
        "own": own,
        "batch": batch,
        "widths": fixed.widths(flat, what),
    }


@lru_cache(1024)
def _layout(
    own_axes: tuple[int, ...], shapes: tuple[tuple[int, ...], ...]
) -> tuple[tuple[int, ...], tuple[bool, ...]]:
    """Shape of the batch, and which arguments have an entry for each column.

    Of one column alone, too, what is given without an axis is shared: the program is the same.
    """
    outer = [x[: len(x) - own] for x, own in zip(shapes, own_axes, strict=True)]
    batch = np.broadcast_shapes(*outer)
    one = math.prod(batch) == 1
    return batch, tuple(math.prod(x) > 1 or one and len(x) == len(batch) for x in outer)


def _flat(x: Any, own_axes: int, batch: tuple[int, ...]) -> Any:
    """The same with one axis for the batch, a view where it can be."""
    own = x.shape[x.ndim - own_axes :]
    full = (*batch, *own)
    if len(batch) == 1 and x.shape == full:
        return x
    if not batch:
        return x.reshape(1, *own)
    full_of = jnp.broadcast_to if isinstance(x, jax.Array) else np.broadcast_to
    return full_of(x, full).reshape(-1, *own)


def _wanted(of: tuple[Program, Any], leaves: Leaves) -> Any:
    """The value, or the value and the slopes in what is wanted, `joined`."""
    program, what = of
    own_axes, tile = program.own_axes, program.tile(leaves, what)
    if what == "value":
        return tile_by_tile(program.value, leaves, own_axes, tile, program.need, program.at_once)
    both = partial(program.value_and_slopes, wanted=what)
    value, slopes = tile_by_tile(both, leaves, own_axes, tile, program.need)
    return value, joined(slopes, chosen(own_axes, what))


_inside = jax.jit(_wanted, static_argnums=0)


@cache
def _alone() -> Kept:
    """The same, called with values, so that options of the compiler can be given."""
    return Kept(_wanted, recorded=True)
