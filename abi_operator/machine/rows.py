"""Functions of a matrix's entries, of few columns in long rows.

What beams see of a layer is a few numbers for each node and column. LLVM unrolls a loop over 16 or
32 columns with as little in it as a sum, number by number, before it could make vectors of it; not
so where all that lies in a row is one axis.
"""

import math
from collections.abc import Callable
from functools import wraps

import jax
import jax.numpy as jnp
from jaxtyping import Array

from .algebra import Entry, fenced, is_entry
from .compiler import shortest_loop


def in_rows(function: Callable) -> Callable:
    """`function` of numbers, one or one a column, and of arrays ``... row *batch``, entry by entry.

    It is given a tree of numbers and trees of such arrays, and goes through these leaf by leaf, all
    in one kernel, or of few columns (`are_few`) each leaf in one of its own, in long rows. Arrays
    may lack first axes that others of their leaf have; a tree may be None, and so may its leaves.
    What is returned for a leaf has the shape of the largest of its arrays.
    """
    alone = fenced(function)

    @fenced
    def together(numbers, trees):
        structure, leaves = _by_leaf(*trees)
        return structure.unflatten(function(numbers, *x) for x in leaves)

    @wraps(function)
    def call(numbers, *trees):
        structure, leaves = _by_leaf(*trees)
        firsts = [x[0] for x in leaves]
        if not are_few(firsts[0]):
            return together(numbers, trees)
        given = [[x for x in some if x is not None] for some in leaves]
        axes = [jnp.ndim(x) for x in jax.tree.leaves(numbers) if jnp.ndim(x)]
        own = 1 + axes[0] if axes else min(len(x.shape) for some in given for x in some)
        size = math.prod(firsts[0].shape[len(firsts[0].shape) + 1 - own :])
        longest = max(x.shape[-own] for x in firsts)
        along = jax.tree.map(lambda x: _along(x, longest) if jnp.ndim(x) else x, numbers)

        def of_leaf(some, x):
            count = size * x[0].shape[-own]
            rows = [y if y is None else _in_row(y, own) for y in x]
            found = alone(jax.tree.map(lambda y: y[:count] if jnp.ndim(y) else y, along), *rows)
            shape = max((y.shape for y in some), key=len)
            return jax.tree.map(lambda y: y.reshape(shape), found)

        return structure.unflatten(map(of_leaf, given, leaves))

    return call


def _by_leaf(first, *others):
    """Structure of the first tree, and what all have for each of its leaves."""
    leaves, structure = jax.tree.flatten(first, is_leaf=is_entry)
    none = [None] * len(leaves)
    more = [none if x is None else structure.flatten_up_to(x) for x in others]
    return structure, list(zip(leaves, *more, strict=True))


def are_few(x: Array | Entry) -> bool:
    """Whether LLVM would unroll loops over these columns, see `compiler.shortest_loop`."""
    return x.shape[-1] < shortest_loop()


def _in_row(x, own):
    """With so many last axes as one."""
    shape = *x.shape[: len(x.shape) - own], math.prod(x.shape[len(x.shape) - own :])
    return Entry(x.stack, x.place, shape) if isinstance(x, Entry) else x.reshape(shape)


def _along(weight, count):
    if count == 1:
        return weight.reshape(-1)
    return fenced(lambda w: jnp.broadcast_to(w, (count, *w.shape)).reshape(-1))(weight)
