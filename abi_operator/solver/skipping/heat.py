r"""Thermal light of layers that are solved in groups.

A group emits as one layer whose Planck function is linear in optical depth from its upper to its
lower face; its members' need not be. What nothing scatters of their light is known exactly,

.. math::
   L\uparrow = \sum_k e^{-sT_k}(1-\omega_k)\left[B_k(1-e^{-x}) +
   D_k\left(\frac{1-e^{-x}}{x} - e^{-x}\right)\right], \qquad x = s\tau_k,

with the Planck function B at the layer's upper face and its increase D across the layer, seen
through the optical depth T above, and likewise downwards: so the difference that grouping makes to
it is added to what the groups give, and with it the ground's reflection of that downwards, in
directions of the solver's own nodes. What is left is scattered thermal light (`grouping`).
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.algebra import total
from ...machine.kernels import one_kernel
from ..method.mode_layers import read
from ..method.quadrature import half_range
from .budget import Expected
from .grouping import Groups

# Below which both of `emissivities` are right to rounding by so many terms of a series, in double
# precision and in single.
_THIN, _TERMS, _TERMS_OF_FLOAT32 = 0.25, 12, 7


class Warm(NamedTuple):
    """What is known of a tile that emits, beside its layers; without derivatives.

    Parameters
    ----------
    known
        Of its radiance.
    light
        What comes upon the layers from outside: the radiance of a reflectance of 1, and by how much
        what falls on the top and what the ground shines are more, or less, than they would be at
        the temperature of the air there, of which layers that are as warm give back what they take.
    planck
        Planck function at the levels.
    returned
        Share of isotropic light on the ground that it sends to the view, unscattered. [-]
    """

    known: Expected
    light: Float[Array, "*batch"]
    planck: Float[Array, "level *batch"]
    returned: Float[Array, "*batch"]


class Unscattered(NamedTuple):
    """Thermal light of the air that nothing scatters: towards the view at the top, and the mean of
    all directions at the ground. [radiance unit]"""

    up: Float[Array, "*batch"]
    down: Float[Array, "*batch"]


def unscattered(
    tau: Float[Array, "layer *batch"],
    coalbedo: Float[Array, "layer *batch"],
    planck: Float[Array, "layer *batch"],
    jumps: Float[Array, "layer *batch"],
    secant: Float[Array, "*batch"],
    num_streams: int,
    number: Float[Array, ""] | None = None,
) -> Unscattered:
    """As above, of all layers or of as many as there are groups.

    Parameters
    ----------
    tau, coalbedo
        Optical depth and 1 - ssa. [-]
    planck, jumps
        Planck function at the upper face, and its increase to the lower. [radiance unit]
    secant
        Of the view. [-]
    num_streams
        Half of them are the directions downwards.
    number
        Of layers, from the top; None for all.
    """
    layers = tau, coalbedo, planck, jumps
    mu, weight = half_range(num_streams)
    nodes = mu.reshape(-1, *(1,) * secant.ndim), 2 * mu * weight

    def of_these(layers: Any, secant: Array, *number: Array) -> Unscattered:
        return _unscattered(layers, secant, nodes, *number)

    numbers = [] if number is None else [number]
    return one_kernel(of_these, 1)(layers, secant, *numbers)


def _unscattered(layers, secant, nodes, number=None):
    mu, weights = nodes
    downwards = jnp.asarray(1 / mu, secant.dtype)

    def one(k, state):
        up, down, seen = state
        tau, coalbedo, planck, jump = (read(x, k) for x in layers)
        through, mean, rest = emissivities(secant * tau)
        up = up + seen * coalbedo * (planck * mean + jump * rest)
        seen = seen * through
        through, mean, rest = emissivities(downwards * tau)
        down = through * down + coalbedo * ((planck + jump) * mean - jump * rest)
        return up, down, seen

    nothing = jnp.zeros_like(secant)
    count = layers[0].shape[0] if number is None else number.astype(jnp.int32)
    many = jnp.zeros((len(weights), *secant.shape), secant.dtype)
    up, down, _ = jax.lax.fori_loop(0, count, one, (nothing, many, jnp.ones_like(secant)))
    return Unscattered(up, total([w * x for w, x in zip(weights.tolist(), down, strict=True)]))


def emissivities(x: Array) -> tuple[Array, Array, Array]:
    """Transmission, 1 less that, and how much of the increase leaves through the upper face."""
    through, thin = jnp.exp(-x), x < _THIN
    # By their series where a difference would lose digits, with what is no power of a large number.
    small = jnp.where(thin, x, 0)
    series = jnp.ones_like(x)
    for k in range(_TERMS if x.dtype == jnp.float64 else _TERMS_OF_FLOAT32, 2, -1):
        series = 1 - small * (1 / k) * series
    mean = jnp.where(thin, small * (1 - 0.5 * small * series), 1 - through)
    ratio = (1 - through) / jnp.where(thin, 1, x)
    return through, mean, jnp.where(thin, small * (1 - 0.5 * (1 + small) * series), ratio - through)


def lost(
    warm: Warm,
    groups: Groups,
    members: tuple[Array, Array, Array],
    solved: tuple[Array, Array, Array],
    secant: Float[Array, "*batch"],
    num_streams: int,
) -> Float[Array, "*batch"]:
    """Unscattered light of the members less that of their groups, towards the view.

    Parameters
    ----------
    warm
        What the columns emit, and how much of what goes down comes back up.
    groups
        Which layers are merged.
    members, solved
        Optical depth, 1 - ssa and increase of the Planck function of layers, and of groups.
    secant, num_streams
        As of `unscattered`.
    """
    tau, coalbedo, jumps = members
    apart = unscattered(tau, coalbedo, warm.planck[:-1], jumps, secant, num_streams)
    tau, coalbedo, jumps = solved
    above = warm.planck[:1]
    planck = jnp.concatenate([above, above + jnp.cumsum(jumps, axis=0)[:-1]])
    together = unscattered(tau, coalbedo, planck, jumps, secant, num_streams, groups.number)
    return apart.up - together.up + warm.returned * (apart.down - together.down)
