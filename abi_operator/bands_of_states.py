"""Optics and solver of a tile of states: the program behind every band.

The layers of a tile, with their long moments, are made where they are solved and gone when the next
tile's turn comes; what is kept of a column is what it sends up, a number a band. Slopes work alike:
a tile's program gives, beside the values, the slope of every band in every wanted leaf of the
state, and no layers of any other tile exist.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .atmosphere import State
from .band_columns import BandColumns, columns_of_bands
from .machine.door import Leaves
from .machine.sizes import tile_of_states
from .machine.slopes import slopes_by_copies
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


def of_tile(leaves: Leaves, structure: Any, options: Options) -> Float[Array, "band batch"]:
    """Reflectance or radiance of a tile of states.

    Parameters
    ----------
    leaves, structure
        Those of `Inputs`, with one axis of the batch, the last.
    options
        How to solve them.
    """
    return _solved(_columns(leaves, structure, options), options)


def with_slopes(
    leaves: Leaves, structure: Any, options: Options, wanted: tuple[bool, ...]
) -> tuple[Float[Array, "band batch"], list[Float[Array, "band *own batch"]]]:
    """The same, and the slopes of every band in the leaves that are wanted.

    Without a number of doublings nothing is known of the layers: see `TRACED_TAU`.
    """
    solved = _solved_unread if options.settings.num_doublings is None else _solved

    def value(leaves: Leaves) -> Array:
        return solved(_columns(leaves, structure, options, wanted), options)

    return slopes_by_copies(value, leaves, wanted, len(options.bands))


def tile_size(leaves: Leaves, structure: Any, options: Options) -> int:
    """States that are solved together."""
    columns = _num_columns(leaves, structure, options)
    return tile_of_states(columns, options.settings.num_streams, leaves[0].dtype)


def _num_columns(leaves: Leaves, structure: Any, options: Options) -> int:
    """Columns of the solver that one state is: the exponential terms of all bands."""
    air = jax.tree.unflatten(structure, leaves).state.atmosphere
    absorbing = options.settings.gases if air.gases is not None else ()
    return sum(num_terms(band, absorbing) for band in options.bands)


def _columns(
    tile: Leaves, structure: Any, options: Options, copied: Sequence[bool] | None = None
) -> tuple[BandColumns, ...]:
    """Solver's columns of a tile, whose batch is last here, too.

    Of leaves that are `copied` each band has its own, along their first axis.
    """
    settings = options.settings
    flags = [False] * len(tile) if copied is None else copied

    inputs = jax.tree.unflatten(structure, tile)
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
        thick = jnp.any(arguments["tau"] > TRACED_TAU, axis=1)
        # A factor, so that slopes are NaN as well.
        found |= columns.summed(terms * jnp.where(thick, jnp.nan, 1).astype(terms.dtype))
    return jnp.stack([found[band] for band in options.bands])


def _terms(columns: BandColumns, arguments: dict[str, Any], settings: Settings) -> Array:
    how: dict[str, Any] = {
        "num_streams": settings.num_streams,
        "num_modes": settings.num_modes,
        "num_doublings": settings.num_doublings,
        "error_budget": settings.error_budget,
    }
    # The batch's axes first, as the solver's doors want them; states within a column stay together.
    arguments = jax.tree.map(lambda x: jnp.moveaxis(x, -1, 1), arguments)
    return toa_radiance(**arguments, **how) if columns.emit else toa_brf(**arguments, **how)


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
