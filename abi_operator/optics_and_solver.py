"""Optics and solver in one program, for states with values and for states without.

How often the solver doubles its layers is a property of a program for slopes and chosen from the
thickest layer of all columns. Its optical depth is read before the program is: at the door, in the
rules of derivatives and in that of `jax.vmap`, all of which know the values that they transform
(`machine.door`). Inside `jax.jit` or a loop nobody does, and the slopes are right for layers up to
`TRACED_TAU`: those of columns with a thicker one come back as NaN, and so do the values beside
them, unless the layer lets no light through anyway. A program for values alone doubles each layer
as it needs, whoever can read it (`solver.method.doublings`).
"""

from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .band_columns import HARMLESS_ZENITH, columns_of_bands
from .bands_of_states import Inputs, Options, of_tile, tile_size, with_slopes
from .geometry import is_up
from .machine.door import Leaves, enter
from .machine.sizes import chunks_of_states, chunks_to_read
from .plume_edges import with_plume_edges
from .solver import sufficient_doublings


def solve(inputs: Inputs, options: Options) -> Float[Array, "*batch band"]:
    """Reflectance of each column in each band, or radiance in those that emit. [-], [W m-2 ...]

    Parameters
    ----------
    inputs, options
        What the columns are and how to solve them. Without a number of doublings there is no limit
        to those of values (see above).
    """
    if options.settings.plume_edges:
        edged = replace(inputs.state, atmosphere=_edged(inputs.state.atmosphere))
        inputs = inputs._replace(state=edged)
    # The program is of levels, whoever made them.
    options = options._replace(settings=options.settings._replace(plume_edges=None))
    leaves, structure = jax.tree.flatten(inputs)
    num_axes = inputs.state.geometry.solar_zenith.ndim
    own_axes = tuple(x.ndim - num_axes for x in leaves)
    return enter(_Program(structure, options, own_axes), leaves)


_edged = jax.jit(with_plume_edges)


class _Program(NamedTuple):
    """`machine.program.Program` of the leaves of `Inputs`, which for slopes reads the layers."""

    structure: Any
    options: Options
    own_axes: tuple[int, ...]

    def known(self, leaves: Leaves, what: Any) -> "_Program":
        settings = self.options.settings
        if what == "value" or settings.num_doublings is not None:
            return self
        geometry = jax.tree.unflatten(self.structure, leaves).state.geometry
        angles = [np.asarray(x) for x in (geometry.solar_zenith, geometry.view_zenith)]
        if angles[0].size == 0:
            return self._doubling(0)
        depths = enter(_Depths(self.structure, self.options, self.own_axes), leaves)
        steepest = (np.max(np.where(is_up(x), x, HARMLESS_ZENITH)) for x in angles)
        cosine = max(float(np.cos(max(steepest))), float(np.finfo(np.float32).eps))
        depths = np.asarray(depths)  # columns that are not finite are NaN, however they are solved
        thickest = float(np.max(depths, where=np.isfinite(depths), initial=0))
        known = thickest, cosine, settings.num_streams, leaves[0].dtype
        return self._doubling(sufficient_doublings(*known))

    def _doubling(self, number: int) -> "_Program":
        settings = self.options.settings._replace(num_doublings=number)
        return self._replace(options=self.options._replace(settings=settings))

    def unknown(self, what: Any) -> "_Program":
        return self

    def own_result(self, leaves: Leaves) -> Any:
        return jax.ShapeDtypeStruct((len(self.options.bands),), leaves[0].dtype)

    def widths(self, leaves: Leaves, what: Any) -> tuple[int, ...]:
        return chunks_of_states(tile_size(leaves, self.structure, self.options))

    def tile(self, leaves: Leaves, what: Any) -> int:
        return tile_size(leaves, self.structure, self.options)

    @property
    def need(self) -> None:
        return None

    @property
    def at_once(self) -> None:
        return None

    def value(self, leaves: Leaves) -> Array:
        return of_tile(leaves, self.structure, self.options)

    def value_and_slopes(
        self, leaves: Leaves, wanted: tuple[bool, ...]
    ) -> tuple[Array, list[Array]]:
        return with_slopes(leaves, self.structure, self.options, wanted)


class _Depths(NamedTuple):
    """The same of the largest optical depth of any layer of a column, in any band. [-]

    Programs are found again by what they are, and tuples of the same entries are equal, of whatever
    class: what is wanted is an entry, so that nobody who asks for a reflectance gets depths.
    """

    structure: Any
    options: Options
    own_axes: tuple[int, ...]
    wanted: str = "depths"

    def known(self, leaves: Leaves, what: Any) -> "_Depths":
        return self

    def unknown(self, what: Any) -> "_Depths":
        return self

    def own_result(self, leaves: Leaves) -> Any:
        return jax.ShapeDtypeStruct((), leaves[0].dtype)

    def widths(self, leaves: Leaves, what: Any) -> tuple[int, ...]:
        return 1, *chunks_to_read()

    def tile(self, leaves: Leaves, what: Any) -> int:
        return chunks_to_read()[-1]

    @property
    def need(self) -> None:
        return None

    @property
    def at_once(self) -> None:
        return None

    def value(self, leaves: Leaves) -> Array:
        state = jax.tree.unflatten(self.structure, leaves).state
        settings = self.options.settings
        num_moments = settings.num_streams + 1
        groups = columns_of_bands(state, self.options.bands, settings.gases, num_moments)
        deepest = [jnp.max(x.arguments["tau"], axis=(0, 1)) for x in groups]
        return jnp.max(jnp.stack(deepest), axis=0)

    def value_and_slopes(self, leaves: Leaves, wanted: tuple[bool, ...]) -> Any:
        raise TypeError("what is read to choose a program has no derivative.")
