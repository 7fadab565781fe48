r"""Columns as `gradient.emission` takes them: seen from their view, or from where the sun stands.

Fluxes are radiances towards the sun, by reciprocity: the share of its light that leaves the top is
the radiance that isotropic light 1 from above has there when it comes back, and the share that
reaches the ground the radiance of a black ground that emits 1.
"""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .gradient.emission import Lit
from .gradient.emitting_mode import Air, Heating
from .method.azimuth import Directions, LegendreTables, weighted_moments
from .method.bordered import Bordered, Vector
from .method.delta_m import ScaledLayers
from .method.doublings import Doublings
from .method.ground import Grounds
from .method.mode_layers import Layers


def air(
    layers: ScaledLayers, sun: Float[Array, "layer *batch"], view: Float[Array, "layer *batch"]
) -> Air:
    """Layers with the secants of two beams."""
    moments = weighted_moments(layers)
    moments = moments.reshape(-1, *moments.shape[2:])
    return Air(Layers(layers.tau, layers.coalbedo, sun, moments), view)


def upside_down(
    layers: ScaledLayers, directions: Directions, doublings: Doublings
) -> tuple[Air, Doublings]:
    """Layers bottom first, and their doublings; no beam is looked at."""
    reverse = lambda x: x[::-1]  # noqa: E731
    sun = directions.sun_secants[::-1]
    return air(jax.tree.map(reverse, layers), sun, sun), jax.tree.map(reverse, doublings)


def weights_of_modes(
    num_modes: int, azimuth: Float[Array, "*view_and_batch"]
) -> Float[Array, "mode *view_and_batch"]:
    r""":math:`(2 - \delta_{m0})(-1)^m \cos(m\,\Delta\phi)`."""
    order = jnp.arange(num_modes).reshape(-1, *(1,) * azimuth.ndim)
    sign = jnp.where(order == 0, 1, jnp.where(order % 2 == 0, 2, -2)).astype(azimuth.dtype)
    return sign * jnp.cos(order.astype(azimuth.dtype) * azimuth)


def seen_from_the_view(
    layers: ScaledLayers,
    tables: LegendreTables,
    directions: Directions,
    grounds: Grounds,
    weights: Float[Array, "mode *batch"],
    heating: Heating,
) -> Lit:
    """Light towards the only view.

    Parameters
    ----------
    layers, tables, directions
        As in `method.azimuth.emitting_mean`.
    grounds
        In all modes that there are weights for.
    weights
        Of each mode's reflection of sunlight.
    heating
        Thermal light; e of the ground at all beams, the sun first.
    """
    view = jnp.broadcast_to(1 / directions.cosines[1], layers.tau.shape)
    even, odd = (x[: weights.shape[0]] for x in tables.beams)
    of_air = air(layers, directions.sun_secants, view)
    column = Vector(heating.ground.nodes, heating.ground.beams[1:])
    heating = heating._replace(ground=column)
    return Lit(of_air, (even, odd), *grounds[:2], weights, heating, grounds.absorbed)


def seen_from(
    beam: Any,
    layers: ScaledLayers,
    tables: LegendreTables,
    directions: Directions,
    grounds: Grounds,
    heating: Heating,
) -> Lit:
    """Thermal light of the mean towards a beam, which takes the place of sun and view.

    Other arguments than the number of the beam as in `seen_from_the_view`.
    """

    def one(x: Array, axis: int = 0) -> Array:
        return jax.lax.dynamic_slice_in_dim(x, beam, 1, axis)

    def twice(x: Array, axis: int) -> Array:
        return jnp.concatenate([one(x, axis)] * 2, axis)

    shape = len(directions.cosines) - 1, *layers.tau.shape
    views = jnp.broadcast_to(1 / directions.cosines[1:, None], shape)
    secants = one(jnp.concatenate([directions.sun_secants[None], views]))[0]
    even, odd = (twice(x[:1], 1) for x in tables.beams)
    mean = grounds.mean
    nothing = jnp.zeros_like(mean.diagonal[:1])
    mean = Bordered(mean.core, twice(mean.border, 1), twice(mean.diagonal, 0), nothing)
    column = Vector(heating.ground.nodes, one(heating.ground.beams))
    of_air = air(layers, secants, secants)
    heating = heating._replace(ground=column)
    return Lit(of_air, (even, odd), mean, None, nothing, heating, grounds.absorbed)
