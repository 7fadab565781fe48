"""All that is known of columns without a solution, from one pass over their layers.

A value's cheapest columns are those that need nothing else (`faint`), so this is what most of a
clear scene costs. The pass goes from the ground up, as light does that is emitted and scattered on
the way, and reads every layer once, as it was given: scaling by delta-M is part of it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...machine.algebra import total
from ..method.mode_layers import read
from ..method.quadrature import half_range
from ..method.single_scatter import extinguished
from .depths import Depths
from .heat import emissivities


class Air(NamedTuple):
    """Layers as they are given, top first; None for what is not.

    Parameters
    ----------
    tau, ssa, moments
        As of `toa_brf`; chi_0 is not read. [-]
    phase_function
        At the scattering angle of each view. [-]
    secant
        Of the sun's beam in each layer, None for 1 / mu0. [-]
    planck
        Planck function at the levels. [radiance unit]
    """

    tau: Float[Array, "layer *batch"]
    ssa: Float[Array, "layer *batch"]
    moments: Float[Array, "layer moment *batch"]
    phase_function: Float[Array, "layer view *batch"]
    secant: Float[Array, "layer *batch"] | None = None
    planck: Float[Array, "level *batch"] | None = None


class Passing(NamedTuple):
    """Light of air that emits as much as beams lose in it and that nothing scatters: towards the
    view at the top, the mean of all directions at the ground; how much of what passes is turned
    round and seen; and the Planck function where it is largest. [radiance unit]"""

    up: Float[Array, "*batch"]
    down: Float[Array, "*batch"]
    turned: Float[Array, "*batch"]
    hottest: Float[Array, "*batch"]


class Scattered(NamedTuple):
    r"""What of the layers scatters, and how; without derivatives.

    Parameters
    ----------
    moments
        :math:`\sum\omega\tau\chi_l` of each degree. [-]
    slant
        Scattering depth along the sun's beam. [-]
    over_absorbers
        :math:`\sum\omega\tau t` and :math:`\sum\omega\tau t^2/2`, with the depth t that absorbs
        below the middle of a layer. [-]
    """

    moments: Sequence[Float[Array, "*batch"]]
    slant: Float[Array, "*batch"]
    over_absorbers: tuple[Float[Array, "*batch"], Float[Array, "*batch"]]


class Known(NamedTuple):
    """What a pass finds, of layers scaled by delta-M.

    Parameters
    ----------
    depths, scattered
        What the layers add up to.
    once
        Reflectance of light scattered once (`single_scatter.exact_single_scattering`). [-]
    passing
        Thermal light, None without `Air.planck`.
    """

    depths: Depths
    scattered: Scattered
    once: Float[Array, "view *batch"]
    passing: Passing | None


class _Layer(NamedTuple):
    """One of `Air`."""

    tau: Array
    ssa: Array
    moments: Array
    phase_function: Array


class _Sums(NamedTuple):
    """Of the layers below; see `Depths` and `Scattered`."""

    tau: Array
    absorbed: Array
    backward: Array
    slant: Array
    depth: Array
    moments: Array  # from degree 1 on
    scattered_slant: Array
    once: Array
    squared: Array
    source: Array  # scattered once towards each view


class _Heat(NamedTuple):
    """Light of the layers below, upwards in the view and in the nodes, and downwards at the ground;
    how much of a layer's light reaches the ground."""

    up: Array
    turned: Array
    rising: Array
    falling: Array
    seen: Array
    hottest: Array


def known(
    air: Air,
    mu0: Float[Array, "*batch"],
    mu: Float[Array, "view *batch"],
    from_ground: Float[Array, "*batch"],
    num_streams: int,
    delta_m: bool,
) -> Known:
    r"""Everything in one pass, inside a kernel.

    With f = chi_N of delta-M a layer's :math:`\tau'=(1-\omega f)\tau`, absorption
    :math:`(1-\omega)\tau`, :math:`\omega'\tau'\chi'_l=\omega\tau(\chi_l-f)`, and what of it goes
    backwards, :math:`\omega'(1-g')\tau'=\omega\tau(1-\chi_1)`, whatever f is.

    Parameters
    ----------
    air
        Layers.
    mu0, mu
        Cosines of the zenith angles of the sun and the views. [-]
    from_ground
        What the ground emits. [radiance unit]
    num_streams, delta_m
        How the columns would be solved. Half as many are the directions of diffuse light.
    """
    count, nothing = len(air.tau), jnp.zeros_like(mu0)

    def one(k, state):
        sums, heat = state
        place = count - 1 - k
        layer = _Layer(*(read(x, place) for x in air[:4]))
        sun = 1 / mu0 if air.secant is None else read(air.secant, place)
        f = layer.moments[num_streams] if delta_m else nothing
        absorbs, turns = (1 - layer.ssa) * layer.tau, _turned_round(layer)
        sums = _deeper(sums, layer, f, sun, 1 / mu + sun)
        if heat is not None and air.planck is not None:
            planck = read(air.planck, place), read(air.planck, place + 1)
            heat = _warmer(heat, absorbs + 0.5 * turns, turns, planck, 1 / mu[0])
        return sums, heat

    degrees = jnp.zeros((num_streams - 1, *mu0.shape), mu0.dtype)
    scalar = (nothing,) * len(_Sums._fields)
    sums = _Sums(*scalar)._replace(moments=degrees, source=jnp.zeros_like(mu * mu0))
    heat = None
    if air.planck is not None:
        many = jnp.zeros((num_streams // 2, *mu0.shape), mu0.dtype)
        start = nothing, nothing, many + from_ground, many, many + 1
        heat = _Heat(*start, hottest=read(air.planck, jnp.asarray(count)))
    sums, heat = jax.lax.fori_loop(0, count, one, (sums, heat))
    return Known(
        Depths(sums.tau, sums.absorbed, sums.depth, sums.backward, sums.slant),
        Scattered((sums.depth, *sums.moments), sums.scattered_slant, (sums.once, sums.squared)),
        sums.source / (4 * mu * mu0),
        None if heat is None else _passing(heat),
    )


def _turned_round(layer):
    return layer.ssa * layer.tau * (1 - layer.moments[1])


def _deeper(sums, layer, f, sun, secants):
    """The same with one more layer on it, of which delta-M takes the share f for unscattered."""
    scatters, absorbs = layer.ssa * layer.tau, (1 - layer.ssa) * layer.tau
    rest, whole = 1 - layer.ssa * f, (1 - f) * scatters
    tau, middle = rest * layer.tau, sums.absorbed + 0.5 * absorbs
    over, x = whole * middle, secants * tau
    through = jnp.exp(-x)
    # One quotient: it takes as long as ten products.
    own = layer.ssa * layer.phase_function / (rest * secants) * extinguished(x, through)
    return _Sums(
        tau=sums.tau + tau,
        absorbed=sums.absorbed + absorbs,
        backward=sums.backward + _turned_round(layer),
        slant=sums.slant + sun * tau,
        depth=sums.depth + whole,
        moments=sums.moments + scatters * (layer.moments[1 : len(sums.moments) + 1] - f),
        scattered_slant=sums.scattered_slant + sun * whole,
        once=sums.once + over,
        squared=sums.squared + 0.5 * over * middle,
        source=own + through * sums.source,
    )


def _warmer(heat, lost, turns, planck, secant):
    """The same with one more layer on it, which emits as much as beams lose in it."""
    above, below = planck
    jump = below - above
    mu, weight = half_range(2 * len(heat.rising))
    through, own, rest = emissivities(secant * lost)
    from_below = total([w * x for w, x in zip(weight.tolist(), heat.rising, strict=True)])
    turned = through * heat.turned + secant * turns * (from_below + above + jnp.abs(jump))
    up = through * heat.up + above * own + jump * rest
    secants = jnp.asarray((1 / mu).reshape(-1, *(1,) * lost.ndim), lost.dtype)
    through, own, rest = emissivities(secants * lost)
    return _Heat(
        up=up,
        turned=turned,
        rising=through * heat.rising + above * own + jump * rest,
        falling=heat.falling + heat.seen * (below * own - jump * rest),
        seen=through * heat.seen,
        hottest=jnp.maximum(heat.hottest, above),
    )


def _passing(heat):
    mu, weight = half_range(2 * len(heat.falling))
    down = total([w * x for w, x in zip((2 * mu * weight).tolist(), heat.falling, strict=True)])
    return Passing(heat.up, down, heat.turned, heat.hottest)
