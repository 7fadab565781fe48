"""The albedo of the ground as an input, alike for every kind of ground.

A ground that reflects unevenly has more numbers than its albedo (weights of kernels, a wind, a
share of water), none of which is to be moved with it: it is made brighter to all sides alike.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..atmosphere import State
from ..ranges import STATE
from ..surface import LandAndSea, Ocean, brightened
from .inputs import Input, part

# Seas that are integrated together, which takes 2 MiB an array.
_SEAS = 64


def albedo(band: str | None = None, step: float = 0.01) -> Input:
    """White-sky albedo of the ground in one band or in all of them.

    A ground that reflects unevenly keeps how it does (`surface.brightened`): what is added it
    reflects to all sides. A column may be so where this albedo is between 0 and 1.

    Parameters
    ----------
    band
        Name of the band; None for all that the state has.
    step
        As of `Input`. [-]
    """

    def grounds(state: State) -> dict[str, Any]:
        found = state.albedo if band is None else {band: part(state, f"albedo.{band}")}
        return {name: jax.tree.map(jnp.asarray, ground) for name, ground in found.items()}

    def change(state: State, by: Array) -> State:
        moved = {name: brightened(ground, by) for name, ground in grounds(state).items()}
        return replace(state, albedo={**state.albedo, **moved})

    def relative(state: State) -> Callable[[State, Array], State]:
        # Of concrete numbers, as albedos of seas are found from; slopes are along them.
        own = {name: white_sky_albedo(ground) for name, ground in grounds(state).items()}

        def change(state: State, by: Array) -> State:
            there = grounds(state)
            moved = {name: brightened(there[name], by * own[name]) for name in there}
            return replace(state, albedo={**state.albedo, **moved})

        return change

    def value(state: State) -> Array:
        found = [white_sky_albedo(ground) for ground in grounds(state).values()]
        return jnp.mean(jnp.stack(found, axis=-1), axis=-1)

    def holds(state: State) -> np.ndarray:
        found = [np.asarray(white_sky_albedo(ground)) for ground in grounds(state).values()]
        return np.all(STATE["albedo"].holds(np.stack(found)), axis=0)

    name = "albedo" if band is None else f"albedo_{band}"
    where = "in all bands" if band is None else f"in {band} alone"
    words = f"albedo of the ground {where}"
    by_share = relative if band is None else None
    return Input(name, "1", words, step, change, value, holds, by_share)


def white_sky_albedo(ground: Any) -> Array:
    """Share of isotropic light (column,) that a ground of any kind reflects. [-]

    Parameters
    ----------
    ground
        Of columns in a band: the albedo of a Lambertian one, or any of the room `surface`. Where
        there is water its numbers have to be concrete.
    """
    fields, kind = jax.tree.flatten(jax.tree.map(jnp.asarray, ground))
    ground = jax.tree.unflatten(kind, jnp.broadcast_arrays(*fields))
    if isinstance(ground, LandAndSea):
        land, wet = ground.land.white_sky_albedo(), np.asarray(ground.water_share) > 0
        sea = np.array(land)
        sea[wet] = _of_seas(jax.tree.map(lambda x: x[wet], ground.sea))
        return land + ground.water_share * (jnp.asarray(sea) - land)
    if isinstance(ground, Ocean):
        return jnp.asarray(_of_seas(ground))
    return ground.white_sky_albedo() if hasattr(ground, "white_sky_albedo") else ground


def _of_seas(sea: Ocean) -> np.ndarray:
    """Of seas (column,), of which those that differ by no more than their water are solved once.

    A thousand take half a second, and a wind that is the same everywhere, or draws for a column,
    repeat them. Light out of the water goes to all sides, and is added to the albedo as it is.
    """
    water = np.asarray(sea.water_reflectance)
    # Foam to the seventh place, so that rounding does not tell brightened seas apart.
    foam = jnp.round(sea.foam_reflectance - sea.water_reflectance, 6)
    dark = replace(sea, water_reflectance=jnp.zeros_like(foam), foam_reflectance=foam)
    fields, kind = jax.tree.flatten(dark)
    rows, which = np.unique(np.stack(fields, axis=-1), axis=0, return_inverse=True)
    found = [np.empty(0, water.dtype)]
    for first in range(0, len(rows), _SEAS):
        index = np.minimum(np.arange(first, first + _SEAS), len(rows) - 1)
        some = jax.tree.unflatten(kind, [jnp.asarray(x) for x in rows[index].T])
        found.append(np.asarray(_integrated(some)))
    return water + np.concatenate(found)[which.reshape(-1)]


@jax.jit
def _integrated(sea: Ocean) -> Array:
    return sea.white_sky_albedo()
