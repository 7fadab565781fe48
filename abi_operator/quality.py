"""What limits the use of a simulated column: bits, and the shares behind one of them."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, UInt8

from ._batching import map_tiles
from .atmosphere import State
from .band_columns import above_horizon, ground_of
from .bands import BANDS, GRASSO2013
from .nomenclature import GRAZING_ZENITH, QUALITY_FLAGS
from .optics import outside_fitted_range as outside_of_column
from .state_checks import checked_bands, uniform
from .surface import Report, reported

LARGEST_SHARE_OUTSIDE = 0.1
"""Share of a band's optical depth outside fitted ranges from which a column is flagged. [-]"""
# Columns whose grounds are looked at together, from some 2000 views.
_TILE = 64


def quality_flags(state: State, bands: Sequence[str] = GRASSO2013) -> UInt8[Array, "*batch"]:
    """Bits of `nomenclature.QUALITY_FLAGS` of each column, 0 where nothing limits its use.

    Of their bits these are judged by a state: the sun at or below the horizon (``night``: brf NaN,
    reflectance factor 0, radiance of emission alone) or beyond 80 degrees from the zenith
    (``grazing_sun``), the same of the satellite (``out_of_sight``: all NaN; ``grazing_view``),
    hydrometeors whose size is beyond what their optics were fitted to (``outside_fit``, in any of
    `bands`), and anisotropic grounds that reflect less than nothing or more than all
    (``ground_below_zero``, ``ground_above_one``, in any of `bands`, under the column's sun, which
    must be up).

    Parameters
    ----------
    state
        One column or a batch.
    bands
        Names of the bands, each present in the state's albedo.

    Raises
    ------
    ValueError
        If a band is unknown or missing from the state, or a leaf's axes do not match.
    """
    bands = checked_bands(state, bands, (), "GOES-16")
    return _flags(uniform(state)[0], bands)


def outside_fitted_range(
    state: State, bands: Sequence[str] = GRASSO2013
) -> Float[Array, "*batch band"]:
    """Share of hydrometeors' optical depth at sizes beyond what was fitted; 0 without any. [-]

    Parameters
    ----------
    state, bands
        As in `quality_flags`; what the ranges are see `optics.outside_fitted_range`.
    """
    bands = checked_bands(state, bands, (), "GOES-16")
    return _outside(uniform(state)[0], bands)


@partial(jax.jit, static_argnums=1)
def _outside(state: State, bands: tuple[str, ...]) -> Array:
    def of_one(state: State) -> Array:
        return jnp.stack([outside_of_column(state.atmosphere, BANDS[b]) for b in bands])

    for _ in state.geometry.solar_zenith.shape:
        of_one = jax.vmap(of_one)
    return of_one(state)


@partial(jax.jit, static_argnums=1)
def _flags(state: State, bands: tuple[str, ...]) -> Array:
    sun, view = state.geometry.solar_zenith, state.geometry.view_zenith
    grazing = float(np.deg2rad(GRAZING_ZENITH))
    night, away = jnp.cos(sun) <= 0, jnp.cos(view) <= 0
    found = {
        "night": night,
        "grazing_sun": (sun > grazing) & ~night,
        "out_of_sight": away,
        "grazing_view": (view > grazing) & ~away,
        "outside_fit": jnp.any(_outside(state, bands) > LARGEST_SHARE_OUTSIDE, axis=-1),
    }
    mu0 = jnp.cos(above_horizon(sun))
    for band in bands:
        ground = ground_of(state, band)
        if isinstance(ground, jax.Array):
            continue
        report = _reported(ground, mu0)
        for name, bad in (
            ("ground_below_zero", report.below_zero),
            ("ground_above_one", report.above_one),
        ):
            found[name] = found.get(name, False) | (bad & ~night)
    bits = [jnp.where(x, np.uint8(QUALITY_FLAGS[k]), np.uint8(0)) for k, x in found.items()]
    return sum(bits[1:], start=bits[0])


def _reported(ground: Any, mu0: Array) -> Report:
    """`surface.reported`, tile by tile."""
    flat = jax.tree.map(jnp.ravel, (ground, mu0))
    found = map_tiles(lambda x: reported(*x), flat, _TILE)
    return jax.tree.map(lambda x: x.reshape(mu0.shape), found)
