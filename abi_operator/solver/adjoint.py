r"""The derivative of the sum over azimuth modes: one gradient for all of them.

The pass up and down the layers of one mode is `mode_slopes`.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from .._kernels import one_kernel
from .adding import add_layer, top
from .azimuth import mode_kernels
from .bordered import Bordered
from .ground import black
from .layer import half_layer, node_functions
from .layer_adjoint import Layers
from .mode_slopes import Kernels, Shared, mode_slopes

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
        Legendre functions at sun and view (`azimuth.LegendreTables`), even and odd l + m.
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


@partial(jax.custom_jvp, nondiff_argnums=(1, 2))
def mode_sum(
    inputs: ModeSum, num_doublings: int, single_scattering: bool
) -> Float[Array, "*batch"]:
    """Sum over the modes of weight times reflection, whose derivatives come from its gradient.

    Columns do not see each other. The rule is linear in the tangents, so that one gradient serves
    forward and reverse mode, and slopes that nobody asks for are not computed.
    """
    value = partial(_reflectance, num_doublings=num_doublings, single_scattering=single_scattering)
    num_nodes = inputs.moments[0].shape[1]
    # With more nodes there is less to gain, and more than twice as much to compile.
    return (one_kernel(value, num_nodes) if num_nodes <= _WHOLE else value)(inputs)


def _reflectance(
    inputs: ModeSum, num_doublings: int, single_scattering: bool
) -> Float[Array, "*batch"]:
    modes = _Modes(inputs)

    def put_on(stack, layers, odd, kernels, view_secant, *number):
        # Of a layer that is the only one XLA would find no use for the number (see `one_kernel`).
        layer = layers.layer(number[0] if number else jnp.zeros_like(odd), odd)
        a, p = layer.matrices(kernels, view_secant, single_scattering)
        return add_layer(stack, *half_layer(a, p, layer.tau, num_doublings), layer.tau)

    put_on = one_kernel(put_on, modes.num_nodes, in_parts=True)

    def reflection(layers, odd, kernels, ground):
        def add(stack, *number):
            return put_on(stack, layers, odd, kernels, inputs.view_secant, *number), None

        numbers = jnp.arange(layers.tau.shape[0], dtype=layers.tau.dtype)
        if numbers.size == 1:
            stack, _ = add(ground)
        else:
            stack, _ = jax.lax.scan(add, ground, numbers, reverse=True)
        return top(stack).reflection()[0]

    def step(total, mode):
        return total + mode.weight * reflection(modes.layers, *modes.seen_by(mode)), None

    value = inputs.weights[0] * reflection(modes.layers_of_the_mean, *modes.first())
    return jax.lax.scan(step, value, modes.others())[0]


@partial(mode_sum.defjvp, symbolic_zeros=True)
def _mode_sum_jvp(num_doublings, single_scattering, primals, tangents):
    value, gradient = reflectance_and_gradient(primals[0], num_doublings, single_scattering)
    change = jnp.zeros_like(value)
    for slope, tangent in zip(jax.tree.leaves(gradient), jax.tree.leaves(tangents[0]), strict=True):
        if not isinstance(tangent, SymbolicZero):
            change = change + jnp.sum(slope * tangent, axis=tuple(range(slope.ndim - value.ndim)))
    return value, change


def reflectance_and_gradient(
    inputs: ModeSum, num_doublings: int, single_scattering: bool
) -> tuple[Float[Array, "*batch"], ModeSum]:
    """Sum over the modes of weight times reflection, and its slope in every input.

    Each column's slope is that of its own value. Slopes in the ground's cores are symmetric.
    """
    modes = _Modes(inputs)

    def solve(layers, odd, kernels, ground, weight, slopes, kept):
        shared, how = Shared(layers, inputs.view_secant), (num_doublings, single_scattering)
        return mode_slopes(shared, *how, odd, kernels, ground, weight, slopes, kept)

    layers = modes.layers_of_the_mean
    nothing = jax.tree.map(jnp.zeros_like, Shared(layers, inputs.view_secant))
    first, kept, mean = solve(layers, *modes.first(), inputs.weights[0], nothing, None)
    coalbedo = mean.shared.layers.coalbedo
    assert coalbedo is not None  # mode 0 depends on it

    def step(carry, mode):
        value, shared, kept = carry
        reflection, kept, slopes = solve(
            modes.layers, *modes.seen_by(mode), mode.weight, shared, kept
        )
        ground = None if mode.ground is None else slopes.ground
        return (
            (value + mode.weight * reflection, slopes.shared, kept),
            (reflection, (slopes.even_beams, slopes.odd_beams), ground),
        )

    shared = mean.shared._replace(layers=mean.shared.layers._replace(coalbedo=None))
    carry = inputs.weights[0] * first, shared, kept
    (value, shared, _), (reflections, beams, grounds) = jax.lax.scan(step, carry, modes.others())
    summed = shared.layers
    moments = summed.moments.reshape(2, -1, *summed.moments.shape[1:])

    def joined(one, more):
        return jnp.concatenate([one[None], more])

    even_beams, odd_beams = map(joined, (mean.even_beams, mean.odd_beams), beams)
    gradient = ModeSum(
        tau=summed.tau,
        coalbedo=coalbedo,
        sun_secants=summed.sun_secant,
        view_secant=shared.view_secant,
        moments=(moments[0], moments[1]),
        beams=(even_beams, odd_beams),
        ground=mean.ground,
        grounds=grounds,
        weights=joined(first, reflections),
    )
    return value, gradient


class _Mode(NamedTuple):
    """Of a mode above 0."""

    odd: Float[Array, ""]
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
        self.layers = Layers(inputs.tau, None, inputs.sun_secants, both)
        self.layers_of_the_mean = self.layers._replace(coalbedo=inputs.coalbedo)
        self.num_nodes = even.shape[1]
        self.num_streams = 2 * self.num_nodes
        num_modes = inputs.weights.shape[0]
        functions = node_functions(self.num_streams, num_modes)
        self.nodes = tuple(
            jnp.asarray(
                np.stack([functions[m, (m + parity) % 2 :: 2].T for m in range(num_modes)]),
                inputs.tau.dtype,
            )
            for parity in (0, 1)
        )

    def first(self) -> tuple[Array, Kernels, Bordered]:
        """Whether it is odd, kernels and ground of mode 0."""
        x = self.inputs
        kernels = _kernels([n[0] for n in self.nodes], [v[0] for v in x.beams])
        return jnp.zeros((), x.tau.dtype), kernels, x.ground

    def others(self) -> _Mode:
        x = self.inputs
        odd = jnp.arange(1, x.weights.shape[0], dtype=x.tau.dtype) % 2
        later = jax.tree.map(lambda table: table[1:], (self.nodes, x.beams))
        return _Mode(odd, x.weights[1:], x.grounds, *later)

    def seen_by(self, mode: _Mode) -> tuple[Array, Kernels, Bordered]:
        """The same of a mode above 0."""
        ground = mode.ground
        if ground is None:
            ground = black(jnp.ones_like(self.inputs.ground.diagonal), self.num_streams)
        return mode.odd, _kernels(mode.nodes, mode.beams), ground


def _kernels(nodes, beams) -> Kernels:
    a, b = (mode_kernels(n, v) for n, v in zip(nodes, beams, strict=True))
    return a, b
