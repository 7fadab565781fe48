"""Fires whose truth the inversion does not share.

The truth has five strips a pixel, of different albedo and of ground whose temperature varies by
2 K, of which one flames and one smoulders, 10 % hotter and 14 % cooler than the fire, under
air with a fifth more water vapour than is believed. The inversion has one temperature, one ground
and the air as it is believed.
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from abi_operator import Atmosphere, Fire, State, standard_atmosphere
from abi_operator.optics import ALL_GASES
from abi_operator.radiance import FIRE_BANDS

from ..declarations import fire
from ..prior import Prior
from ..state_vector import StateVector
from . import scenes
from .independent_case import STRIPS, UNEVEN_GROUND, Case, Drawn, as_retrieved, uneven

MEAN, SIGMAS = (800.0, 1e-3), (0.4, 0.4)
"""Of the prior: temperature [K] and burning share [-], and of x. [-]"""

_ATMOSPHERE, _LEVELS = "midlatitude_summer", np.linspace(1, 0, 21) ** 1.5 * 40e3
_MOISTER = 1.2
_GROUND_TEMPERATURE, _WARMTH = (290.0, 310.0), 2.0  # of pixels, and among the strips [K]
_ALBEDO = (0.05, 0.3)
_HOTTER = 1.1  # the flaming part than the fire as a whole


def independent_fire() -> Case:
    """Temperature and burning share of a fire from C05, C06 and C07."""
    vector = fire()
    return Case(
        FIRE_BANDS,
        ALL_GASES,
        vector,
        Prior(np.asarray(vector.x(*MEAN)), np.diag(np.square(SIGMAS))),
        ("fire temperature [K]", "fire fraction"),
        partial(_drawn, vector),
        partial(as_retrieved, vector),
    )


def _drawn(vector: StateVector, rng: np.random.Generator, num_pixels: int) -> Drawn:
    n = num_pixels
    x = np.asarray(vector.x(*MEAN)) + np.array(SIGMAS) * rng.standard_normal((n, 2))
    values = vector.values(jnp.asarray(x))
    kelvin, share = (np.asarray(values[name]) for name in vector.names)
    albedo = rng.uniform(*_ALBEDO, (n, len(FIRE_BANDS)))
    warmth = rng.uniform(*_GROUND_TEMPERATURE, n)
    geometry = scenes.random_directions(rng, n)
    of_ground = uneven(rng, n, UNEVEN_GROUND)
    ground = warmth[:, None] + _WARMTH * rng.standard_normal((n, STRIPS))
    ground += warmth[:, None] - ground.mean(axis=1, keepdims=True)
    # Half of what is burning each; together both emit what the fire as a whole does.
    cooler = (2 - _HOTTER**4) ** 0.25
    burning, hot = np.zeros((n, STRIPS)), np.tile(kelvin[:, None], STRIPS)
    for strip, factor in ((1, _HOTTER), (3, cooler)):
        burning[:, strip], hot[:, strip] = share * STRIPS / 2, kelvin * factor

    def grounds(albedo: np.ndarray) -> dict[str, jax.Array]:
        return {band: jnp.asarray(albedo[:, i]) for i, band in enumerate(FIRE_BANDS)}

    cells = State(
        _air(n * STRIPS, _MOISTER),
        grounds((albedo[:, None] * of_ground[..., None]).reshape(n * STRIPS, -1)),
        jax.tree.map(lambda angle: jnp.repeat(angle, STRIPS), geometry),
        jnp.asarray(ground.ravel()),
        Fire(jnp.asarray(burning.ravel()), jnp.asarray(hot.ravel())),
    )
    nothing = Fire(jnp.full(n, MEAN[1]), jnp.full(n, MEAN[0]))
    believed = State(_air(n, 1.0), grounds(albedo), geometry, jnp.asarray(warmth), nothing)
    return Drawn(cells, believed, x, np.stack([kelvin, share]))


def _air(num_pixels: int, moisture: float) -> Atmosphere:
    """A summer's air, with so much of its water vapour."""
    air = standard_atmosphere(_ATMOSPHERE, _LEVELS)
    air = eqx.tree_at(lambda a: a.gases.vapour, air, replace_fn=lambda vapour: vapour * moisture)
    return jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (num_pixels, *jnp.shape(leaf))), air)
