"""From a scenario to the reflectances that the imager would see."""

from collections.abc import Sequence
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..atmosphere import Atmosphere, State
from ..bands import BANDS, GRASSO2013, check_bands
from ..files.netcdf import cf_attributes
from ..nomenclature import QUALITY_FLAGS, variable
from ..optics import aerosol, liquid_cloud, rayleigh
from ..reflectance import brf
from .chunks import map_chunks
from .columns import column_states, horizontal

# Pixels with one of these flags are not solved.
_UNSOLVED = QUALITY_FLAGS["night"] | QUALITY_FLAGS["no_albedo"] | QUALITY_FLAGS["out_of_sight"]


def simulate(
    scenario: xr.Dataset,
    *,
    bands: Sequence[str] | None = None,
    num_streams: int = 8,
    chunk_columns: int = 1024,
) -> xr.Dataset:
    """Simulate the reflectances of a scenario.

    Parameters
    ----------
    scenario
        A scenario with the dimensions y and x, or ``column`` in their place.
    bands
        Bands to simulate; None for those of the scenario.
    num_streams
        Streams of the solver; see `solver.toa_brf`.
    chunk_columns
        Columns that are solved together. [-]

    Returns
    -------
    xarray.Dataset
        The scenario with the variables of `nomenclature.RESULT` and optical depths of its plumes.
        By night the reflectance factor is 0 and brf NaN; without albedo, and out of the
        satellite's sight, both are NaN.
    """
    if bands is None:
        bands = tuple(str(band) for band in scenario["band"].values)
    bands = check_bands(bands, GRASSO2013)
    states = column_states(scenario, bands)
    num_columns = len(states.geometry.solar_zenith)
    fields = map_chunks(
        partial(_optical_depths, bands=bands), states.atmosphere, num_columns, chunk_columns
    )
    flags = scenario["quality_flag"].values.astype(np.uint8).reshape(-1)
    fields |= _reflectances(states, flags, bands, num_streams, chunk_columns)
    shape = horizontal(scenario)
    result = scenario.sel(band=list(bands))
    for name, values in fields.items():
        entry = variable(name)
        own_dims = ("band",) if entry is not None and "band" in entry.dims else ()
        by_column = np.moveaxis(values, 0, -1)
        array = by_column.reshape(*by_column.shape[:-1], *shape.values())
        result[name] = ((*own_dims, *shape), array, cf_attributes(name))
    return result.assign_attrs(num_streams=num_streams)


def _reflectances(
    states: State, flags: np.ndarray, bands: tuple[str, ...], num_streams: int, chunk_columns: int
) -> dict[str, np.ndarray]:
    """Reflectance factor and brf (column, band) of the columns that can be solved."""
    solved = np.flatnonzero((flags & _UNSOLVED) == 0)
    values = np.full((len(flags), len(bands)), np.nan)
    if solved.size:
        values[solved] = map_chunks(
            partial(brf, bands=bands, num_streams=num_streams),
            jax.tree.map(lambda x: x[solved], states),
            solved.size,
            chunk_columns,
        )
    factor = np.cos(states.geometry.solar_zenith)[:, None] * values
    in_sight = (flags & QUALITY_FLAGS["out_of_sight"]) == 0
    factor[((flags & QUALITY_FLAGS["night"]) > 0) & in_sight] = 0.0
    return {"reflectance_factor": factor, "brf": values}


@partial(jax.jit, static_argnames="bands")
def _optical_depths(atmosphere: Atmosphere, bands: tuple[str, ...]) -> dict[str, jax.Array]:
    """Optical depths of air, cloud and plumes (column, band), and of plumes at 550 nm (column)."""

    def depths(column: Atmosphere) -> dict[str, jax.Array]:
        producers = {"rayleigh": rayleigh, "liquid": liquid_cloud} | {
            species: partial(_aerosol, species=species) for species in column.plumes
        }
        by_band = {
            f"{name}_optical_depth": jnp.stack(
                [producer(column, BANDS[b]).tau.sum() for b in bands]
            )
            for name, producer in producers.items()
        }
        return by_band | {f"{name}_aod_550": p.aod_550 for name, p in column.plumes.items()}

    return jax.vmap(depths)(atmosphere)


def _aerosol(column, band, *, species: str):
    return aerosol(column, species, band)
