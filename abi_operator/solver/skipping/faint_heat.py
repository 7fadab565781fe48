r"""Thermal light of columns whose layers scatter hardly anything (`faint`).

Air that scatters backwards a share of the light gives back that of others, of much the same
temperature: it has the light of air that emits as much as beams lose in it. The ground is seen
through it as in `faint`. What this may miss is what is turned round, wherever it is, and where
nobody knows how bright that is: at every level no brighter than the light from below that nothing
has scattered and the layer itself, as much of it as the view sees from the top,

.. math::
   s\sum_k e^{-sT_k}\,\omega_k(1-g_k)\tau_k\,(L\uparrow_k + B_k + |D_k|),

with the optical depth T above, the Planck function B at a layer's upper face and its increase D;
and what is turned back to the ground, which reflects it. Air through which nobody sees the ground
hides that it is hot.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.algebra import total
from ...machine.kernels import one_kernel
from ..method.mode_layers import read
from ..method.quadrature import double_gauss
from .budget import Faint
from .depths import DIFFUSE, Depths
from .heat import emissivities


class Passing(NamedTuple):
    """Light of air that nothing scatters: towards the view at the top, the mean of all directions
    at the ground; and how much of what passes is turned round and seen. [radiance unit]"""

    up: Float[Array, "*batch"]
    down: Float[Array, "*batch"]
    turned: Float[Array, "*batch"]


def passing(
    tau: Float[Array, "layer *batch"],
    backward: Float[Array, "layer *batch"],
    planck: Float[Array, "level *batch"],
    from_ground: Float[Array, "*batch"],
    secant: Float[Array, "*batch"],
    num_streams: int,
) -> Passing:
    """As above, of layers that emit as much as they take.

    Parameters
    ----------
    tau, backward
        What beams lose in each layer, and omega (1 - g) of its optical depth. [-]
    planck
        Planck function at the levels. [radiance unit]
    from_ground
        What the ground emits. [radiance unit]
    secant
        Of the view. [-]
    num_streams
        Half of them are the directions of diffuse light.
    """
    mu, weight = double_gauss(num_streams)
    secants = (1 / mu).reshape(-1, *(1,) * secant.ndim)
    weights = tuple((2 * mu * weight).tolist()), tuple(weight.tolist())
    layers = jax.lax.stop_gradient((tau, backward, planck[:-1], planck[1:] - planck[:-1]))

    def of_these(layers, from_ground, secant):
        return _passing(layers, from_ground, secant, secants, weights)

    return Passing(*one_kernel(of_these, 1)(layers, from_ground, secant))


def _passing(layers, from_ground, secant, secants, weights):
    secants = jnp.asarray(secants, secant.dtype)
    flux, mean = weights
    count = len(layers[0])

    def one(k, state):
        up, turned, rising, falling, seen = state
        tau, backward, planck, jump = (read(x, count - 1 - k) for x in layers)
        through, own, rest = emissivities(secant * tau)
        from_below = total([w * x for w, x in zip(mean, rising, strict=True)])
        turned = through * turned + secant * backward * (from_below + planck + jnp.abs(jump))
        up = through * up + planck * own + jump * rest
        through, own, rest = emissivities(secants * tau)
        falling = falling + seen * ((planck + jump) * own - jump * rest)
        rising = through * rising + planck * own + jump * rest
        return up, turned, rising, falling, through * seen

    nothing = jnp.zeros_like(secant)
    many = jnp.zeros((len(mean), *secant.shape), secant.dtype)
    start = nothing, nothing, many + from_ground, many, many + 1
    up, turned, _, falling, _ = jax.lax.fori_loop(0, count, one, start)
    return up, total([w * x for w, x in zip(flux, falling, strict=True)]), turned


def of_heat(
    layers: Depths,
    albedo: Float[Array, "*batch"],
    secant: Float[Array, "*batch"],
    planck: Float[Array, "level *batch"],
    air: Passing,
    from_ground: Float[Array, "*batch"],
) -> Faint:
    """Thermal light towards the only view, without that of the top level, as the sum has it.

    Parameters
    ----------
    layers, albedo
        Of the air and the ground.
    secant
        Of the view. [-]
    planck
        Planck function at the levels. [radiance unit]
    air
        Its light.
    from_ground
        What the ground emits. [radiance unit]
    """
    ground = from_ground + albedo * air.down
    back = albedo * layers.backward * jnp.exp(-DIFFUSE * layers.absorbed)
    through = jnp.exp(-secant * (layers.absorbed + 0.5 * layers.backward))
    reflected = albedo * layers.backward * through * (ground + jnp.max(planck, axis=0))
    return Faint(air.up + through * ground * (1 + back) - planck[0], air.turned + reflected)
