r"""The derivative of a radiance that is thermal light, too: one gradient for it and sunlight.

A radiance is one number a view: with the sun's weights c_m and reflections r_m of the modes,

.. math:: L = \sum_m c_m r_m + \tfrac12 (e_v - b_v^T s), \qquad s = (1 + Y)^{-1}(2(I - B) 1 + e),

of the mean's Y and e at the top (`method.adding`), but for the Planck function B at the top, which
is added outside. So there is one adjoint field a mode for both lights, and in the mean the source
is that of both together (`emitting_mode`): thermal light costs the gradient a few vectors.

Within an error budget (`skipping`) slopes are those of every layer, whose light a group's would not
tell, in the azimuth modes that count.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.kernels import one_kernel
from ..method.absorption import absorbing_half_layer, of_ground, of_layer
from ..method.adding import Emission, add_emitting_layer, add_layer, top
from ..method.bordered import Bordered, Vector
from ..method.doublings import Doublings
from ..method.ground import isotropic
from ..method.layer import half_layer
from ..method.mode_layers import read
from ..method.rounding import as_deep_as_seen, in_single_precision
from ..skipping import budget
from ..skipping.heat import Warm, lost
from ..skipping.merging import summed
from ..skipping.plan import LayersOfModes, Plan, everything, over_layers, over_modes, planned
from .emitting_mode import (
    Air,
    Heating,
    radiance_at_the_top,
    slope_of_light_from_above,
    slopes_of_mode,
)
from .modes import LATER, WHOLE, How, Mode, along, every_mode
from .room import Keeper


class Lit(NamedTuple):
    r"""All that the radiance towards one view depends on; every array is a variable.

    Parameters
    ----------
    air
        Layers as all modes see them, and by how much light towards the view is attenuated in each.
    beams
        Legendre functions at sun and view (`method.azimuth.LegendreTables`), even and odd l + m.
    ground, grounds
        Admittance of the ground in mode 0, and in modes 1, 2, ... on the first axis of every leaf;
        None is black.
    weights
        Of each mode's reflection in the sum. [radiance unit]
    heating
        Thermal light of the mean.
    absorbed
        As in `mode_sum.ModeSum`.
    """

    air: Air
    beams: tuple[Float[Array, "mode 2 degree *batch"], Float[Array, "mode 2 degree *batch"]]
    ground: Bordered
    grounds: Bordered | None
    weights: Float[Array, "mode *batch"]
    heating: Heating
    absorbed: Float[Array, "*batch"] | None = None


class Given(NamedTuple):
    """What is known of a tile beside its inputs.

    Parameters
    ----------
    doublings
        Of every layer, for what solves them all.
    warm
        What is left out by it; None where nothing is.
    """

    doublings: Doublings
    warm: Warm | None = None


@partial(jax.custom_jvp, nondiff_argnums=(2,))
def radiance(lit: Lit, given: Given, how: How) -> Float[Array, "*batch"]:
    """Sum over the modes of weight times reflection, and what the mean emits.

    Its derivatives come from its gradient. The rule is linear in the tangents, so that one gradient
    serves forward and reverse mode, and slopes that nobody asks for are not computed.
    """
    num_nodes = _num_nodes(lit)
    plan = _plan(lit, given, how)
    added = jnp.zeros_like(lit.heating.above)
    if plan.groups is not None:
        lit, added = _in_groups(lit, given.warm, plan)
    value = partial(_radiance, how=how)
    return added + (one_kernel(value, num_nodes) if num_nodes <= WHOLE else value)(lit, plan)


def _plan(lit: Lit, given: Given, how: How, slopes: bool = False) -> Plan:
    """What is solved; of layers that slopes are wanted of each by itself."""
    warm = given.warm
    if warm is None:
        return everything(_of_modes(lit), given.doublings)
    assert how.error_budget is not None
    error_budget = min(how.error_budget, budget.OF_SLOPES) if slopes else how.error_budget
    secants = lit.air.view_secants[:1]
    limits = warm.known, error_budget, how.most
    return planned(_of_modes(lit), secants, *limits, warm=warm, merges=not slopes)


def _of_modes(lit: Lit) -> LayersOfModes:
    layers = lit.air.layers
    moments = layers.moments.reshape(2, -1, *layers.moments.shape[1:])
    return LayersOfModes(layers.tau, layers.coalbedo, layers.sun_secant, (*moments,))


def _in_groups(lit: Lit, warm: Warm | None, plan: Plan) -> tuple[Lit, Float[Array, "*batch"]]:
    """The groups of layers, and unscattered thermal light that they do not have."""
    assert warm is not None and plan.groups is not None
    alone, layers = lit.air.layers, plan.layers.as_layers()
    jumps = summed(plan.groups, lit.heating.jumps)
    members = alone.tau, alone.coalbedo, lit.heating.jumps
    solved = layers.tau, layers.coalbedo, jumps
    how = lit.air.view_secants[0], 2 * _num_nodes(lit)
    added = lost(warm, plan.groups, members, solved, *how)
    air, heating = lit.air._replace(layers=layers), lit.heating._replace(jumps=jumps)
    return lit._replace(air=air, heating=heating), added


def _radiance(lit: Lit, plan: Plan, how: How) -> Float[Array, "*batch"]:
    every = _every(lit)
    first = jax.tree.map(lambda x: x[0], every)
    light, one = _of_ground(lit), _one(lit)
    stack, light = _stacked(lit, first, lit.ground, light, plan, how)
    assert light is not None
    closed, nothing = top(stack), jnp.zeros_like(lit.heating.above)
    emitted = closed.emerging(light, one, 0.5 * lit.heating.above, nothing)[1]
    mean = first.weight * closed.reflection()[0] + emitted
    largest = _largest(lit)
    lowered = in_single_precision if _rounded(lit, plan, how) else lambda x: x
    later, plan_of_later = lowered(lit), lowered(plan)

    def plus(total, mode, counts):
        own = lowered(mode)
        ground = own.below(later.ground, mean=False)
        stack, _ = _stacked(later, own, ground, None, plan_of_later, how)
        reflection = top(stack).reflection()[0].astype(total.dtype)
        total = total + counts * mode.weight * reflection
        if plan.error_budget is None:
            return total, None, None
        return total, None, plan.share(total[None], counts * largest * jnp.abs(reflection))

    return over_modes(plus, mean, every, 1, None, plan)[0]


def _stacked(
    lit: Lit,
    mode: Mode,
    ground: Bordered,
    light: Emission | None,
    plan: Plan,
    how: How,
) -> tuple[Bordered, Emission | None]:
    """All layers of a mode on the ground; only the mean has thermal light."""
    rounded = _rounded(lit, plan, how)

    def put_on(below, air, jumps, doublings, odd, kernels, one, *number):
        # Of a layer that is the only one XLA would find no use for the number (`one_kernel`).
        place = number[0] if number else jnp.zeros_like(odd)
        layer, (stack, light) = air.layers.layer(place, odd), below
        view_secant = read(air.view_secants, place)
        a, p = layer.matrices(light is not None, kernels, view_secant[None], how.single_scattering)
        own = jax.tree.map(lambda x: read(x, place), doublings)
        tau = as_deep_as_seen(layer.tau) if rounded and light is None else layer.tau
        if light is None:
            return add_layer(stack, *half_layer(a, p, tau, own), tau), None
        jump = read(jumps, place)
        if light.absorbed is None:
            half = half_layer(a, p, tau, own)
            return add_emitting_layer(stack, light, *half, tau, jump, p @ one, None)
        ones = of_layer(layer.coalbedo, layer.secants(view_secant[None]), kernels[0])
        half = absorbing_half_layer(a, p, tau, own, ones, one)
        return add_emitting_layer(stack, light, *half[:2], tau, jump, p @ one, half[2])

    put_on = one_kernel(put_on, _num_nodes(lit), in_parts=True)

    def of_all(below, air, jumps, plan, odd, kernels, one):
        shared = air, jumps, plan.doublings, odd, kernels, one

        def add(below, number):
            return put_on(below, *shared, *([] if number is None else [number]))

        return over_layers(add, below, plan, upwards=True)

    if plan.layers.tau.shape[0] > 1:
        of_all = one_kernel(of_all, _num_nodes(lit), in_parts=True)
    shared = lit.air, lit.heating.jumps, plan, mode.order.odd, mode.kernels(), _one(lit)
    return of_all((ground, light), *shared)


def _of_ground(lit: Lit) -> Emission:
    """What the ground emits, with a place for the sun among the beams."""
    nodes, beams = lit.heating.ground.nodes, lit.heating.ground.beams
    column = Vector(nodes, jnp.concatenate([jnp.zeros_like(beams), beams]))
    return Emission(column, None, of_ground(lit.ground, lit.absorbed))


@partial(radiance.defjvp, symbolic_zeros=True)
def _radiance_jvp(how, primals, tangents):
    lit, given = primals
    value, gradient = radiance_and_gradient(lit, given, how)
    return value, along(gradient, tangents[0], value)


@partial(jax.custom_jvp, nondiff_argnums=(2,))
def radiance_and_gradient(lit: Lit, given: Given, how: How) -> tuple[Float[Array, "*batch"], Lit]:
    """`radiance` and its slope in every input.

    Each column's slope is that of its own value. Slopes in the ground's cores are symmetric.
    `Doublings.most` must be given: there is room for so many.
    """
    plan = _plan(lit, given, how, slopes=True)
    if not how.rounds(plan):
        return _radiance_and_gradient(lit, plan, how)
    found = _radiance_and_gradient(*in_single_precision((lit, plan)), how)
    return jax.tree.map(lambda x: x.astype(lit.weights.dtype), found)


def _radiance_and_gradient(lit: Lit, plan: Plan, how: How) -> tuple[Float[Array, "*batch"], Lit]:
    doublings, largest = plan.doublings, _largest(lit)
    if doublings.most is None:
        raise TypeError("slopes need a largest number of doublings.")

    def one(carry, mode, counts):
        value, slopes, of_mean, room = carry
        # Thermal light is the same in all azimuths: there is none in any mode but the mean.
        mean, ground = mode.order.mean, mode.below(lit.ground)
        jumps, column, above = jax.tree.map(lambda x: mean * x, lit.heating)
        answers, fields, room, found = slopes_of_mode(
            lit.air,
            jumps,
            doublings,
            how.single_scattering,
            mode.order,
            mode.kernels(),
            (ground, of_ground(ground, lit.absorbed)),
            column,
            radiance_at_the_top(above, counts * mode.weight),
            slopes,
            room,
        )
        reflection, emitted = answers
        assert found.jumps is not None
        heating = Heating(found.jumps, found.column, slope_of_light_from_above(fields))
        new = found.ground if lit.grounds is None else None, heating
        of_mean = jax.tree.map(lambda x, new: x + mean * new, of_mean, new)
        own = None if lit.grounds is None else found.ground
        value = value + counts * mode.weight * reflection + emitted
        carry, row = (value, found.air, of_mean, room), (counts * reflection, found.beams, own)
        if plan.error_budget is None:
            return carry, row, None
        of_slopes = plan.share_of_slopes(found.square, found.air.layers.tau)
        of_value = plan.share(value[None], counts * largest * jnp.abs(reflection))
        share = jnp.maximum(of_slopes, of_value)
        # The mean is never the last by chance.
        return carry, row, jnp.where(mean > 0, jnp.full_like(share, jnp.inf), share)

    mean = lit.ground if lit.grounds is None else None, lit.heating
    nothing = jax.tree.map(jnp.zeros_like, (lit.heating.above, lit.air, mean))
    space = Keeper(lit.air.layers.tau, _num_nodes(lit), doublings.most, warm=True).empty()
    every = _every(lit)
    rows = lit.weights, lit.beams, every.ground
    carry, rows = over_modes(one, (*nothing, space), every, 0, rows, plan)
    (value, air, (ground, heating), _), (reflections, beams, grounds) = carry, rows
    if grounds is not None:
        ground, grounds = (jax.tree.map(lambda x, i=i: x[i], grounds) for i in (0, LATER))
    absorbed = jax.tree.map(jnp.zeros_like, lit.absorbed)
    return value, Lit(air, beams, ground, grounds, reflections, heating, absorbed)


@radiance_and_gradient.defjvp
def _second_derivative(how, primals, tangents):
    """JAX's own, of the program that solves everything with its doublings written out."""
    lit, given = primals
    doublings = given.doublings.written_out()

    def written_out(lit):
        return _radiance_and_gradient(lit, everything(_of_modes(lit), doublings), how)

    return jax.jvp(written_out, (lit,), tangents[:1])


def _largest(lit: Lit) -> Float[Array, "*batch"]:
    """Weight of any mode but the mean, whatever the azimuth: where the cosine of one is small that
    of the next is not."""
    return 2 * jnp.abs(lit.weights[0])


def _every(lit: Lit) -> Mode:
    return every_mode(lit.ground, lit.grounds, lit.weights, lit.beams, _num_nodes(lit))


def _rounded(lit: Lit, plan: Plan, how: How) -> bool:
    """Whether values have all modes but the mean in single precision."""
    return how.rounds(plan) and _num_nodes(lit) > WHOLE


def _num_nodes(lit: Lit) -> int:
    return lit.air.layers.moments.shape[1]


def _one(lit: Lit) -> Vector:
    """Isotropic light of radiance 1."""
    return isotropic(2 * _num_nodes(lit), jnp.ones_like(lit.ground.diagonal))
