r"""The sum over azimuth modes, and its derivative: one gradient for all of them.

The pass up and down the layers of one mode is `mode`. How many modes, groups of layers and
doublings are solved is data (`skipping.plan`), for the value and for the gradient alike.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from ...machine.kernels import one_kernel
from ..method.absorption import absorbing_half_layer, of_ground, of_layer
from ..method.adding import add_absorbing_layer, add_layer, top
from ..method.around import Above
from ..method.bordered import Bordered
from ..method.doublings import Doublings
from ..method.layer import half_layer
from ..method.mode_layers import read
from ..method.rounding import as_deep_as_seen, in_single_precision
from ..skipping import budget
from ..skipping.budget import Expected
from ..skipping.grouping import Groups
from ..skipping.plan import LayersOfModes, Plan, everything, over_layers, over_modes, planned
from .mode import Shared, mode_slopes
from .modes import LATER, WHOLE, How, Mode, along, every_mode
from .room import Keeper


class ModeSum(NamedTuple):
    r"""All that the modes depend on; every array is a variable.

    Parameters
    ----------
    layers
        What all modes see of the layers.
    view_secants
        By which light towards the views is attenuated. [-]
    beams
        Legendre functions at sun and views (`method.azimuth.LegendreTables`), even and odd l + m.
    ground, grounds
        Admittance of the ground in mode 0, and in modes 1, 2, ... on the first axis of every leaf;
        None is black.
    weights
        Of each mode's reflection towards each view in its sum.
    above
        What lies above the layers, modes on the first axis of every leaf; None is free space. It is
        no variable: nobody takes slopes in it (`surroundings`).
    absorbed
        What a Lambertian ground absorbs of isotropic light (`method.ground`); None of others. It is
        no variable beside the ground's admittance.
    """

    layers: LayersOfModes
    view_secants: Float[Array, "view *batch"]
    beams: tuple[Float[Array, "mode beam degree *batch"], Float[Array, "mode beam degree *batch"]]
    ground: Bordered
    grounds: Bordered | None
    weights: Float[Array, "mode view *batch"]
    above: Above | None = None
    absorbed: Float[Array, "*batch"] | None = None

    @property
    def num_nodes(self) -> int:
        """Half of the streams."""
        return self.layers.moments[0].shape[1]

    def every_mode(self) -> Mode:
        """What differs from mode to mode, on the first axis."""
        modes = self.ground, self.grounds, self.weights, self.beams
        return every_mode(*modes, self.num_nodes, self.above)

    def seen_from(self, view: Any) -> "ModeSum":
        """The same with one view."""

        def one(x: Array, axis: int) -> Array:
            return jax.lax.dynamic_slice_in_dim(x, view, 1, axis)

        def beams(x: Array, axis: int) -> Array:
            sun = jax.lax.slice_in_dim(x, 0, 1, axis=axis)
            return jnp.concatenate([sun, jax.lax.dynamic_slice_in_dim(x, view + 1, 1, axis)], axis)

        def ground(y: Bordered, axis: int) -> Bordered:
            border, diagonal = beams(y.border, axis + 1), beams(y.diagonal, axis)
            return Bordered(y.core, border, diagonal, one(y.corner, axis))

        grounds = None if self.grounds is None else ground(self.grounds, 1)
        above = self.above
        if above is not None:
            lit = beams(above.nodes, 2), beams(above.own, 1), one(above.reflected, 1)
            above = Above(above.core, *lit)
        even, odd = (beams(x, 1) for x in self.beams)
        return ModeSum(
            self.layers,
            one(self.view_secants, 0),
            (even, odd),
            ground(self.ground, 0),
            grounds,
            one(self.weights, 1),
            above,
            self.absorbed,
        )


Given = Doublings | Expected
"""What is known of a tile beside its inputs: the doublings of every layer where everything is
solved, else what to expect of its reflectance."""


@partial(jax.custom_jvp, nondiff_argnums=(2,))
def mode_sum(inputs: ModeSum, given: Given, how: How) -> Float[Array, "view *batch"]:
    """Sum over the modes of weight times reflection, whose derivatives come from its gradient.

    Columns do not see each other. The rule is linear in the tangents, so that one gradient serves
    forward and reverse mode, and slopes that nobody asks for are not computed.
    """
    num_nodes, num_beams = inputs.num_nodes, 1 + len(inputs.view_secants)
    value = partial(_reflectance, how=how)
    if num_nodes <= WHOLE:
        value = one_kernel(value, num_nodes, num_beams=num_beams)
    return value(inputs, _plan(inputs, given, how))


def _plan(inputs: ModeSum, given: Given, how: How, slopes: bool = False) -> Plan:
    """What is solved; slopes ask for more of it than a value does."""
    if how.error_budget is None:
        assert isinstance(given, Doublings)
        return everything(inputs.layers, given)
    assert isinstance(given, Expected)
    error_budget = min(how.error_budget, budget.OF_SLOPES) if slopes else how.error_budget
    thickest = budget.THICKEST if slopes else float("inf")
    return planned(inputs.layers, inputs.view_secants, given, error_budget, how.most, thickest)


def _reflectance(inputs: ModeSum, plan: Plan, how: How) -> Float[Array, "view *batch"]:
    num_nodes, num_beams = inputs.num_nodes, 1 + len(inputs.view_secants)
    rounded = how.rounds(plan) and num_nodes > WHOLE
    lowered = in_single_precision if rounded else lambda x: x

    def reflection(mean: bool, mode: Mode, inputs: ModeSum, plan: Plan) -> Array:
        def put_on(below, layers, doublings, odd, kernels, view_secants, *number):
            # Of a layer that is the only one XLA would find no use for the number (`one_kernel`).
            place, (stack, ones) = number[0] if number else jnp.zeros_like(odd), below
            layer = layers.layer(place, odd)
            a, p = layer.matrices(mean, kernels, view_secants, how.single_scattering)
            own = jax.tree.map(lambda x: read(x, place), doublings)
            tau = as_deep_as_seen(layer.tau) if rounded and not mean else layer.tau
            if ones is None:
                return add_layer(stack, *half_layer(a, p, tau, own), tau), None
            new = of_layer(layer.coalbedo, layer.secants(view_secants), kernels[0])
            y, z, new = absorbing_half_layer(a, p, tau, own, new)
            return add_absorbing_layer(stack, ones, y, z, tau, new)

        put_on = one_kernel(put_on, num_nodes, in_parts=True, num_beams=num_beams)

        def of_all(below, layers, plan, odd, kernels, view_secants, *above):
            shared = layers, plan.doublings, odd, kernels, view_secants

            def add(below, number):
                return put_on(below, *shared, *([] if number is None else [number]))

            stack, _ = over_layers(add, below, plan, upwards=True)
            return above[0].over(stack)[0] if above else top(stack).reflection()

        # Of one layer that is the only one XLA would find no use for what tells layers apart, and
        # what leaves towards several views is a sum that it would share among threads.
        if plan.layers.tau.shape[0] > 1 and inputs.view_secants.shape[0] == 1:
            of_all = one_kernel(of_all, num_nodes, in_parts=True)
        layers = plan.layers.as_layers()
        shared = layers, plan, mode.order.odd, mode.kernels(), inputs.view_secants
        above = () if mode.above is None else (mode.above,)
        ground = mode.below(inputs.ground, mean)
        below = ground, of_ground(ground, inputs.absorbed) if mean else None
        return of_all(below, *shared, *above)

    def another(total, mode, counts):
        found = reflection(False, lowered(mode), later, plan_of_later).astype(total.dtype)
        total = total + counts * mode.weight * found
        if plan.error_budget is None:
            return total, None, None
        return total, None, plan.share(0.5 * total, jnp.max(jnp.abs(found), axis=0))

    # Without slopes a kernel for the mean alone is soon compiled, and a tenth faster than to ask in
    # each layer which mode it is.
    every = inputs.every_mode()
    later, plan_of_later = lowered(inputs), lowered(plan)
    first = jax.tree.map(lambda x: x[0], every)
    # Layers that stay go without what they absorb, which single precision needs in the mean.
    stay = inputs.above is not None
    of_mean = (first, inputs, plan) if stay else (lowered(first), later, plan_of_later)
    total = first.weight * reflection(True, *of_mean).astype(first.weight.dtype)
    return over_modes(another, total, every, 1, None, plan)[0]


@partial(mode_sum.defjvp, symbolic_zeros=True)
def _mode_sum_jvp(how, primals, tangents):
    inputs, given = primals
    num_views = inputs.view_secants.shape[0]

    def of_one(inputs, tangents):
        value, gradient = reflectance_and_gradient(inputs, given, how)
        return value, along(gradient, tangents, value)

    if num_views == 1:
        value, change = of_one(inputs, tangents[0])
        return value[None], change[None]
    changes = jax.tree.map(
        lambda t, x: jnp.zeros_like(x) if isinstance(t, SymbolicZero) else t, tangents[0], inputs
    )
    return jax.lax.map(
        lambda view: of_one(inputs.seen_from(view), changes.seen_from(view)), jnp.arange(num_views)
    )


@partial(jax.custom_jvp, nondiff_argnums=(2,))
def reflectance_and_gradient(
    inputs: ModeSum, given: Given, how: How
) -> tuple[Float[Array, "*batch"], ModeSum]:
    """Sum over the modes of weight times reflection towards the one view, and its slopes.

    Each column's slope is that of its own value. Slopes in the ground's cores are symmetric.
    `Doublings.most` must be given: there is room for so many.
    """
    plan = _plan(inputs, given, how, slopes=True)
    if inputs.above is not None or not how.rounds(plan):
        return _reflectance_and_gradient(inputs, plan, how)
    found = _reflectance_and_gradient(*in_single_precision((inputs, plan)), how)
    return jax.tree.map(lambda x: x.astype(inputs.weights.dtype), found)


def _reflectance_and_gradient(inputs, plan, how):
    doublings = plan.doublings
    if doublings.most is None:
        raise TypeError("slopes need a largest number of doublings.")
    layers, num_nodes = plan.layers.as_layers(), inputs.num_nodes
    faces = None
    if plan.groups is not None:
        num_layers, *batch = layers.tau.shape
        faces = jnp.zeros((num_layers + 1, 3 + 2 * num_nodes, *batch), layers.tau.dtype)
    shared = Shared(layers, inputs.view_secants[0], faces)

    def one(carry, mode, counts):
        value, slopes, of_mean, room = carry
        kernels, ground = mode.kernels(), mode.below(inputs.ground)
        weight = counts * mode.weight[0]
        below = ground, of_ground(ground, inputs.absorbed)
        given = shared, plan, how.single_scattering, mode.order, kernels, below, weight
        reflection, room, found = mode_slopes(*given, slopes, room, mode.above)
        if inputs.grounds is None:
            mean = mode.order.mean
            of_mean = jax.tree.map(lambda x, new: x + mean * new, of_mean, found.ground)
        own = None if inputs.grounds is None else found.ground
        value = value + weight * reflection
        row = counts * reflection[None], (found.even_beams, found.odd_beams), own
        carry = value, found.shared, of_mean, room
        if plan.error_budget is None:
            return carry, row, None
        of_tau = of_own_groups(plan.groups, found.shared.layers.tau)
        of_slopes = plan.share_of_slopes(found.square, of_tau)
        share = jnp.maximum(of_slopes, plan.share(0.5 * value[None], jnp.abs(reflection)))
        # The mean is never the last by chance.
        return carry, row, jnp.where(mode.order.mean > 0, jnp.full_like(share, jnp.inf), share)

    nothing = jax.tree.map(jnp.zeros_like, (shared.view_secant, shared, inputs.ground))
    keep = layers.tau, num_nodes, doublings.most, faces is not None
    space = Keeper(*keep).empty()
    every = inputs.every_mode()
    rows = inputs.weights, inputs.beams, every.ground
    carry, rows = over_modes(one, (*nothing, space), every, 0, rows, plan)
    (value, slopes, of_mean, _), (reflections, beams, of_grounds) = carry, rows
    if of_grounds is not None:
        of_mean, of_grounds = (jax.tree.map(lambda x, i=i: x[i], of_grounds) for i in (0, LATER))
    summed = slopes.layers
    even, odd = summed.moments.reshape(2, -1, *summed.moments.shape[1:])
    found = LayersOfModes(summed.tau, summed.coalbedo, summed.sun_secant, (even, odd))
    gradient = ModeSum(
        layers=plan.slopes(found, slopes.faces),
        view_secants=slopes.view_secant[None],
        beams=beams,
        ground=of_mean,
        grounds=of_grounds,
        weights=reflections,
        above=jax.tree.map(jnp.zeros_like, inputs.above),
        absorbed=jax.tree.map(jnp.zeros_like, inputs.absorbed),
    )
    return value, gradient


def of_own_groups(
    groups: Groups | None, tau_slopes: Float[Array, "layer *batch"]
) -> Float[Array, "layer *batch"]:
    """Slopes in depths, but those of groups that a column does not have: a tile has as many as its
    column with most, and a group has such a slope although it is empty."""
    if groups is None:
        return tau_slopes
    numbers = jnp.arange(len(tau_slopes), dtype=tau_slopes.dtype)[:, None]
    return jnp.where(numbers <= groups.labels[-1], tau_slopes, 0)


@reflectance_and_gradient.defjvp
def _second_derivative(how, primals, tangents):
    """JAX's own, of the program that solves everything with its doublings written out."""
    inputs, given = primals
    most = how.most if how.error_budget is not None else given.most
    doublings = Doublings(None, most).written_out()

    def written_out(inputs):
        return _reflectance_and_gradient(inputs, everything(inputs.layers, doublings), how)

    return jax.jvp(written_out, (inputs,), tangents[:1])
