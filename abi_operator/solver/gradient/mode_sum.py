r"""The derivative of the sum over azimuth modes: one gradient for all of them.

The pass up and down the layers of one mode is `mode`.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from ...machine.kernels import one_kernel
from ..method.adding import add_layer, top
from ..method.azimuth import mode_kernels
from ..method.bordered import Bordered
from ..method.doublings import Doublings
from ..method.ground import black
from ..method.layer import half_layer, node_functions
from ..method.mode_layers import Layers, Order, read
from .mode import Kernels, Shared, mode_slopes
from .room import Keeper

_LATER = slice(1, None)  # modes but the mean
_WHOLE = 2  # nodes up to which all layers of all modes are one kernel


class ModeSum(NamedTuple):
    r"""All that the modes of one view depend on; every array is a variable.

    Parameters
    ----------
    tau, coalbedo
        Scaled thickness; 1 - ssa, of which mode 0 makes use. [-]
    sun_secants, view_secant
        By which the beams are attenuated. [-]
    moments
        :math:`\omega(2l+1)\\chi_l` of even and of odd degrees.
    beams
        Legendre functions at sun and view (`method.azimuth.LegendreTables`), even and odd l + m.
    ground, grounds
        Admittance of the ground in mode 0, and in modes 1, 2, ... on the first axis of every leaf;
        None is black.
    weights
        Of each mode's reflection in the sum.
    """

    tau: Float[Array, "layer *batch"]
    coalbedo: Float[Array, "layer *batch"]
    sun_secants: Float[Array, "layer *batch"]
    view_secant: Float[Array, "*batch"]
    moments: tuple[Float[Array, "layer degree *batch"], Float[Array, "layer degree *batch"]]
    beams: tuple[Float[Array, "mode 2 degree *batch"], Float[Array, "mode 2 degree *batch"]]
    ground: Bordered
    grounds: Bordered | None
    weights: Float[Array, "mode *batch"]


@partial(jax.custom_jvp, nondiff_argnums=(2,))
def mode_sum(
    inputs: ModeSum, doublings: Doublings, single_scattering: bool
) -> Float[Array, "*batch"]:
    """Sum over the modes of weight times reflection, whose derivatives come from its gradient.

    Columns do not see each other. The rule is linear in the tangents, so that one gradient serves
    forward and reverse mode, and slopes that nobody asks for are not computed.
    """
    value = partial(_reflectance, single_scattering=single_scattering)
    num_nodes = inputs.moments[0].shape[1]
    # With more nodes there is less to gain, and more than twice as much to compile.
    return (one_kernel(value, num_nodes) if num_nodes <= _WHOLE else value)(inputs, doublings)


def _reflectance(
    inputs: ModeSum, doublings: Doublings, single_scattering: bool
) -> Float[Array, "*batch"]:
    modes = _Modes(inputs)

    def reflection(mean: bool, mode: _Mode) -> Array:
        def put_on(stack, layers, doublings, odd, kernels, view_secant, *number):
            # Of a layer that is the only one XLA would find no use for the number (`one_kernel`).
            place = number[0] if number else jnp.zeros_like(odd)
            layer = layers.layer(place, odd)
            a, p = layer.matrices(mean, kernels, view_secant, single_scattering)
            own = jax.tree.map(lambda x: read(x, place), doublings)
            return add_layer(stack, *half_layer(a, p, layer.tau, own), layer.tau)

        put_on = one_kernel(put_on, modes.num_nodes, in_parts=True)
        kernels, view_secant = _kernels(mode.nodes, mode.beams), inputs.view_secant
        shared = modes.layers, doublings, mode.order.odd, kernels, view_secant

        def add(stack, *number):
            return put_on(stack, *shared, *number), None

        ground = modes.ground(mode, mean)
        numbers = jnp.arange(inputs.tau.shape[0], dtype=inputs.tau.dtype)
        if numbers.size == 1:
            stack, _ = add(ground)
        else:
            stack, _ = jax.lax.scan(add, ground, numbers, reverse=True)
        return mode.weight * top(stack).reflection()[0]

    # Without slopes a kernel for the mean alone is soon compiled, and a tenth faster than to ask in
    # each layer which mode it is.
    first, others = (jax.tree.map(lambda x, i=i: x[i], modes.all()) for i in (0, _LATER))
    return jax.lax.scan(
        lambda total, mode: (total + reflection(False, mode), None), reflection(True, first), others
    )[0]


@partial(mode_sum.defjvp, symbolic_zeros=True)
def _mode_sum_jvp(single_scattering, primals, tangents):
    inputs, doublings = primals
    value, gradient = reflectance_and_gradient(inputs, doublings, single_scattering)
    change = jnp.zeros_like(value)
    for slope, tangent in zip(jax.tree.leaves(gradient), jax.tree.leaves(tangents[0]), strict=True):
        if not isinstance(tangent, SymbolicZero):
            change = change + jnp.sum(slope * tangent, axis=tuple(range(slope.ndim - value.ndim)))
    return value, change


@partial(jax.custom_jvp, nondiff_argnums=(2,))
def reflectance_and_gradient(
    inputs: ModeSum, doublings: Doublings, single_scattering: bool
) -> tuple[Float[Array, "*batch"], ModeSum]:
    """Sum over the modes of weight times reflection, and its slope in every input.

    Each column's slope is that of its own value. Slopes in the ground's cores are symmetric.
    `Doublings.most` must be given: there is room for so many.
    """
    if doublings.most is None:
        raise TypeError("slopes need a largest number of doublings.")
    modes = _Modes(inputs)
    how = doublings, single_scattering
    shared = Shared(modes.layers, inputs.view_secant)

    def step(carry, mode):
        value, slopes, of_mean, room = carry
        kernels, ground = _kernels(mode.nodes, mode.beams), modes.ground(mode)
        reflection, room, found = mode_slopes(
            shared, *how, mode.order, kernels, ground, mode.weight, slopes, room
        )
        if inputs.grounds is None:
            mean = mode.order.mean
            of_mean = jax.tree.map(lambda x, new: x + mean * new, of_mean, found.ground)
        own = None if inputs.grounds is None else found.ground
        value = value + mode.weight * reflection
        beams = found.even_beams, found.odd_beams
        return (value, found.shared, of_mean, room), (reflection, beams, own)

    nothing = jax.tree.map(jnp.zeros_like, (inputs.view_secant, shared, inputs.ground))
    space = Keeper(inputs.tau, modes.num_nodes, doublings.most).empty()
    carry, rows = jax.lax.scan(step, (*nothing, space), modes.all())
    (value, slopes, of_mean, _), (reflections, beams, of_grounds) = carry, rows
    if of_grounds is not None:
        of_mean, of_grounds = (jax.tree.map(lambda x, i=i: x[i], of_grounds) for i in (0, _LATER))
    summed = slopes.layers
    moments = summed.moments.reshape(2, -1, *summed.moments.shape[1:])
    gradient = ModeSum(
        tau=summed.tau,
        coalbedo=summed.coalbedo,
        sun_secants=summed.sun_secant,
        view_secant=slopes.view_secant,
        moments=(moments[0], moments[1]),
        beams=beams,
        ground=of_mean,
        grounds=of_grounds,
        weights=reflections,
    )
    return value, gradient


@reflectance_and_gradient.defjvp
def _second_derivative(single_scattering, primals, tangents):
    inputs, doublings = primals

    def written_out(inputs):
        return reflectance_and_gradient.fun(inputs, doublings.written_out(), single_scattering)

    return jax.jvp(written_out, (inputs,), tangents[:1])


class _Mode(NamedTuple):
    """Of one mode; its ground is None where modes but the first see a black one."""

    order: Order
    weight: Float[Array, "*batch"]
    ground: Bordered | None
    nodes: tuple[Array, Array]
    beams: tuple[Array, Array]


class _Modes:
    """The inputs as the modes see them."""

    def __init__(self, inputs: ModeSum):
        even, odd = inputs.moments
        self.inputs = inputs
        both = jnp.concatenate([even, odd])
        self.layers = Layers(inputs.tau, inputs.coalbedo, inputs.sun_secants, both)
        self.num_nodes = even.shape[1]
        self.num_streams = 2 * self.num_nodes
        self.num_modes = inputs.weights.shape[0]
        functions = node_functions(self.num_streams, self.num_modes)
        self.nodes = self._nodes(functions, 0), self._nodes(functions, 1)

    def _nodes(self, functions: np.ndarray, parity: int) -> Array:
        """Functions at the nodes of the degrees of one parity of l + m, all modes."""
        rows = [functions[m, (m + parity) % 2 :: 2].T for m in range(self.num_modes)]
        return jnp.asarray(np.stack(rows), self.inputs.tau.dtype)

    def all(self) -> _Mode:
        """What differs from mode to mode, on the first axis."""
        x = self.inputs
        number = jnp.arange(self.num_modes, dtype=x.tau.dtype)
        order = Order(number % 2, (number == 0).astype(x.tau.dtype))
        grounds = x.grounds
        if grounds is not None:
            grounds = jax.tree.map(lambda a, b: jnp.concatenate([a[None], b]), x.ground, grounds)
        return _Mode(order, x.weights, grounds, self.nodes, x.beams)

    def ground(self, mode: _Mode, mean: bool | None = None) -> Bordered:
        """Ground of a mode; `mean` tells whether it is the mean, where that is known."""
        if mode.ground is not None:
            return mode.ground
        of_mean = self.inputs.ground
        nothing = black(jnp.ones_like(of_mean.diagonal), self.num_streams)
        if mean is not None:
            return of_mean if mean else nothing
        is_mean = mode.order.mean > 0
        return jax.tree.map(lambda x, y: jnp.where(is_mean, x, y), of_mean, nothing)


def _kernels(nodes, beams) -> Kernels:
    a, b = (mode_kernels(n, v) for n, v in zip(nodes, beams, strict=True))
    return a, b
