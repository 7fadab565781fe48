"""Columns of a scene by the kind of their ground: each is solved for as little as it is.

All columns of a scene may have the ground `LandAndSea`. Most are one of its parts alone, and land
without kernels is Lambertian, for which fewer azimuth modes and a simpler program do.
"""

import dataclasses
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..atmosphere import State
from ..surface import LandAndSea


def by_kind(states: State) -> Iterator[tuple[np.ndarray, State]]:
    """Which columns (column,) have grounds of one kind, and these states, kind by kind."""
    mixed = {name: x for name, x in states.albedo.items() if isinstance(x, LandAndSea)}
    if not mixed:
        yield np.ones(len(states.geometry.solar_zenith), bool), states
        return
    water = np.asarray(next(iter(mixed.values())).water_share)
    bent = np.any([(x.land.f_vol != 0) | (x.land.f_geo != 0) for x in mixed.values()], axis=0)
    kinds: tuple[tuple[np.ndarray, Callable[[LandAndSea], Any]], ...] = (
        ((water == 0) & ~bent, lambda x: x.land.f_iso),
        ((water == 0) & bent, lambda x: x.land),
        (water == 1, lambda x: x.sea),
        ((water > 0) & (water < 1), lambda x: x),
    )
    for chosen, part in kinds:
        if chosen.any():
            grounds = states.albedo | {name: part(x) for name, x in mixed.items()}
            index = np.flatnonzero(chosen)
            some = dataclasses.replace(states, albedo=grounds)
            yield chosen, jax.tree.map(lambda x, index=index: x[index], some)


def ground_flags(states: State) -> dict[str, np.ndarray]:
    """By name of a flag, which columns (column,) have land that is no ground, in any band.

    ``ground_below_zero`` where the kernels reflect less than nothing from the sun into this view,
    and ``ground_above_one`` where the land reflects more than all of the sun's beam by the
    product's own polynomials. `quality_flags` looks into all directions, at a price.
    """
    geometry = states.geometry
    sun, view = (np.cos(np.asarray(x)) for x in (geometry.solar_zenith, geometry.view_zenith))
    up = (sun > 0) & (view > 0)
    mu0, mu = (np.where(up, x, 1.0) for x in (sun, view))
    found: dict[str, np.ndarray] = {}
    for ground in states.albedo.values():
        if isinstance(ground, LandAndSea):
            land = jax.tree.map(jnp.asarray, ground.land)
            azimuth = jnp.asarray(geometry.relative_azimuth)
            brdf = land.brdf(jnp.asarray(mu), jnp.asarray(mu0), azimuth)
            albedo = land.black_sky_albedo(jnp.asarray(mu0))
            dry = up & (np.asarray(ground.water_share) < 1)
            for name, bad in (("ground_below_zero", brdf < 0), ("ground_above_one", albedo > 1)):
                found[name] = found.get(name, False) | (np.asarray(bad) & dry)
    return found
