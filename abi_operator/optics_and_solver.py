"""Optics and solver in one program, a tile of columns at a time.

The layers of a tile, with their long moments, are made where they are solved and gone when the next
tile's turn comes; what is kept of a column is what it sends up, a number a band. Derivatives work
alike: a tile's program gives, beside the values, the slope of every band in every wanted leaf of
the state. Forward mode multiplies slopes by tangents and reverse mode by cotangents, a Jacobian
takes them as they are, and no layers of any other tile exist.

How often the solver doubles its layers is a property of the program and chosen from the thickest
layer. Its optical depth is read before the program is: at the door, in the rules of derivatives and
in that of `jax.vmap`, all of which know the values that they transform. Inside `jax.jit` or a loop
nobody does, and the program is right for layers up to `TRACED_TAU`: columns with a thicker one
come back as NaN.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.custom_batching import custom_vmap
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from ._batching import map_tiles, on_every_device, tile_size
from .atmosphere import State
from .band_columns import above_horizon, band_columns
from .bands import BANDS
from .optics import column_optics
from .solver import sufficient_doublings, toa_brf, toa_radiance

TRACED_TAU = 1000.0
"""Largest optical depth of a layer in columns that are solved without being read. [-]"""
# Doublings that are right to 2e-8 for such layers, up to so many streams: against 14 doublings at
# single-scattering albedos of 0.9 to 1, sun and satellite up to 87 degrees from the zenith.
_TRACED_DOUBLINGS, _TRACED_STREAMS, _TRACED_MU = 6, 16, 0.05
# Columns of the solver in a tile, in tiles of the solver: its own loop is inside.
_SOLVER_TILES = 8
# States are tiled by so many, which vector units take at a time.
_VECTOR = 8
# Columns whose extinction is read together.
_READ_TILE = 1024

Leaves = list[Array]


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
    satellite
        In whose responses they emit.
    gases, num_streams, num_modes
        As in `reflectance.brf`.
    """

    bands: tuple[str, ...]
    emitting: tuple[str, ...]
    satellite: str
    gases: tuple[str, ...]
    num_streams: int
    num_modes: int | None


def solve(
    inputs: Inputs, options: Options, num_doublings: int | None = None
) -> Float[Array, "*batch band"]:
    """Reflectance of each column in each band, or radiance in those that emit. [-], [W m-2 ...]

    Parameters
    ----------
    inputs, options
        What the columns are and how to solve them.
    num_doublings
        Doublings of every layer; None for a sufficient number.
    """
    leaves, structure = jax.tree.flatten(inputs)
    program = _Program(structure, options, num_doublings)
    num_axes = inputs.state.geometry.solar_zenith.ndim
    solution = jax.custom_jvp(lambda *x: program.joining(program.value, num_axes, x))

    def rule(primals: Leaves, tangents: list[Any]) -> tuple[Array, Array]:
        wanted = tuple(not isinstance(x, SymbolicZero) for x in tangents)
        value, slopes = program.linearised(wanted, num_axes, primals)
        if not slopes:
            return value, jnp.zeros_like(value)
        return value, _contracted(slopes, _chosen(tangents, wanted), num_axes)

    solution.defjvp(rule, symbolic_zeros=True)
    return solution(*leaves)


class _Program:
    """The program of one call, for any number of batch axes."""

    def __init__(self, structure: Any, options: Options, num_doublings: int | None):
        self.structure, self.options, self.num_doublings = structure, options, num_doublings

    def value(self, num_doublings: int | None, num_axes: int, leaves: Leaves) -> Array:
        return _values(leaves, self.structure, self.options, num_axes, num_doublings)

    def value_and_slopes(
        self, wanted: tuple[bool, ...], num_doublings: int | None, num_axes: int, leaves: Leaves
    ) -> tuple[Array, Leaves]:
        both = _values_and_slopes
        return both(leaves, self.structure, self.options, num_axes, num_doublings, wanted)

    def linearised(self, wanted: tuple[bool, ...], num_axes: int, leaves: Leaves) -> Any:
        """Value and slopes, which can be differentiated again; see `joining`."""
        function = partial(self.value_and_slopes, wanted)
        joining = jax.custom_jvp(lambda *x: self.joining(function, num_axes, x))

        @joining.defjvp
        def _(primals, tangents):
            number = self.doublings(primals)
            return jax.jvp(lambda *x: function(number, num_axes, list(x)), primals, tangents)

        return joining(*leaves)

    def joining(self, function: Callable[..., Any], num_axes: int, leaves: Sequence[Array]) -> Any:
        """`function`, with axes that `jax.vmap` maps over as more axes of its batch.

        `jax.custom_batching.custom_vmap` alone has no derivatives.
        """
        number = self.doublings(leaves)

        @custom_vmap
        def joined(leaves: Leaves) -> Any:
            return function(number, num_axes, leaves)

        @joined.def_vmap
        def _(size: int, is_mapped: list[list[bool]], leaves: Leaves) -> tuple[Any, Any]:
            full = [
                x if mapped else jnp.broadcast_to(x, (size, *x.shape))
                for x, mapped in zip(leaves, is_mapped[0], strict=True)
            ]
            found = self.joining(function, num_axes + 1, full)
            return found, jax.tree.map(lambda _: True, found)

        return joined(list(leaves))

    def doublings(self, leaves: Sequence[Array]) -> int | None:
        """Those asked for, or enough for columns that can be read; None for others."""
        read = self.num_doublings is None and not any(isinstance(x, Tracer) for x in leaves)
        if not read:
            return self.num_doublings
        geometry = jax.tree.unflatten(self.structure, leaves).state.geometry
        if geometry.solar_zenith.size == 0:
            return 0
        thickest = _thickest(list(leaves), self.structure, self.options, geometry.mu.ndim)
        steepest = max(
            float(np.max(above_horizon(x))) for x in (geometry.solar_zenith, geometry.view_zenith)
        )
        cosine = max(float(np.cos(steepest)), float(np.finfo(np.float32).eps))
        return sufficient_doublings(float(thickest), cosine, self.options.num_streams)


def _chosen(items: Sequence[Any], wanted: Sequence[bool]) -> list[Any]:
    return [item for item, use in zip(items, wanted, strict=True) if use]


@partial(jax.jit, static_argnums=2)
def _contracted(slopes: Leaves, tangents: Leaves, num_axes: int) -> Array:
    """Slopes times tangents, summed over each column's own axes: linear, so JAX transposes it."""

    def product(slope: Array, tangent: Array) -> Array:
        tangent = jnp.expand_dims(tangent, num_axes)
        return jnp.sum(slope * tangent, axis=tuple(range(num_axes + 1, slope.ndim)))

    first, *others = (product(x, t) for x, t in zip(slopes, tangents, strict=True))
    return sum(others, start=first)


@partial(jax.jit, static_argnums=(1, 2, 3, 4))
def _values(
    leaves: Leaves, structure: Any, options: Options, num_axes: int, num_doublings: int | None
) -> Array:
    def value(tile: Leaves) -> Array:
        inputs = jax.tree.unflatten(structure, tile)
        columns = {name: _columns(inputs, name, options) for name in options.bands}
        return _solved(columns, options, num_doublings)

    return _tiled(value, leaves, structure, options, num_axes)


@partial(jax.jit, static_argnums=(1, 2, 3, 4, 5))
def _values_and_slopes(
    leaves: Leaves,
    structure: Any,
    options: Options,
    num_axes: int,
    num_doublings: int | None,
    wanted: tuple[bool, ...],
) -> tuple[Array, Leaves]:
    """Values, and the slopes ``*batch band *own`` of the leaves that are wanted."""

    def both(tile: Leaves) -> tuple[Array, Leaves]:
        # Each band has its own copy of what is wanted, so that one pull gives all bands' slopes.
        def value(copies: dict[str, Leaves]) -> Array:
            columns = {}
            for name, copy in copies.items():
                own = iter(copy)
                merged = [next(own) if w else x for x, w in zip(tile, wanted, strict=True)]
                inputs = jax.tree.unflatten(structure, merged)
                columns[name] = _columns(inputs, name, options)
            return _solved(columns, options, num_doublings)

        found, pull_back = jax.vjp(value, {name: _chosen(tile, wanted) for name in options.bands})
        (slopes,) = pull_back(jnp.ones_like(found))
        return found, [jnp.stack(x) for x in zip(*(slopes[b] for b in options.bands), strict=True)]

    return _tiled(both, leaves, structure, options, num_axes)


@partial(jax.jit, static_argnums=(1, 2, 3))
def _thickest(leaves: Leaves, structure: Any, options: Options, num_axes: int) -> Array:
    """Largest optical depth of any layer in any band. [-]"""

    def of_one(tile: Leaves) -> Array:
        atmosphere = jax.tree.unflatten(structure, tile).state.atmosphere
        return jnp.stack(
            [jnp.max(column_optics(atmosphere, BANDS[b], options.gases).tau) for b in options.bands]
        ).max()

    def of_tile(tile: Leaves) -> Array:
        return jax.vmap(of_one, in_axes=-1)(tile)

    last = [_batch_last(x, num_axes) for x in leaves]
    return jnp.max(map_tiles(of_tile, last, _READ_TILE))


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
        columns = _num_columns(last, structure, options)
        tile = tile_size(options.num_streams, last[0].dtype)
        width = _VECTOR * max(1, _SOLVER_TILES * tile // columns // _VECTOR)

        def outward(x: Array) -> Array:
            x = jnp.moveaxis(x, -1, 0)
            return x.reshape(*batch, *x.shape[1:])

        return jax.tree.map(outward, map_tiles(function, last, width))

    return on_every_device(share, leaves, [num_axes > 0] * len(leaves))


def _num_columns(last: Leaves, structure: Any, options: Options) -> int:
    """Columns of the solver that one state is: the exponential terms of all bands."""

    def weights(leaves: Leaves) -> list[Array]:
        one = jax.tree.unflatten(structure, [x[..., 0] for x in leaves])
        air = one.state.atmosphere
        return [column_optics(air, BANDS[b], options.gases).weight for b in options.bands]

    return sum(x.size for x in jax.eval_shape(weights, last))


def _batch_last(x: Array, num_axes: int) -> Array:
    own = x.shape[num_axes:]
    return jnp.moveaxis(x.reshape(-1, *own), 0, -1)


def _columns(inputs: Inputs, band: str, options: Options) -> Any:
    """`BandColumns` of a tile whose batch is last, with its axis first."""

    def of_one(one: Inputs) -> Any:
        emission = {}
        if band in options.emitting:
            irradiance = one.solar_irradiance[band]
            emission = {"solar_irradiance": irradiance, "emitting_as": options.satellite}
        return band_columns(one.state, band, options.gases, options.num_streams + 1, **emission)

    return jax.vmap(of_one, in_axes=-1)(inputs)


def _solved(columns: dict[str, Any], options: Options, num_doublings: int | None) -> Array:
    """One solve for the bands that have the same kind of ground and of light. ``band batch``"""
    groups: dict[Any, list[str]] = {}
    for name in options.bands:
        kind = name in options.emitting, jax.tree.structure(columns[name].arguments["albedo"])
        groups.setdefault(kind, []).append(name)
    found = {}
    for (emits, _), names in groups.items():
        arguments = jax.tree.map(
            lambda *x: jnp.concatenate(x, axis=1), *(columns[b].arguments for b in names)
        )
        door = toa_radiance if emits else toa_brf
        number = _traced_doublings(options) if num_doublings is None else num_doublings
        terms = door(
            **arguments,
            num_streams=options.num_streams,
            num_modes=options.num_modes,
            num_doublings=number,
        )
        if num_doublings is None:
            thick = jnp.any(arguments["tau"] > TRACED_TAU, axis=-1)
            terms = jnp.where(thick, jnp.nan, terms)
        ends = np.cumsum([columns[b].weight.shape[1] for b in names])[:-1]
        for name, part in zip(names, jnp.split(terms, ends, axis=1), strict=True):
            found[name] = jnp.sum(columns[name].weight * part, axis=1)
    return jnp.stack([found[b] for b in options.bands])


def _traced_doublings(options: Options) -> int:
    """Enough for layers up to `TRACED_TAU`."""
    if options.num_streams <= _TRACED_STREAMS:
        return _TRACED_DOUBLINGS
    return sufficient_doublings(TRACED_TAU, _TRACED_MU, options.num_streams)
