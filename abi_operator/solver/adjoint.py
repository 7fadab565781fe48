r"""The derivative of the sum over azimuth modes: one pass up the layers, one down.

At the top :math:`F_i = (1+Y)^{-1} e_i` for sun and view, and the reflection's derivative is
-pair(F)/2 in Y. Going down through a layer of half thickness h, with the quotient of its adding
step (`adding`) :math:`N = S^{-1}(Y + Y_e)F`,

.. math:: \sigma = F - hN/2, \qquad F' = F - hN,

the cotangent of Y_e is P = 2 pair(sigma), that of Z is hQ with Q = pair(N)/2, and F' are the fields
below. A doubling with quotient R is undone by

.. math::
   Q \leftarrow 2Q + 2(R\otimes R)P, \qquad P \leftarrow 2P - 2h(R\oplus R)P + h^2Q,

or, as long as pairs of fields are fewer than nodes, by splitting a pair into two,
:math:`\sigma \leftarrow \sigma - hR\sigma \pm hN/2`, :math:`N \leftarrow N \pm 2R\sigma`. At the
start (`layer.half_layer`), with :math:`U = Z^{-1}A`, :math:`W = Z^{-1}C`,
:math:`V = (5B^{-1} + dh^2A)^{-1}A` and :math:`M = (U\otimes W + W\otimes U)P/2`,

.. math::
   \bar Z &= Q - (U\oplus U)P/2 + h^2M, \\
   \bar A &= P - h^2(W\oplus W)P/2
       + h^2[1/3 - \tfrac{h^2}{9}(V\oplus V) + \tfrac{dh^4}{9}V\otimes V]\bar Z, \\
   \bar B &= -(B^{-1}\otimes B^{-1})[Q + h^2M + \tfrac{5h^4}{9}(V\otimes V)\bar Z],

all over h. A layer depends on hA and hB alone, so that its derivative in h is
:math:`\langle\bar A, A\rangle + \langle\bar B, B\rangle`.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from .._kernels import one_kernel
from .._numerics import fenced, matmul
from .adding import add_layer, top
from .azimuth import mode_kernels
from .bordered import Bordered
from .fields import Fields, pair
from .ground import black
from .layer import ModeKernels, half_layer, node_functions
from .layer_adjoint import Layer, climb, descend
from .pull_back import MatrixSlopes, undo_matrix

Kernels = tuple[ModeKernels, ModeKernels]

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


class _Slopes(NamedTuple):
    """Of one mode, in what its layers and beams are made of and in its ground."""

    layers: Layer
    even_beams: Float[Array, "2 degree *batch"]
    odd_beams: Float[Array, "2 degree *batch"]
    view_secant: Float[Array, "*batch"]
    ground: Bordered


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

    def put_on(stack, layer, kernels, view_secant):
        a, p = layer.matrices(kernels, view_secant, single_scattering)
        return add_layer(stack, *half_layer(a, p, layer.tau, num_doublings), layer.tau)

    put_on = one_kernel(put_on, modes.num_nodes, in_parts=True)

    def reflection(layers, kernels, ground):
        def add(stack, layer):
            return put_on(stack, layer, kernels, inputs.view_secant), None

        stack, _ = jax.lax.scan(add, ground, layers, reverse=True)
        return top(stack).reflection()[0]

    def step(total, mode):
        return total + mode.weight * reflection(*modes.seen_by(mode)), None

    first = modes.first()
    value = inputs.weights[0] * reflection(modes.layers_of_the_mean(), *first)
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
    solve = partial(_mode, inputs.view_secant, num_doublings, single_scattering)
    first, kept, mean = solve(modes.layers_of_the_mean(), *modes.first(), inputs.weights[0], None)
    value = inputs.weights[0] * first

    def step(carry, mode):
        value, common, kept = carry
        reflection, kept, slopes = solve(*modes.seen_by(mode), mode.weight, kept)
        common = jax.tree.map(jnp.add, common, modes.common(slopes, mode.odd))
        ground = None if mode.ground is None else slopes.ground
        return (
            (value + mode.weight * reflection, common, kept),
            (reflection, (slopes.even_beams, slopes.odd_beams), ground),
        )

    carry = value, modes.common(mean, jnp.asarray(False)), kept
    (value, common, _), (reflections, beams, grounds) = jax.lax.scan(step, carry, modes.others())
    tau, sun_secants, moments, view_secant = common

    coalbedo = mean.layers.coalbedo
    assert coalbedo is not None  # mode 0 depends on it

    def joined(one, more):
        return jnp.concatenate([one[None], more])

    even_beams, odd_beams = map(joined, (mean.even_beams, mean.odd_beams), beams)
    gradient = ModeSum(
        tau=tau,
        coalbedo=coalbedo,
        sun_secants=sun_secants,
        view_secant=view_secant,
        moments=(moments[0], moments[1]),
        beams=(even_beams, odd_beams),
        ground=mean.ground,
        grounds=grounds,
        weights=joined(first, reflections),
    )
    return value, gradient


class _Mode(NamedTuple):
    """Of a mode above 0."""

    odd: Array
    weight: Float[Array, "*batch"]
    ground: Bordered | None
    nodes: tuple[Array, Array]
    beams: tuple[Array, Array]


class _Modes:
    """The inputs as the modes see them."""

    def __init__(self, inputs: ModeSum):
        even, odd = inputs.moments
        self.inputs, self.moments = inputs, jnp.stack([even, odd])
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

    def layers_of_the_mean(self) -> Layer:
        x = self.inputs
        return Layer(x.tau, x.coalbedo, x.sun_secants, *x.moments)

    def first(self) -> tuple[Kernels, Bordered]:
        kernels = _kernels([n[0] for n in self.nodes], [v[0] for v in self.inputs.beams])
        return kernels, self.inputs.ground

    def others(self) -> _Mode:
        x = self.inputs
        odd = jnp.arange(1, x.weights.shape[0]) % 2 == 1
        later = jax.tree.map(lambda table: table[1:], (self.nodes, x.beams))
        return _Mode(odd, x.weights[1:], x.grounds, *later)

    def seen_by(self, mode: _Mode) -> tuple[Layer, Kernels, Bordered]:
        """Layers, kernels and ground of a mode above 0."""
        x, moments = self.inputs, _ordered(self.moments, mode.odd)
        ground = mode.ground
        if ground is None:
            ground = black(jnp.ones_like(x.ground.diagonal), self.num_streams)
        layers = Layer(x.tau, None, x.sun_secants, moments[0], moments[1])
        return layers, _kernels(mode.nodes, mode.beams), ground

    def common(self, slopes: _Slopes, odd: Array) -> tuple[Array, Array, Array, Array]:
        """Slopes in what all modes share; moments of even degree first."""
        layers = slopes.layers
        moments = _ordered(jnp.stack([layers.even, layers.odd]), odd)
        return layers.tau, layers.sun_secant, moments, slopes.view_secant


def _ordered(moments, odd):
    return jnp.where(odd, moments[::-1], moments)


def _kernels(nodes, beams) -> Kernels:
    a, b = (mode_kernels(n, v) for n, v in zip(nodes, beams, strict=True))
    return a, b


def _mode(
    view_secant: Float[Array, "*batch"],
    num_doublings: int,
    single_scattering: bool,
    layers: Layer,
    kernels: Kernels,
    ground: Bordered,
    weight: Float[Array, "*batch"],
    kept: Any,
) -> tuple[Float[Array, "*batch"], Any, _Slopes]:
    """Reflection of a mode, and the slopes of `weight` times it.

    `kept` is room for what is kept of all layers, given back filled: modes that share it do not
    clear it, nor copy it, one after the other. Layers are read and written inside the kernels: as
    inputs and outputs of a scan every array would be one more kernel a layer. Matrices lie in it
    as one row each: LLVM unrolls a copy of 64 numbers whole, number by number, before it could
    make vectors of it.
    """
    num_layers, num_nodes = layers.even.shape[:2]
    numbers = jnp.arange(num_layers, dtype=layers.tau.dtype)

    def compiled(function: Callable[..., Any], **how: bool) -> Callable[..., Any]:
        # A layer that is the only one fills the room: in the kernel XLA finds no use for its
        # number, nor for what was in the room (see `one_kernel`).
        return function if numbers.size == 1 else one_kernel(function, num_nodes, **how)

    def put_on(stack, layer, kernels, view_secant):
        a, p = layer.matrices(kernels, view_secant, single_scattering)
        return climb(stack, a, p, layer.tau, num_doublings)

    def put_on_and_keep(stack, kept, layers, number, kernels, view_secant):
        stack, new = put_on(stack, _one_of(layers, number), kernels, view_secant)
        return stack, _with_one(kept, number, jax.tree.map(jnp.ravel, new))

    put_one = compiled(put_on_and_keep, in_parts=True)

    def up(carry, number):
        return put_one(*carry, layers, number, kernels, view_secant), None

    first = _one_of(layers, 0)
    shapes = jax.eval_shape(lambda: put_on(ground, first, kernels, view_secant)[1])
    if kept is None:
        kept = jax.tree.map(lambda x: jnp.zeros((numbers.size, x.size), x.dtype), shapes)
    (stack, kept), _ = jax.lax.scan(up, (ground, kept), numbers, reverse=True)
    reflection, fields = _fields_at_the_top(stack, weight)

    def undo(fields, totals, layer, kept, kernels, view_secant):
        # The beams' own entries of the stack are 1 whatever happens in it.
        fields = fields._replace(other=jnp.zeros_like(fields.other))
        secants = layer.secants(view_secant)
        fields, a_bar, b_bar = descend(fields, layer.tau, secants, kept, num_doublings)
        a, coalbedo = undo_matrix(
            kernels[0], layer.even, secants, a_bar, single_scattering, layer.coalbedo
        )
        b, _ = undo_matrix(kernels[1], layer.odd, secants, b_bar, single_scattering)
        step = 0.5 / 2**num_doublings
        return fields, *_collected(step, layer.tau, totals, a, b, coalbedo)

    @compiled
    def undo_one(carry, layers, kept, number, kernels, view_secant):
        fields, totals, slopes = carry
        layer, own = _one_of((layers, kept), number)
        own = jax.tree.map(lambda x, like: x.reshape(like.shape), own, shapes)
        fields, totals, new = undo(fields, totals, layer, own, kernels, view_secant)
        return fields, totals, _with_one(slopes, number, new)

    def down(carry, number):
        return undo_one(carry, layers, kept, number, kernels, view_secant), None

    start = tuple(jnp.zeros_like(x) for x in (kernels[0].beams, kernels[1].beams, view_secant))
    slopes = jax.tree.map(jnp.zeros_like, layers)
    carry, _ = jax.lax.scan(down, (fields, start, slopes), numbers)
    fields, (even, odd, view), slopes = carry
    return reflection, kept, _Slopes(slopes, even, odd, view, pair(1.0, fields))


def _one_of(stacks: Any, number: Any) -> Any:
    """What arrays with one entry a layer hold of a layer.

    `number` is not of integers, which have no tangents to go through `one_kernel` with.
    """
    read = partial(jax.lax.dynamic_index_in_dim, index=_integer(number), axis=0, keepdims=False)
    return jax.tree.map(read, stacks)


def _with_one(stacks: Any, number: Any, new: Any) -> Any:
    """The same arrays with `new` in place of that."""
    write = partial(jax.lax.dynamic_update_index_in_dim, index=_integer(number), axis=0)
    return jax.tree.map(write, stacks, new)


def _integer(number):
    return jnp.asarray(number).astype(jnp.int32)


def _fields_at_the_top(stack: Bordered, weight):
    """Reflection, and fields whose pair is the cotangent of `weight` times it."""
    solved = matmul(top(stack).inverse, stack.border)
    reflection = 0.5 * (jnp.sum(stack.border[:, 1] * solved[:, 0], axis=0) - stack.corner[0])
    scale = jnp.stack([jnp.ones_like(weight), -0.5 * weight])
    own = scale[:, None]
    return reflection, Fields(-(scale * solved)[:, :, None], own, jnp.zeros_like(own))


@fenced
def _collected(step, tau, totals, a: MatrixSlopes, b: MatrixSlopes, coalbedo):
    """Totals over the layers, and the layer's own slopes, from those over h."""
    h = tau * step
    secants = h * (a.secants + b.secants)
    beams = totals[0] + h * a.beams, totals[1] + h * b.beams
    own = None if coalbedo is None else h * coalbedo
    slopes = Layer(step * (a.h + b.h), own, secants[0], h * a.moments, h * b.moments)
    return (*beams, totals[2] + secants[1]), slopes
