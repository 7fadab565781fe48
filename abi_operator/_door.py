"""The way into a program for columns that do not see each other.

Each result depends on its own column alone. Its slope in every argument then is all there is to a
first derivative: forward mode multiplies slopes by tangents, reverse mode by cotangents, a Jacobian
takes them as they are, and `jax.vmap` joins the axis that it maps to the batch. So two functions of
a `Program` serve every transformation, its value and its value with slopes, and where columns can
be read both are compiled for a few numbers of columns and no others (`_chunks`). That holds for
derivatives and `jax.vmap` as well, the rules of which know the values that they transform; under
`jax.jit` and in loops nobody does, and the program is compiled for the columns that there are.
"""

import math
from collections.abc import Sequence
from functools import cache, partial
from typing import Any, Protocol, Self

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.custom_batching import custom_vmap
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from ._chunks import can_be_cut, compiler_options, map_chunks

Leaves = Sequence[Any]


class Program(Protocol):
    """What is solved, hashable: equal programs are compiled once.

    Arguments are a list of arrays with the axes of the batch first, which broadcast.
    """

    @property
    def own_axes(self) -> tuple[int, ...]:
        """Number of axes of each argument that belong to one column."""
        ...

    def known(self, leaves: Leaves) -> Self:
        """The program for columns that can be read; None for others."""
        ...

    def unknown(self) -> Self:
        """The program for columns that cannot be read."""
        ...

    def widths(self, leaves: Leaves) -> Sequence[int]:
        """Numbers of columns that are worth a program, rising."""
        ...

    def value(self, leaves: Leaves) -> Any:
        """A pytree of arrays with the batch's axes first."""
        ...

    def value_and_slopes(
        self, leaves: Leaves, wanted: tuple[bool, ...]
    ) -> tuple[Any, list[Float[Array, "..."]]]:
        """The same, and the slope of every row of it in the arguments that are wanted.

        Rows number the entries of a column's result: those of its first array in order, then those
        of its second, and so on. Slopes in what columns share are each column's own.
        """
        ...


def enter(program: Program, leaves: Leaves) -> Any:
    """Solve columns, differentiable in every argument and under every transformation of JAX."""
    if not any(isinstance(x, Tracer) for x in leaves):
        return _call(program, "value", leaves)
    solution = jax.custom_jvp(lambda *x: _joining(program, "value", x))

    def rule(primals: Leaves, tangents: Leaves) -> tuple[Any, Any]:
        wanted = tuple(_perturbs(x) for x in tangents)
        value, slopes = _linearised(program, wanted, primals)
        if not slopes:
            return value, jax.tree.map(jnp.zeros_like, value)
        axes = tuple(n for n, use in zip(program.own_axes, wanted, strict=True) if use)
        return value, _contracted(slopes, _chosen(tangents, wanted), value, axes)

    solution.defjvp(rule, symbolic_zeros=True)
    return solution(*leaves)


def _chosen(items: Leaves, wanted: Sequence[bool]) -> list[Any]:
    return [item for item, use in zip(items, wanted, strict=True) if use]


def _perturbs(tangent: Any) -> bool:
    """Whether there is a derivative to take: not for constants, nor for integers."""
    return not isinstance(tangent, SymbolicZero) and tangent.dtype != jax.dtypes.float0


@partial(jax.jit, static_argnums=3)
def _contracted(slopes: Leaves, tangents: Leaves, value: Any, own_axes: tuple[int, ...]) -> Any:
    """Slopes times tangents, summed over each column's own axes: linear, so JAX transposes it."""
    rows: Any = 0
    for slope, tangent, count in zip(slopes, tangents, own_axes, strict=True):
        batch, own = tangent.shape[: tangent.ndim - count], tangent.shape[tangent.ndim - count :]
        product = slope * tangent.reshape(*batch, 1, *own)
        rows = rows + jnp.sum(product, axis=tuple(range(product.ndim - count, product.ndim)))
    leaves, structure = jax.tree.flatten(value)
    num_axes = rows.ndim - 1
    counts = [math.prod(x.shape[num_axes:]) for x in leaves]
    parts = jnp.split(rows, np.cumsum(counts)[:-1], axis=num_axes)
    return jax.tree.unflatten(
        structure, [part.reshape(x.shape) for part, x in zip(parts, leaves, strict=True)]
    )


def _linearised(program: Program, wanted: tuple[bool, ...], leaves: Leaves) -> Any:
    """Value and slopes, which can be differentiated again.

    Second derivatives are JAX's own of the program for the columns that there are.
    """
    joining = jax.custom_jvp(lambda *x: _joining(program, wanted, x))

    @joining.defjvp
    def _(primals: Leaves, tangents: Leaves) -> tuple[Any, Any]:
        fixed = _fixed(program, primals)
        return jax.jvp(lambda *x: _jitted(wanted, False)(fixed, list(x)), primals, tangents)

    return joining(*leaves)


def _joining(program: Program, what: Any, leaves: Leaves) -> Any:
    """The program, with axes that `jax.vmap` maps over as more axes of its batch.

    `jax.custom_batching.custom_vmap` alone has no derivatives.
    """
    if not any(isinstance(x, Tracer) for x in leaves):
        return _call(program, what, leaves)
    fixed = program.unknown()

    @custom_vmap
    def joined(leaves: Leaves) -> Any:
        return _jitted(what, False)(fixed, leaves)

    @joined.def_vmap
    def _(size: int, is_mapped: list[list[bool]], leaves: Leaves) -> tuple[Any, Any]:
        num_axes = max(x.ndim - own - m for x, own, m in _with_axes(program, leaves, is_mapped[0]))
        full = [
            x.reshape(size, *(1,) * (num_axes + own + 1 - x.ndim), *x.shape[1:]) if mapped else x
            for x, own, mapped in _with_axes(program, leaves, is_mapped[0])
        ]
        found = _joining(program, what, full)
        return found, jax.tree.map(lambda _: True, found)

    return joined(list(leaves))


def _with_axes(program: Program, leaves: Leaves, mapped: Sequence[bool]) -> Any:
    return list(zip(leaves, program.own_axes, mapped, strict=True))


def _fixed(program: Program, leaves: Leaves) -> Program:
    """The program, with nothing left open."""
    traced = any(isinstance(x, Tracer) for x in leaves)
    return program.unknown() if traced else program.known(leaves)


def _call(program: Program, what: Any, leaves: Leaves) -> Any:
    """The program of columns with values, chunk by chunk where that can be."""
    counts = [np.ndim(x) - own for x, own in zip(leaves, program.own_axes, strict=True)]
    shapes = [np.shape(x)[:n] for x, n in zip(leaves, counts, strict=True)]
    batch = np.broadcast_shapes(*shapes)
    size = math.prod(batch)
    fixed = program.known(leaves)
    if size == 0 or not can_be_cut(leaves):
        return _jitted(what, False)(fixed, [jnp.asarray(x) for x in leaves])
    # Of one column alone, too, what is given without an axis is shared: the program is the same.
    own = [math.prod(shape) > 1 or size == 1 and len(shape) == len(batch) for shape in shapes]
    flat = [
        _flat(np.asarray(x), np.shape(x)[n:], batch if each else ())
        for x, n, each in zip(leaves, counts, own, strict=True)
    ]
    key = fixed, what
    function = partial(_jitted(what, True), fixed)
    return map_chunks(function, key, flat, own, batch, fixed.widths(flat))


def _flat(x: np.ndarray, own: tuple[int, ...], batch: tuple[int, ...]) -> np.ndarray:
    """The same with one axis for the batch, a view where it can be."""
    return np.broadcast_to(x, (*batch, *own)).reshape(-1, *own) if batch else x.reshape(1, *own)


@cache
def _jitted(what: Any, alone: bool) -> Any:
    """The value, or the value and slopes in what is wanted, compiled.

    `alone`: called with values, so that options of the compiler can be given, which JAX does not
    take inside another `jax.jit`.
    """

    def call(program: Program, leaves: Leaves) -> Any:
        if what == "value":
            return program.value(leaves)
        return program.value_and_slopes(leaves, what)

    return jax.jit(call, static_argnums=0, compiler_options=compiler_options() if alone else None)


def slopes_by_reverse_mode(
    value: Any, leaves: Leaves, wanted: Sequence[bool], own_axes: Sequence[int]
) -> tuple[Any, list[Float[Array, "..."]]]:
    """Value and slopes of a function of leaves, in one sweep for all columns.

    Those of other columns do not change a column's result, so that one pull gives all of them.
    """
    counts = [x.ndim - own for x, own in zip(leaves, own_axes, strict=True)]
    batch = jnp.broadcast_shapes(*(x.shape[:n] for x, n in zip(leaves, counts, strict=True)))
    full = [
        jnp.broadcast_to(x, (*batch, *x.shape[n:])) if use else x
        for x, n, use in zip(leaves, counts, wanted, strict=True)
    ]

    def of_wanted(some: Leaves) -> Any:
        rest = iter(some)
        return value([next(rest) if use else x for x, use in zip(full, wanted, strict=True)])

    result, pull_back = jax.vjp(of_wanted, _chosen(full, wanted))
    outputs, structure = jax.tree.flatten(result)
    shapes = [x.shape[len(batch) :] for x in outputs]
    rows = np.eye(sum(math.prod(x) for x in shapes), dtype=outputs[0].dtype)

    def slopes_of(row: Array) -> list[Array]:
        parts = jnp.split(row, np.cumsum([math.prod(x) for x in shapes])[:-1])
        seeds = [
            jnp.broadcast_to(part.reshape(shape), x.shape)
            for part, shape, x in zip(parts, shapes, outputs, strict=True)
        ]
        return pull_back(jax.tree.unflatten(structure, seeds))[0]

    if len(rows) == 1:
        return result, [jnp.expand_dims(x, len(batch)) for x in slopes_of(jnp.asarray(rows[0]))]
    slopes = jax.vmap(slopes_of)(jnp.asarray(rows))
    return result, [jnp.moveaxis(x, 0, len(batch)) for x in slopes]
