"""From a scenario to the radiances and reflectances that the imager would see."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..atmosphere import Atmosphere, State
from ..bands import BANDS, check_bands
from ..files import InputError, Parts
from ..files.netcdf import cf_attributes
from ..machine.chunks import map_chunks
from ..machine.listening import Listener, listening
from ..machine.sizes import chunks_to_read
from ..nomenclature import OPTIONAL_RESULT, RESULT, variable
from ..optics import aerosol, background, hydrometeor, liquid_cloud, outside_fitted_range, rayleigh
from ..quality import flags_from
from ..radiance import THERMAL
from ..settings import NUM_STREAMS
from .angles import sun_distance
from .cloud_optics import cloud_optics_of, ice_optics_of, optics_attributes
from .columns import column_states, horizontal
from .gases import check_gases, gases_attribute, gases_of
from .kinds_of_ground import ground_flags
from .light import Unheard, light
from .parts import solved_or_found
from .species import classes_of, species_of
from .streams import most_streams, streams_of
from .sun import sun_path_of

ERROR_BUDGET = 1e-3
"""Relative error of the reflectance of scenes that is spent on speed, unless another is asked for:
a third of the instrument's noise over a white ground, and less of it over darker ones. [-]"""


def simulate(
    scenario: xr.Dataset,
    *,
    bands: Sequence[str] | None = None,
    gases: Sequence[str] | None = None,
    num_streams: float = NUM_STREAMS,
    error_budget: float | None = ERROR_BUDGET,
    listener: Listener | None = None,
    parts: Parts | None = None,
) -> xr.Dataset:
    r"""Simulate the radiances and reflectances of a scenario.

    In C07 sunlight and emission are one radiance, and so they are in C05 and C06 where it burns
    or the ground is as hot (`light`). Elsewhere radiance follows from the reflectance factor,
    :math:`L = \rho E_0 / (\pi d^2)`, with the solar irradiance of the scenario's satellite and the
    distance of the sun at its time (1 AU where it has none). Clouds
    scatter, and a low sun shines through layers, as the scenario says (`cloud_optics_of`,
    `ice_optics_of`, `sun_path_of`).

    Parameters
    ----------
    scenario
        A scenario with the dimensions y and x, or ``column`` in their place.
    bands
        Bands to simulate; None for those of the scenario.
    gases
        Gases that absorb; None for those of the scenario (`gases_of`).
    num_streams, error_budget
        Streams of the solver, or, below 1, the relative error that they may leave in 99 of 100
        columns, by which each has as many as columns of its kind need (`scene.streams`); and the
        relative error that may be made for speed on top of that, None for none. See
        `solver.Settings`.
    listener
        Is told of columns as they are solved: all that can be in the bands without emission, then
        all that can be in each of the others.
    parts
        Where to find what an earlier run of the same has solved, and to keep what this one has.

    Returns
    -------
    xarray.Dataset
        The scenario with the variables of `nomenclature.RESULT` and optical depths of its plumes
        and hydrometeors; with C07 brightness temperature; and the share of hydrometeors' optical
        depth at sizes for which optics were not fitted, by which pixels are flagged
        ``outside_fit``. C07 has no reflectance factor and no brf, which are NaN. By night the
        reflectance factor is 0 and brf NaN; out of the satellite's sight all is NaN, and so it is
        by day, and C07 by night, where any of the scenario's bands has no albedo. The reflectance
        factor of a fire is that of its radiance, by night too.

    Raises
    ------
    InputError
        Where gases are asked for that the scenario does not have.
    ValueError
        Where more streams would be needed than `scene.streams` knows of.
    """
    if bands is None:
        bands = tuple(str(band) for band in scenario["band"].values)
    bands = check_bands(bands)
    gases = gases_of(scenario) if gases is None else check_gases(tuple(gases))
    if gases and "vapour" not in scenario:
        raise InputError(f"the scenario has no gases of which {', '.join(gases)} could absorb.")
    most = most_streams(num_streams)
    states = column_states(scenario, bands, num_streams=most)
    satellite = str(scenario.attrs.get("satellite", "GOES-16"))
    distance = sun_distance(scenario["time"].values) if "time" in scenario.variables else 1.0
    settings = {"gases": gases, "num_streams": num_streams, "error_budget": error_budget}

    def flags_with(depths: dict[str, np.ndarray]) -> np.ndarray:
        flags = scenario["quality_flag"].values.astype(np.uint8).reshape(-1)
        return flags | _flags(states, depths["outside_fitted_range"])

    def solve() -> dict[str, np.ndarray]:
        with listening(None if listener is None else Unheard(listener)):
            depths = _optical_depths(states.atmosphere, bands)
        flags, streams = flags_with(depths), streams_of(states.atmosphere, num_streams)
        others = {name: value for name, value in settings.items() if name != "num_streams"}
        return depths | light(states, flags, streams, bands, satellite, distance, others, listener)

    fields = solved_or_found(parts, scenario, {"bands": bands, **settings}, solve)
    flags = flags_with(fields)
    shape = horizontal(scenario)
    result = scenario.sel(band=list(bands))
    for name, values in fields.items():
        entry = variable(name)
        own_dims = ("band",) if entry is not None and "band" in entry.dims else ()
        by_column = np.moveaxis(values, 0, -1)
        array = by_column.reshape(*by_column.shape[:-1], *shape.values())
        result[name] = ((*own_dims, *shape), array, cf_attributes(name))
    known = result["quality_flag"]
    result["quality_flag"] = known.dims, flags.reshape(known.shape), known.attrs
    # Of NetCDF's attributes none is no number: nothing is left out.
    left_out = {} if error_budget is None else {"error_budget": error_budget}
    how = {"num_streams": most, "gases": gases_attribute(gases)}
    how |= {"streams_error": num_streams} if num_streams < 1 else {}
    clouds = optics_attributes(cloud_optics_of(scenario), ice_optics_of(scenario))
    return result.assign_attrs(how | clouds | left_out | {"sun_path": sun_path_of(scenario)})


def variables_of_result(scenario: xr.Dataset) -> set[str]:
    """Names of all variables that `simulate` will return of a scenario in its bands."""
    plumes, others = species_of(scenario), list(classes_of(scenario))
    others += ["background"] if "background_aod_550" in scenario else []
    names = {*map(str, scenario.variables), *RESULT}
    names |= {f"{name}_optical_depth" for name in (*plumes, *others)}
    names |= {f"{name}_aod_550" for name in plumes}
    thermal = set(THERMAL) & set(map(str, scenario["band"].values))
    return names | (set(OPTIONAL_RESULT) if thermal else set())


def _flags(states: State, share_outside: np.ndarray) -> np.ndarray:
    """Bits of ``quality_flag`` (column) of the states themselves, as `quality_flags` has them, but
    for those of grounds (`ground_flags`).
    """
    sun, view = states.geometry.solar_zenith, states.geometry.view_zenith
    return flags_from(np.asarray(sun), np.asarray(view), share_outside, ground_flags(states))


def _optical_depths(atmosphere: Atmosphere, bands: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Optical depths of all that scatters (column, band), and of plumes at 550 nm (column)."""
    leaves, structure = jax.tree.flatten(atmosphere)
    function = partial(_depths_of_chunk, structure=structure, bands=bands)
    own, batch = [True] * len(leaves), (len(atmosphere.pressure),)
    found = map_chunks(function, (structure, bands), leaves, own, batch, chunks_to_read())
    return jax.tree.map(np.asarray, found)


@partial(jax.jit, static_argnames=("structure", "bands"))
def _depths_of_chunk(leaves: list[jax.Array], structure: Any, bands: tuple[str, ...]) -> Any:
    def depths(column: Atmosphere) -> dict[str, jax.Array]:
        producers = {"rayleigh": rayleigh, "liquid": liquid_cloud}
        if column.background is not None:
            producers["background"] = background
        producers |= {name: partial(_aerosol, species=name) for name in column.plumes}
        producers |= {name: partial(_hydrometeor, name=name) for name in column.hydrometeors}
        by_band = {
            f"{name}_optical_depth": jnp.stack(
                [producer(column, BANDS[b]).tau.sum() for b in bands]
            )
            for name, producer in producers.items()
        }
        outside = [outside_fitted_range(column, BANDS[b]) for b in bands]
        by_band["outside_fitted_range"] = jnp.stack(outside)
        return by_band | {f"{name}_aod_550": p.aod_550 for name, p in column.plumes.items()}

    return jax.vmap(depths)(jax.tree.unflatten(structure, leaves))


def _aerosol(column, band, *, species: str):
    return aerosol(column, species, band)


def _hydrometeor(column, band, *, name: str):
    return hydrometeor(column, name, band)
