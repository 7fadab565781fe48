"""Liquid cloud whose truth the inversion does not share.

The truth has droplets that grow upwards, from 0.6 to 1.2 times their mean effective radius in two
layers, a cloud one layer (1.2 km) higher than is believed, and strips of different optical
thickness and albedo, whose reflectances are averaged: thick strips add less than thin ones lack.
The inversion has droplets of one radius and one column.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from abi_operator import LiquidCloud, State
from abi_operator.constants import WATER_DENSITY
from abi_operator.optics import effective_radius

from ..declarations import liquid_cloud
from ..kinds import KINDS
from ..prior import Prior
from ..state_vector import StateVector
from . import scenes
from .independent_case import (
    STRIPS,
    UNEVEN_GROUND,
    Case,
    Drawn,
    as_retrieved,
    uneven,
)

BANDS = KINDS["cloud"].bands
MEAN, SIGMAS = (12.0, 10.0), (0.6, 0.4)
"""Of the prior: optical thickness [-] and effective radius [um], and of x. [-]"""

_ALBEDO = (0.02, 0.25)
_UNEVEN_CLOUD = 0.3  # relative standard deviation among the strips
_LAYERS = (-4, -3)  # of the believed cloud, top first: 1.3 to 3.6 km
_MICRON, _DROPS = 1e-6, 2e11  # [m]; of some 10 um in a kilogram
_SHARES, _GROWTH = (0.6, 0.4), (1.2, 0.6)  # of optical thickness; of the radius, top first


def independent_cloud() -> Case:
    """Optical thickness and effective radius of liquid cloud from C02 and C06."""
    vector = liquid_cloud()
    return Case(
        BANDS,
        (),
        vector,
        Prior(np.asarray(vector.x(*MEAN)), np.diag(np.square(SIGMAS))),
        ("cloud optical thickness", "cloud effective radius [um]"),
        partial(_drawn, vector),
        partial(as_retrieved, vector),
    )


def _drawn(vector: StateVector, rng: np.random.Generator, num_pixels: int) -> Drawn:
    n = num_pixels
    x = np.asarray(vector.x(*MEAN)) + np.array(SIGMAS) * rng.standard_normal((n, 2))
    values = vector.values(jnp.asarray(x))
    thickness, radius = (np.asarray(values[name]) for name in vector.names)
    albedo = rng.uniform(*_ALBEDO, (n, len(BANDS)))
    geometry = scenes.random_directions(rng, n)
    by_strip = thickness[:, None] * uneven(rng, n, _UNEVEN_CLOUD)
    of_ground = uneven(rng, n, UNEVEN_GROUND)
    cells = State(
        scenes.clear_air(
            n * STRIPS, liquid=_cloud(by_strip.ravel(), np.repeat(radius, STRIPS), 1, _GROWTH)
        ),
        {b: jnp.asarray((albedo[:, i, None] * of_ground).ravel()) for i, b in enumerate(BANDS)},
        jax.tree.map(lambda angle: jnp.repeat(angle, STRIPS), geometry),
    )
    air = scenes.clear_air(n, liquid=_cloud(np.ones(n), np.full(n, MEAN[1]), 0, (1.0, 1.0)))
    believed = scenes.with_albedo(State(air, {}, geometry), albedo, BANDS)
    return Drawn(cells, believed, x, np.stack([thickness, radius]))


def _cloud(
    thickness: np.ndarray, radius: np.ndarray, raised: int, growth: tuple[float, float]
) -> LiquidCloud:
    """A cloud of two layers whose droplets have this effective radius together. [-], [um]

    Together it is the mass over the optical thickness: the mean of the layers', weighted by that.
    """
    mean = sum(share * factor for share, factor in zip(_SHARES, growth, strict=True))
    tau = np.zeros((thickness.size, scenes.NUM_LAYERS))
    size = np.ones_like(tau)
    for layer, share, factor in zip(_LAYERS, _SHARES, growth, strict=True):
        tau[:, layer - raised] = share * thickness
        size[:, layer - raised] = radius * factor / mean
    # Mass is in proportion to optical thickness times radius, number to mass over radius cubed.
    mass = tau * size * (_MICRON * 2 / 3 * WATER_DENSITY)
    one = LiquidCloud(jnp.ones(1), jnp.full(1, _DROPS))
    radius_of_one = float(effective_radius(one)[0]) / _MICRON
    number = mass * _DROPS * (radius_of_one / size) ** 3
    return LiquidCloud(jnp.asarray(mass), jnp.asarray(number))
