"""Optics and solver of states, a tile at a time: the program behind every band.

The layers of a tile, with their long moments, are made where they are solved and gone when the next
tile's turn comes; what is kept of a column is what it sends up, a number a band. Slopes work alike:
a tile's program gives, beside the values, the slope of every band in every wanted leaf of the
state, and no layers of any other tile exist.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .atmosphere import State
from .band_columns import BandColumns, columns_of_bands
from .machine.batching import map_tiles, on_every_device
from .machine.door import Leaves
from .machine.sizes import tile_of_states
from .machine.slopes import chosen
from .optics import num_terms
from .settings import Settings
from .solver import sufficient_doublings, toa_brf, toa_radiance

TRACED_TAU = 1000.0
"""Largest optical depth of a layer in columns of which slopes are made without being read; of one
that is opaque any depth will do. [-]"""
# Single-scattering albedo up to which a layer of that depth lets nothing through: no light comes
# back from below exp(-69) of its way (diffusion exponent sqrt(3) (1 - ssa) or more).
_OPAQUE_SSA = 0.96
# Doublings that are right to 2e-8 for such layers, up to so many streams: against 14 doublings at
# single-scattering albedos of 0.9 to 1, sun and satellite up to 87 degrees from the zenith.
_TRACED_DOUBLINGS, _TRACED_STREAMS, _TRACED_MU = 6, 16, 0.05


class Inputs(NamedTuple):
    """What a program is given.

    Parameters
    ----------
    state
        What the columns hold, all leaves of one floating type and with the batch's axes first.
    solar_irradiance
        Of the bands that emit. [W m-2 um-1]
    """

    state: State
    solar_irradiance: dict[str, Array]


class Options(NamedTuple):
    """What is static in a program.

    Parameters
    ----------
    bands
        Names of the bands.
    emitting
        Those of them of which the radiance is wanted and not the reflectance.
    settings
        How they are simulated.
    """

    bands: tuple[str, ...]
    emitting: tuple[str, ...]
    settings: Settings


def values(leaves: Leaves, structure: Any, options: Options, num_axes: int) -> Array:
    """Reflectance or radiance ``*batch band`` of states whose leaves have their batch's axes first.

    Parameters
    ----------
    leaves, structure
        Those of `Inputs`.
    options
        How to solve them.
    num_axes
        Axes of the batch.
    """

    def value(tile: Leaves) -> Array:
        return _solved(_columns(tile, structure, options), options)

    return _tiled(value, leaves, structure, options, num_axes)


def values_and_slopes(
    leaves: Leaves,
    structure: Any,
    options: Options,
    num_axes: int,
    wanted: tuple[bool, ...],
) -> tuple[Array, list[Array]]:
    """Values, and the slopes ``*batch band *own`` of the leaves that are wanted.

    Without a number of doublings nothing is known of the layers: see `TRACED_TAU`.
    """
    solved = _solved_unread if options.settings.num_doublings is None else _solved

    def both(tile: Leaves) -> tuple[Array, Leaves]:
        # Each band has its own copy of what is wanted, so that one pull gives all bands' slopes.
        def value(copies: Leaves) -> Array:
            own = iter(copies)
            merged = [next(own) if w else x for x, w in zip(tile, wanted, strict=True)]
            columns = _columns(merged, structure, options, wanted)
            return solved(columns, options)

        count = len(options.bands)
        copies = [jnp.broadcast_to(x, (count, *x.shape)) for x in chosen(tile, wanted)]
        found, pull_back = jax.vjp(value, copies)
        return found, pull_back(jnp.ones_like(found))[0]

    return _tiled(both, leaves, structure, options, num_axes)


def _tiled(
    function: Callable[[Leaves], Any],
    leaves: Leaves,
    structure: Any,
    options: Options,
    num_axes: int,
) -> Any:
    """`function` of leaves whose batch is last, tile by tile, with the batch's axes first again."""

    def share(leaves: Leaves) -> Any:
        batch = leaves[0].shape[:num_axes]
        last = [_batch_last(x, num_axes) for x in leaves]
        width = tile_size(leaves, structure, options)

        def outward(x: Array) -> Array:
            x = jnp.moveaxis(x, -1, 0)
            return x.reshape(*batch, *x.shape[1:])

        return jax.tree.map(outward, map_tiles(function, last, width))

    return on_every_device(share, leaves, [num_axes > 0] * len(leaves))


def tile_size(leaves: Leaves, structure: Any, options: Options) -> int:
    """States that are solved together."""
    columns = _num_columns(leaves, structure, options)
    return tile_of_states(columns, options.settings.num_streams, leaves[0].dtype)


def _num_columns(leaves: Leaves, structure: Any, options: Options) -> int:
    """Columns of the solver that one state is: the exponential terms of all bands."""
    air = jax.tree.unflatten(structure, leaves).state.atmosphere
    absorbing = options.settings.gases if air.gases is not None else ()
    return sum(num_terms(band, absorbing) for band in options.bands)


def _batch_last(x: Array, num_axes: int) -> Array:
    own = x.shape[num_axes:]
    return jnp.moveaxis(x.reshape(-1, *own), 0, -1)


def _columns(
    tile: Leaves, structure: Any, options: Options, copied: Sequence[bool] | None = None
) -> tuple[BandColumns, ...]:
    """Solver's columns of a tile whose batch is last, with the axis of the batch first.

    Of leaves that are `copied` each band has its own, along their first axis.
    """
    settings = options.settings
    flags = [False] * len(tile) if copied is None else copied

    def of_one(leaves: Leaves) -> tuple[BandColumns, ...]:
        inputs = jax.tree.unflatten(structure, leaves)
        return columns_of_bands(
            inputs.state,
            options.bands,
            settings.gases,
            settings.num_streams + 1,
            per_band=tuple(jax.tree.unflatten(structure, flags)),
            emitting=options.emitting,
            solar_irradiance=inputs.solar_irradiance,
            satellite=settings.satellite,
        )

    return jax.vmap(of_one, in_axes=-1)(list(tile))


def _solved(groups: Sequence[BandColumns], options: Options) -> Float[Array, "band batch"]:
    """One solve for the bands that have the same kind of ground and of light."""
    found = {}
    for columns in groups:
        found |= columns.summed(_terms(columns, columns.arguments, options.settings))
    return jnp.stack([found[band] for band in options.bands])


def _solved_unread(groups: Sequence[BandColumns], options: Options) -> Float[Array, "band batch"]:
    """The same, with doublings that suffice up to `TRACED_TAU`; beyond it is NaN."""
    settings = options.settings
    settings = settings._replace(num_doublings=_traced_doublings(settings.num_streams))
    found = {}
    for columns in groups:
        arguments = columns.arguments | {"tau": _without_depth_of_opaque(columns)}
        terms = _terms(columns, arguments, settings)
        thick = jnp.any(arguments["tau"] > TRACED_TAU, axis=-1)
        # A factor, so that slopes are NaN as well.
        found |= columns.summed(terms * jnp.where(thick, jnp.nan, 1).astype(terms.dtype))
    return jnp.stack([found[band] for band in options.bands])


def _terms(columns: BandColumns, arguments: dict[str, Any], settings: Settings) -> Array:
    how: dict[str, Any] = {
        "num_streams": settings.num_streams,
        "num_modes": settings.num_modes,
        "num_doublings": settings.num_doublings,
    }
    if columns.emit:
        return toa_radiance(**arguments, **how)
    return toa_brf(**arguments, **how, error_budget=settings.error_budget)


def _without_depth_of_opaque(columns: BandColumns) -> Array:
    """Layers of which light sees the top alone, such as those of strong lines, no deeper than that.

    Not those that shine: the deeper a layer, the less its temperature changes from top to where it
    is seen.
    """
    tau, ssa = columns.arguments["tau"], columns.arguments["ssa"]
    return tau if columns.emit else jnp.where(ssa <= _OPAQUE_SSA, jnp.minimum(tau, TRACED_TAU), tau)


def _traced_doublings(num_streams: int) -> int:
    """Enough for layers up to `TRACED_TAU`."""
    if num_streams <= _TRACED_STREAMS:
        return _TRACED_DOUBLINGS
    return sufficient_doublings(TRACED_TAU, _TRACED_MU, num_streams)
