"""What limits the use of a simulated column: bits, and the shares behind one of them."""

from collections.abc import Mapping, Sequence
from functools import partial
from types import ModuleType
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, UInt8

from .atmosphere import State
from .band_columns import above_horizon, ground_of
from .bands import BANDS, GRASSO2013
from .geometry import is_up
from .machine.batching import map_tiles
from .machine.sizes import tile_of_grounds
from .nomenclature import GRAZING_ZENITH, LARGEST_SHARE_OUTSIDE, QUALITY_FLAGS
from .optics import outside_fitted_range as outside_of_column
from .state_checks import checked_bands, uniform
from .surface import Report, reported


def quality_flags(state: State, bands: Sequence[str] = GRASSO2013) -> UInt8[Array, "*batch"]:
    """Bits of `nomenclature.QUALITY_FLAGS` of each column, 0 where nothing limits its use.

    Of their bits these are judged by a state: the sun at or below the horizon (``night``: brf NaN,
    reflectance factor 0, radiance of emission alone) or beyond 80 degrees from the zenith
    (``grazing_sun``), the same of the satellite (``out_of_sight``: all NaN; ``grazing_view``),
    hydrometeors of which more than `LARGEST_SHARE_OUTSIDE` of the optical depth is at sizes beyond
    what their optics were fitted to (``outside_fit``, in any of `bands`), and anisotropic grounds
    that reflect less than nothing or more than all (``ground_below_zero``, ``ground_above_one``, in
    any of `bands`, under the column's sun, which must be up).

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


def flags_from(
    solar_zenith: Any,
    view_zenith: Any,
    share_outside: Any = None,
    found: Mapping[str, Any] | None = None,
    *,
    numbers: ModuleType = np,
) -> Any:
    """Bits of `nomenclature.QUALITY_FLAGS`, uint8, of states and of scenes alike.

    Parameters
    ----------
    solar_zenith, view_zenith
        Angles from the vertical, ``*batch``. [rad]
    share_outside
        Share of hydrometeors' optical depth at sizes that no fit covers, ``*batch band``; None
        where it is not known yet. [-]
    found
        By name of the flag, where anything else was found that has one.
    numbers
        `numpy`, or `jax.numpy` of arrays that are traced.
    """
    grazing = np.deg2rad(GRAZING_ZENITH).item()
    # A sun that is nowhere is not below the horizon.
    night, away = (~is_up(x) & ~numbers.isnan(x) for x in (solar_zenith, view_zenith))
    holds = {
        "grazing_sun": (solar_zenith > grazing) & ~night,
        "night": night,
        "grazing_view": (view_zenith > grazing) & ~away,
        "out_of_sight": away,
        **(found or {}),
    }
    if share_outside is not None:
        holds["outside_fit"] = numbers.any(share_outside > LARGEST_SHARE_OUTSIDE, axis=-1)
    none = np.uint8(0)
    bits = [numbers.where(x, np.uint8(QUALITY_FLAGS[k]), none) for k, x in holds.items()]
    return sum(bits[1:], start=bits[0])


@partial(jax.jit, static_argnums=1)
def _flags(state: State, bands: tuple[str, ...]) -> Array:
    sun, view = state.geometry.solar_zenith, state.geometry.view_zenith
    by_day, mu0 = is_up(sun), jnp.cos(above_horizon(sun))
    found: dict[str, Array] = {}
    for band in bands:
        ground = ground_of(state, band)
        if isinstance(ground, jax.Array):
            continue
        report = _reported(ground, mu0)
        for name, bad in (
            ("ground_below_zero", report.below_zero),
            ("ground_above_one", report.above_one),
        ):
            found[name] = found.get(name, False) | (bad & by_day)
    return flags_from(sun, view, _outside(state, bands), found, numbers=jnp)


def _reported(ground: Any, mu0: Array) -> Report:
    """`surface.reported`, tile by tile."""
    flat = jax.tree.map(jnp.ravel, (ground, mu0))
    found = map_tiles(lambda x: reported(*x), flat, tile_of_grounds())
    return jax.tree.map(lambda x: x.reshape(mu0.shape), found)
