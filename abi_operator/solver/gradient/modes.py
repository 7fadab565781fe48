"""What sums over azimuth modes share, of reflections (`mode_sum`) and of radiances (`emission`)."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from ..method.around import Above
from ..method.azimuth import mode_kernels
from ..method.bordered import Bordered
from ..method.ground import black
from ..method.layer import node_functions
from ..method.mode_layers import Order
from ..skipping import budget
from ..skipping.plan import Plan
from .mode import Kernels

LATER = slice(1, None)
"""Modes but the mean."""
WHOLE = 2
"""Nodes up to which all layers of all modes are one kernel: with more there is less to gain, and
more than twice as much to compile."""


class How(NamedTuple):
    """What is static in a sum over modes.

    Parameters
    ----------
    single_scattering
        Whether modes contain the light scattered once in a layer and nowhere else.
    error_budget
        Relative error of the light that may be made (`skipping`); None solves everything.
    most
        Doublings of a layer, at most: slopes have room for so many. None sets no limit to values.
    delta_m
        Whether forward peaks are scaled away.
    """

    single_scattering: bool
    error_budget: float | None
    most: int | None
    delta_m: bool = True

    def rounds(self, plan: Plan) -> bool:
        """Whether single precision is enough (`method.rounding`)."""
        return self.delta_m and budget.rounds(plan.error_budget)


class Mode(NamedTuple):
    """Of one mode; its ground is None where modes but the first see a black one, and what lies
    above its layers where that is free space."""

    order: Order
    weight: Float[Array, "*own_and_batch"]
    ground: Bordered | None
    nodes: tuple[Array, Array]
    beams: tuple[Array, Array]
    above: Above | None = None

    def kernels(self) -> Kernels:
        """Those from which A and B are built."""
        a, b = (mode_kernels(n, v) for n, v in zip(self.nodes, self.beams, strict=True))
        return a, b

    def below(self, of_mean: Bordered, mean: bool | None = None) -> Bordered:
        """Ground of the mode, that of the mean given; `mean` tells whether it is that, if known."""
        if self.ground is not None:
            return self.ground
        nothing = black(jnp.ones_like(of_mean.diagonal), 2 * of_mean.core.shape[0])
        if mean is not None:
            return of_mean if mean else nothing
        is_mean = self.order.mean > 0
        return jax.tree.map(lambda x, y: jnp.where(is_mean, x, y), of_mean, nothing)


def every_mode(
    ground: Bordered,
    grounds: Bordered | None,
    weights: Float[Array, "mode *own_and_batch"],
    beams: tuple[Array, Array],
    num_nodes: int,
    above: Above | None = None,
) -> Mode:
    """What differs from mode to mode, on the first axis.

    Parameters
    ----------
    ground, grounds
        Admittance of the ground in mode 0, and in modes 1, 2, ...; None is black.
    weights
        Of each mode in its sum.
    beams
        Legendre functions at the beams, even and odd l + m.
    num_nodes
        Half of the streams.
    above
        Layers above those that are solved, in all modes; None of free space.
    """
    dtype, num_modes = weights.dtype, weights.shape[0]
    functions = node_functions(2 * num_nodes, num_modes)

    def nodes(parity: int) -> Array:
        """Functions at the nodes of the degrees of one parity of l + m."""
        rows = [functions[m, (m + parity) % 2 :: 2].T for m in range(num_modes)]
        return jnp.asarray(np.stack(rows), dtype)

    number = jnp.arange(num_modes, dtype=dtype)
    order = Order(number % 2, (number == 0).astype(dtype))
    if grounds is not None:
        grounds = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), ground, grounds)
    return Mode(order, weights, grounds, (nodes(0), nodes(1)), beams, above)


def along(slopes: Any, tangents: Any, value: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
    """Change of a value from its slopes; those that nobody asks for are not computed."""
    change = jnp.zeros_like(value)
    for slope, tangent in zip(jax.tree.leaves(slopes), jax.tree.leaves(tangents), strict=True):
        if not isinstance(tangent, SymbolicZero):
            change = change + jnp.sum(slope * tangent, axis=tuple(range(slope.ndim - value.ndim)))
    return change
