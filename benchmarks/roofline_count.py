"""Multiplications of one layer in one azimuth mode, counted in what JAX traces, for `roofline.py`.

A value goes up the layers, a gradient comes down as well (`abi_operator.solver.gradient`): both are
counted alike, every product of two numbers and every quotient, also those by a number that a whole
matrix is multiplied with.
"""

import jax
import jax.numpy as jnp
import numpy as np

from abi_operator.machine.algebra import Rows
from abi_operator.solver.gradient.fields import Fields
from abi_operator.solver.gradient.layer import climb, descend
from abi_operator.solver.gradient.pull_back import undo_inverse, undo_matrix
from abi_operator.solver.method.bordered import Bordered
from abi_operator.solver.method.doublings import Doublings
from abi_operator.solver.method.layer import ModeKernels, layer_matrix

_COLUMNS = 64  # so many as no small tile is treated in another way


def up_and_down(num_streams, num_doublings):
    """Multiplications a column on the way up and on the way down."""
    n = num_streams // 2
    doublings = Doublings(None, num_doublings)
    kernels = ModeKernels(jnp.ones((n, n, n)), jnp.ones((n, n)), _ones(2, n))
    ground = Bordered(_ones(n, n), _ones(n, 2), _ones(2), _ones(1))
    moments, secants, tau = _ones(n), _ones(2), _ones()

    def up(stack, moments, tau):
        a = layer_matrix(kernels, moments, secants, False)
        p = layer_matrix(kernels, moments, secants, False).inverse()
        halves = []
        stack, _, kept, _ = climb(
            stack, None, None, a, p, tau, doublings, None, lambda _, new, k: halves.append(new)
        )
        return stack, *_joined((kept, halves))

    def down(fields, tau, kept, halves):
        below, a, p = descend(fields, tau, secants, kept, doublings, lambda k: halves[int(k)])
        nothing = jnp.zeros(())
        of_a = undo_matrix(kernels, moments, secants, a, False, tau, nothing)
        return below, of_a, undo_inverse(kernels, moments, kept.b_inverse, p, False)

    given = ground, moments, tau
    _, kept, halves = jax.tree.map(lambda x: jnp.ones(x.shape), jax.eval_shape(up, *given))
    fields = Fields(_ones(n, 2), _ones(2), _ones(2))
    traced = jax.make_jaxpr(up)(*given), jax.make_jaxpr(down)(fields, tau, kept, halves)
    return tuple(_multiplications(x.jaxpr) for x in traced)


def _ones(*shape):
    return jnp.ones((*shape, _COLUMNS))


def _joined(tree):
    def whole(x):
        return x.joined() if isinstance(x, Rows) else x

    return jax.tree.map(whole, tree, is_leaf=lambda x: isinstance(x, Rows))


def _multiplications(jaxpr):
    count = 0
    for equation in jaxpr.eqns:
        inner = [_multiplications(x) for x in _inside(equation.params)]
        # Of branches the one that does most.
        count += max(inner, default=0) if equation.primitive.name == "cond" else sum(inner)
        if equation.primitive.name in ("mul", "div"):
            count += int(np.prod(equation.outvars[0].aval.shape)) // _COLUMNS
        if equation.primitive.name == "dot_general":
            contracted = equation.params["dimension_numbers"][0][0]
            terms = np.prod([equation.invars[0].aval.shape[k] for k in contracted])
            count += int(np.prod(equation.outvars[0].aval.shape) * terms) // _COLUMNS
    return count


def _inside(params):
    for value in params.values():
        for x in value if isinstance(value, tuple | list) else [value]:
            x = getattr(x, "jaxpr", x)
            if hasattr(x, "eqns"):
                yield x
