"""What is made of the evaluated values afterwards, by the instrument and by products.

Radiances, reflectance factors, observations and pictures are pure functions of the value that the
operator gave of each band, so that they and their slopes by these values take no solving. They are
kept for the columns themselves and for a few `FIXED` ones, which saturate where no column does and
are of all satellites; what is a function of no column, as the ceilings, is in the row `CONSTANTS`.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..satellites import SATELLITES
from .fixed_columns import FIXED, fixed_columns
from .instrument_outputs import instrument_constants, instrument_outputs
from .product_outputs import PRODUCT_BANDS, product_constants, product_outputs
from .seen import Seen

CONSTANTS = "no column"
"""Row of the outputs that are functions of no column."""

UNITS = {
    "radiance": "W m-2 sr-1 um-1",
    "footprint_mean": "W m-2 sr-1 um-1",
    "image_mean": "W m-2 sr-1 um-1",
    "quantised_radiance": "W m-2 sr-1 um-1",
    "noise_deviation": "W m-2 sr-1 um-1",
    "saturation_radiance": "W m-2 sr-1 um-1",
    "brightness_temperature": "K",
    "observed_brightness_temperature": "K",
    "softened_brightness_temperature": "K",
}
"""Units by the first word of a name; all others are 1."""

PIECEWISE_CONSTANT = ("quantised_radiance",)
"""First words of the names of outputs whose slopes are 0 wherever there are any, and not kept."""


class Outputs(NamedTuple):
    """Outputs of columns and of fixed numbers, in NumPy and float64.

    Parameters
    ----------
    names, units
        Of the outputs.
    beside
        Names of the rows behind those of the columns: `FIXED` and `CONSTANTS`.
    value
        In `units`; NaN where a row has no such output. Axes row, output.
    slope
        Derivative of an output by the value of a band, in `units` over those of the band's
        quantity; NaN where there is none, or none is kept. Axes row, output, band.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    beside: tuple[str, ...]
    value: Float[np.ndarray, "row output"]
    slope: Float[np.ndarray, "row output band"]

    def part(self, columns: Sequence[int], bands: Sequence[int]) -> "Outputs":
        """Columns and bands at these places, with all that is beside the columns."""
        start = len(self.value) - len(self.beside)
        rows = [*columns, *range(start, len(self.value))]
        return self._replace(
            value=self.value[rows], slope=self.slope[np.ix_(rows, range(len(self.names)), bands)]
        )

    def named(self, names: Sequence[str], beside: Sequence[str]) -> "Outputs":
        """Outputs with these names, and these rows beside all the columns."""
        start = len(self.value) - len(self.beside)
        rows = [*range(start), *(start + self.beside.index(name) for name in beside)]
        kept = [self.names.index(name) for name in names]
        return Outputs(
            tuple(names),
            tuple(self.units[k] for k in kept),
            tuple(beside),
            self.value[np.ix_(rows, kept)],
            self.slope[np.ix_(rows, kept)],
        )


def in_common(first: Outputs, second: Outputs) -> tuple[Outputs, Outputs]:
    """The outputs, and the rows beside the columns, that both have, in the first one's order."""
    names = [name for name in first.names if name in set(second.names)]
    beside = [name for name in first.beside if name in set(second.beside)]
    return first.named(names, beside), second.named(names, beside)


def outputs_of(seen: Seen, satellite: str) -> Outputs:
    """Outputs of columns of which some bands are seen, and those beside them.

    Slopes are in forward mode. To be called with JAX in double precision.

    Parameters
    ----------
    seen
        Values of the columns, of one or more bands.
    satellite
        The columns' satellite; fixed ones are of all.
    """
    bands, num_columns = tuple(seen.value), len(seen.solar_zenith)
    every = seen.beside(fixed_columns(bands))
    table: dict[str, _Row] = {}
    for band in bands:
        table |= _by_its_own_band(every, band)
    table |= _by_every_band(every)
    # One small program instead of one for every operation.
    constants = jax.jit(lambda: instrument_constants(bands))() | product_constants(bands)
    names = (*table, *constants)
    value = np.full((num_columns + len(FIXED) + 1, len(names)), np.nan)
    slope = np.full((*value.shape, len(bands)), np.nan)
    for k, name in enumerate(names):
        if name in constants:
            value[-1, k] = constants[name]
            continue
        words = name.split(".")
        # What is of another satellite is of the fixed columns alone.
        first = num_columns if set(words) & (set(SATELLITES) - {satellite}) else 0
        number, by_band = (x[first:] for x in table[name])
        value[first:-1, k] = number
        if words[0] not in PIECEWISE_CONSTANT:
            slope[first:-1, k] = np.where(np.isnan(number)[:, None], np.nan, by_band)
    units = tuple(UNITS.get(name.partition(".")[0], "1") for name in names)
    return Outputs(names, units, (*FIXED, CONSTANTS), value, slope)


_Row = tuple[Float[np.ndarray, " column"], Float[np.ndarray, "column band"]]


def _by_its_own_band(seen: Seen, band: str) -> dict[str, _Row]:
    """Values and slopes of what is a function of one band alone."""

    def outputs(x: Float[Array, " column"]) -> dict[str, Float[Array, " column"]]:
        return instrument_outputs(seen._replace(value={**seen.value, band: x}), band)

    number = seen.value[band]
    # All columns at once: none depends on another.
    value, slope = jax.jvp(outputs, (number,), (jnp.ones_like(number),))
    place = np.array([name == band for name in seen.value])
    there = np.isfinite(number)  # some outputs are numbers where the column has no value
    return {
        name: (np.where(there, value[name], np.nan), np.asarray(slope[name])[:, None] * place)
        for name in value
    }


def _by_every_band(seen: Seen) -> dict[str, _Row]:
    """Values and slopes of what is a function of several bands."""

    def outputs(values: dict[str, Array]) -> dict[str, Float[Array | np.ndarray, " column"]]:
        return product_outputs(seen._replace(value=values))

    value, slopes = {}, {}
    for band in (x for x in seen.value if x in PRODUCT_BANDS):
        tangent = {
            name: (jnp.ones_like if name == band else jnp.zeros_like)(x)
            for name, x in seen.value.items()
        }
        value, slopes[band] = jax.jvp(outputs, (dict(seen.value),), (tangent,))
    table = {}
    for name, x in value.items():
        nothing = np.zeros(x.shape)
        by_band = [slopes[band][name] if band in slopes else nothing for band in seen.value]
        table[name] = np.asarray(x), np.stack(by_band, axis=-1)
    return table
