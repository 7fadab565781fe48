"""Slopes at faces between layers: the two fields' own are those of the matrix that they make."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.solver.gradient.fields import Fields, pair
from abi_operator.solver.gradient.interface import slopes_at_face
from abi_operator.solver.gradient.pull_back import undo_matrix
from abi_operator.solver.method.azimuth import mode_kernels
from abi_operator.solver.method.bordered import Bordered
from abi_operator.solver.method.layer import node_functions
from abi_operator.solver.method.mode_layers import Order

STREAMS, NODES, BATCH = 4, 2, 3


def draw(seed=0):
    """Fields, a stack that is symmetric, and what beams are made of; neither is physical."""
    rng = np.random.default_rng(seed)
    normal = lambda *own: jnp.asarray(rng.normal(size=(*own, BATCH)))  # noqa: E731
    core = normal(NODES, NODES)
    core = core + jnp.swapaxes(core, 0, 1)
    stack = Bordered(core, normal(NODES, 2), jnp.ones((2, BATCH)), normal(1))
    return Fields(normal(NODES, 2), normal(2), normal(2)), stack, normal(2, 2, NODES)


@partial(jax.jit, static_argnums=5)
def both_ways(fields, stack, kernels, secant, order, single_scattering):
    """By `slopes_at_face`, and from both cotangents as matrices."""
    found = slopes_at_face(fields, stack, kernels, secant, single_scattering, order)
    behind = jnp.einsum("ijb,jkb->ikb", stack.core, fields.nodes) + stack.border * fields.own
    sent = jnp.sum(stack.border[:, ::-1] * fields.nodes, axis=0) + stack.corner * fields.own
    behind = Fields(behind, fields.own, sent + fields.other)
    nothing, none = jnp.zeros((NODES, BATCH)), jnp.zeros(BATCH)
    rest = nothing, jnp.stack([none, secant])
    a, coalbedo = undo_matrix(
        kernels[0], *rest, pair(1.0, [fields]), single_scattering, none, order.mean
    )
    b, _ = undo_matrix(
        kernels[1], *rest, pair(-1.0, [behind]), single_scattering, none, 0 * order.mean
    )
    moments = [
        jnp.where(order.odd > 0, *x) for x in ((b.moments, a.moments), (a.moments, b.moments))
    ]
    single = jnp.stack([a.h + b.h, coalbedo, a.secants[0] + b.secants[0]])
    return found, jnp.concatenate([single, *moments])


@pytest.mark.parametrize("single_scattering", [False, True])
@pytest.mark.parametrize("mode", [0, 1])
def test_faces_see_two_fields(mode, single_scattering):
    fields, stack, beams = draw()
    nodes = node_functions(STREAMS, 2)[mode]
    kernels = tuple(
        mode_kernels(jnp.asarray(nodes[(mode + parity) % 2 :: 2].T), beams[parity])
        for parity in range(2)
    )
    order = Order(jnp.asarray(float(mode)), jnp.asarray(1.0 - mode))
    secant = jnp.linspace(1, 2, BATCH)
    found, wanted = both_ways(fields, stack, kernels, secant, order, single_scattering)
    np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)
    given = jax.tree.map(lambda x: x.astype(jnp.float32), (fields, stack, kernels, secant, order))
    single = jax.eval_shape(
        partial(slopes_at_face, single_scattering=single_scattering), *given[:4], order=given[4]
    )
    assert single.dtype == jnp.float32
