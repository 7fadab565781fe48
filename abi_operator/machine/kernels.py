"""Many small operations compiled to one piece of machine code.

To start a kernel takes a CPU as long as the arithmetic of 2 x 2 or 4 x 4 matrices on a tile of
columns, and a layer has a hundred kernels. XLA compiles a call marked ``xla_cpu_small_call`` whole,
loops included, as it does the smallest loops of any program; other backends are not given the mark.

The call is a primitive of its own, because a `jax.jit` is taken apart where derivatives are: into
what is known and what is not, piece by piece, of which XLA then makes no kernel.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax.experimental.xla_metadata import set_xla_metadata
from jax.extend.core import ClosedJaxpr, Primitive, jaxpr_as_fun
from jax.interpreters import ad, batching, mlir
from jax.interpreters import partial_eval as pe

from .plain import is_plain

# Rows of matrices up to which a layer is one kernel: see `one_kernel`.
_LARGEST, _LARGEST_OF_FLOAT32, _LARGEST_IN_PARTS = 8, 4, 12

# Entries of a border, rows times beams, up to which it is: of tiles of 64 columns, and of fewer.
_LARGEST_BORDER, _LARGEST_OF_FEWER = 128, 156
_MOST_BEAMS = 32

# Bytes from which on XLA shares an operation among threads; not those that only move or hold data.
_SHARED_FROM = 2**19
_MOVING = ("broadcast_in_dim", "dynamic_update_slice", "reshape", "slice", "squeeze")

_one_kernel = Primitive("one_kernel")
_one_kernel.multiple_results = True


def one_kernel(
    function: Callable[..., Any], num_nodes: int, in_parts: bool = False, num_beams: int = 2
) -> Callable[..., Any]:
    """`function`, of matrices with `num_nodes` rows and a tile of columns, as one kernel.

    XLA has neither code in it for a ``dot`` nor for an operation that it would share among threads,
    and does not compile a program with one: an operation on half a megabyte, or of more arithmetic
    than bytes on 20 kilobytes. With the tiles of `batching` there is none of the second kind up to
    8 rows in float64, nor up to 4 in float32, whose bytes are half as many (12 of both where sums
    come `in_parts`: with 10, the rows of 20 streams, a value then takes 0.65 of the time, and half
    as long again to compile; with 5 to 12 slopes in float32 take 0.6 to 0.8 of it). A matrix with a
    column for each of many views is shared, too, from 65 of them at 4 rows, 24 at 8 and 16 at 12,
    and the largest of 39 is a ``dot``: with more than about half as many nothing is marked. A
    function of larger ones is not marked, but one call all the same: taken apart, in a loop over
    layers, its parts that need the layer alone would be computed for all layers ahead and read one
    by one, by a hundred kernels. A function with an operation of the first kind (of very many
    layers) is left as it is, and so are derivatives of `function` and what `jax.vmap` makes of it,
    in which nobody has counted.

    Nor does XLA compile a kernel with an argument that is of no use in it (the process ends with
    "All or none of the slices should have an explicit index"). Arguments that `function` does not
    read are left out here, and empty ones make it be left as it is. One whose use XLA optimises
    away, such as the number of the one entry that there is, must not be given.

    Parameters
    ----------
    function
        Of pytrees of arrays, to a pytree of arrays. It must not close over traced arrays.
    num_nodes
        Rows of the matrices.
    in_parts
        Whether no operation has more arithmetic than bytes, because long sums come in parts
        (`algebra.product`, `algebra.weighted_sum`).
    num_beams
        Columns of the widest matrix that has `num_nodes` rows and is not square.
    """

    def call(*args: Any) -> Any:
        if is_plain():
            return function(*args)
        leaves, structure = jax.tree.flatten(args)

        def flat(*leaves: Any) -> Any:
            return function(*jax.tree.unflatten(structure, leaves))

        jaxpr, shape = jax.make_jaxpr(flat, return_shape=True)(*leaves)
        body, used = pe.dce_jaxpr(jaxpr.jaxpr, [True] * len(jaxpr.jaxpr.outvars))
        wanted = [x for x, use in zip(leaves, used, strict=True) if use]
        small = small_enough(num_nodes, jnp.result_type(*leaves), in_parts, num_beams)
        empty = any(x.size == 0 for x in wanted)
        if empty or (small and _largest_operation(body) >= _SHARED_FROM):
            return function(*args)
        results = _one_kernel.bind(*wanted, jaxpr=ClosedJaxpr(body, jaxpr.consts), small=small)
        return jax.tree.unflatten(jax.tree.structure(shape), results)

    return call


def small_enough(num_nodes: int, dtype: Any, in_parts: bool = False, num_beams: int = 2) -> bool:
    """Whether matrices with so many rows can be in one kernel; see there for the arguments."""
    entries = _LARGEST_BORDER if num_nodes <= _LARGEST else _LARGEST_OF_FEWER
    if num_beams > _MOST_BEAMS or num_nodes * num_beams > entries:
        return False
    if in_parts:
        return num_nodes <= _LARGEST_IN_PARTS
    double = jnp.dtype(dtype) == jnp.float64
    return num_nodes <= (_LARGEST if double else _LARGEST_OF_FLOAT32)


def _largest_operation(jaxpr: Any) -> int:
    """Bytes of the largest result of an operation."""
    sizes = [0]
    for equation in jaxpr.eqns:
        inner = [x for x in jax.tree.leaves(equation.params) if isinstance(x, ClosedJaxpr)]
        sizes += [_largest_operation(x.jaxpr) for x in inner]
        if not inner and equation.primitive.name not in _MOVING:
            sizes += [x.aval.size * x.aval.dtype.itemsize for x in equation.outvars]
    return max(sizes)


@_one_kernel.def_impl
def _impl(*leaves: Any, jaxpr: ClosedJaxpr, small: bool) -> Any:
    return jax.jit(lambda *x: _one_kernel.bind(*x, jaxpr=jaxpr, small=small))(*leaves)


@_one_kernel.def_abstract_eval
def _abstract_eval(*_: Any, jaxpr: ClosedJaxpr, small: bool) -> Any:
    return jaxpr.out_avals


def _unmarked(*leaves: Any, jaxpr: ClosedJaxpr, small: bool) -> Any:
    return jaxpr_as_fun(jaxpr)(*leaves)


def _marked(*leaves: Any, jaxpr: ClosedJaxpr, small: bool) -> Any:
    if not small:
        return _unmarked(*leaves, jaxpr=jaxpr, small=small)
    compiled = jax.jit(jaxpr_as_fun(jaxpr))
    with set_xla_metadata(inlineable="false", xla_cpu_small_call="true"):
        return compiled(*leaves)


def _jvp(primals: Any, tangents: Any, *, jaxpr: ClosedJaxpr, small: bool) -> Any:
    tangents = [
        jnp.zeros_like(x) if isinstance(t, ad.Zero) else t
        for x, t in zip(primals, tangents, strict=True)
    ]
    return jax.jvp(jaxpr_as_fun(jaxpr), tuple(primals), tuple(tangents))


def _batch(leaves: Any, axes: Any, *, jaxpr: ClosedJaxpr, small: bool) -> Any:
    mapped = jax.vmap(jaxpr_as_fun(jaxpr), axes)(*leaves)
    return mapped, [0] * len(mapped)


mlir.register_lowering(_one_kernel, mlir.lower_fun(_unmarked, multiple_results=True))
mlir.register_lowering(_one_kernel, mlir.lower_fun(_marked, multiple_results=True), platform="cpu")
ad.primitive_jvps[_one_kernel] = _jvp
batching.primitive_batchers[_one_kernel] = _batch
