"""From the variables of a scenario to the state of every column."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from ..atmosphere import (
    Atmosphere,
    BackgroundAerosol,
    Fire,
    Gases,
    Hydrometeor,
    LiquidCloud,
    MiePlume,
    Plume,
    State,
)
from ..bands import GRASSO2013, check_bands
from ..files.mcd43 import KERNELS
from ..geometry import Geometry
from ..nomenclature import GROUND, PLUME
from ..radiance import THERMAL
from ..settings import streams_of_attributes
from .background import BY_BAND, QUANTITIES
from .checks import check_scenario
from .cloud_optics import cloud_optics_of, ice_optics_of
from .grounds import land_and_sea
from .species import classes_of, species_of
from .sun import spherical_somewhere

_GASES = ("vapour", "ozone")
_MOLE_FRACTIONS = ("carbon_dioxide", "methane", "nitrous_oxide")
_NO_FIRE = 300.0  # [K]


def column_states(
    scenario: xr.Dataset, bands: Sequence[str] = GRASSO2013, *, num_streams: int | None = None
) -> State:
    """State of every column of a scenario, or of a result at one time.

    Parameters
    ----------
    scenario
        A Dataset with the variables of a scenario and the dimensions y and x, or ``column`` in
        their place.
    bands
        Bands for which albedo and plumes are wanted.
    num_streams
        Streams by which anisotropic grounds are integrated (`land_and_sea`); None for those of the
        result, `settings.NUM_STREAMS` of a scenario.

    Returns
    -------
    State
        NumPy arrays with a leading column axis on every leaf; of columns y, x that of x runs
        faster. Gases, temperatures, hydrometeors, background aerosol, anisotropic grounds and fires
        are those that the scenario has, and clouds scatter as its attributes say
        (`cloud_optics_of`, `ice_optics_of`), through which a low sun, where there is one, shines
        likewise (`spherical_somewhere`).
    """
    bands = check_bands(bands, [str(band) for band in scenario["band"].values])
    reader = _Reader(scenario)
    angles = {
        name: np.radians(reader.values(f"{name}_angle"))
        for name in ("solar_zenith", "view_zenith", "relative_azimuth")
    }
    liquid = LiquidCloud(
        reader.values("liquid_mass_path", "layer"),
        reader.values("liquid_number_path", "layer"),
        cloud_optics_of(scenario),
    )
    plumes: dict[str, Plume | MiePlume] = {
        species: _plume(reader, species, bands) for species in species_of(scenario)
    }
    ice_optics = ice_optics_of(scenario)
    hydrometeors = {
        name: Hydrometeor(
            reader.values(f"{name}_mass_path", "layer"),
            reader.values(f"{name}_number_path", "layer"),
            ice_optics,
        )
        for name in classes_of(scenario)
    }
    gases = None
    if set(_GASES) <= set(scenario.variables):
        gases = Gases(
            **{name: reader.values(name, "layer") for name in _GASES},
            **{name: reader.values(name) for name in _MOLE_FRACTIONS},
        )
    atmosphere = Atmosphere(
        reader.values("pressure", "level"),
        reader.values("height", "level"),
        liquid,
        plumes,
        temperature=reader.optional("temperature", "level"),
        gases=gases,
        hydrometeors=hydrometeors,
        background=_background(reader, bands),
    )
    return State(
        atmosphere,
        _grounds(reader, bands, num_streams or streams_of_attributes(scenario.attrs)),
        Geometry(**angles, spherical=spherical_somewhere(scenario, angles["solar_zenith"])),
        surface_temperature=reader.optional("surface_temperature"),
        fire=_fire(reader) if "fire_fraction" in scenario else None,
    )


def states_of_result(
    result: xr.Dataset, bands: Sequence[str] = GRASSO2013, *, num_streams: int | None = None
) -> State:
    """The same of a result that was read back, whose numbers may be another program's.

    Raises
    ------
    InputError
        Where a number of a column is outside its range (`check_scenario`).
    """
    check_scenario(result)
    return column_states(result, bands, num_streams=num_streams)


def horizontal(dataset: xr.Dataset) -> dict[str, int]:
    """Horizontal dimensions of a Dataset and their sizes: y and x, or column."""
    dims = ("column",) if "column" in dataset.dims else ("y", "x")
    return {dim: dataset.sizes[dim] for dim in dims}


class _Reader:
    """Reads variables of a Dataset with one leading column axis.

    Its NumPy arrays stand where states declare JAX's: the operator's door takes both.
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset
        self._horizontal = horizontal(dataset)

    def values(self, name: str, *dims: str, band: str | None = None) -> Any:
        """A variable as (column, *dims), repeated where it is the same in all columns."""
        array = self._dataset[name]
        if band is not None:
            array = array.sel(band=band)
        missing = {d: n for d, n in self._horizontal.items() if d not in array.dims}
        array = array.expand_dims(missing).transpose(*self._horizontal, *dims)
        # Files keep most variables in single precision; what is computed of them is not.
        values = np.asarray(array.values, np.float64)
        return values.reshape(-1, *array.shape[len(self._horizontal) :])

    def has(self, name: str) -> bool:
        """Whether there is such a variable."""
        return name in self._dataset

    def optional(self, name: str, *dims: str) -> Any:
        """As `values`, or None where there is no such variable."""
        return self.values(name, *dims) if name in self._dataset else None

    def by_band(self, name: str, bands: tuple[str, ...]) -> dict[str, Any]:
        """A variable in each band, (column,)."""
        return {band: self.values(name, band=band) for band in bands}


def _grounds(reader: _Reader, bands: tuple[str, ...], num_streams: int) -> dict[str, Any]:
    """Albedo by band, or where the scenario has anisotropic grounds those of all columns."""
    found = reader.by_band("surface_albedo", bands)
    if not any(reader.has(name) for name in GROUND):
        return found
    none = np.zeros_like(reader.values("solar_zenith_angle"))
    water, wind = (reader.optional(name) for name in ("water_share", "wind_speed"))
    water, wind = (none if x is None else x for x in (water, wind))
    for band in bands:
        if band not in THERMAL:
            weights = {x: reader.values(x, band=band) if reader.has(x) else none for x in KERNELS}
            found[band] = land_and_sea(band, found[band], weights, water, wind, num_streams)
    return found


def _fire(reader: _Reader) -> Fire:
    fraction, hot = (reader.values(f"fire_{name}") for name in ("fraction", "temperature"))
    # Of a fire that is none nothing is seen, but a number has to be there.
    temperature: Any = np.where(fraction > 0, hot, _NO_FIRE)
    return Fire(fraction, temperature)


def _background(reader: _Reader, bands: tuple[str, ...]) -> BackgroundAerosol | None:
    if not reader.has("background_aod_550"):
        return None
    fields: dict[str, Any] = {
        name: reader.by_band(f"background_{name}", bands)
        if name in BY_BAND
        else reader.values(f"background_{name}")
        for name in QUANTITIES
    }
    return BackgroundAerosol(**fields)


def _plume(reader: _Reader, species: str, bands: tuple[str, ...]) -> Plume:
    quantities: dict[str, Any] = {
        quantity: reader.by_band(f"{species}_{quantity}", bands)
        if entry.dims == ("band",)
        else reader.values(f"{species}_{quantity}")
        for quantity, entry in PLUME.items()
    }
    return Plume(**quantities)
