"""The scenario: one time of a scene as the operator sees it, and the truth of its simulation."""

import warnings
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from ..atmosphere import ICE_OPTICS, LIQUID_OPTICS
from ..bands import BANDS, GRASSO2013, check_bands
from ..files import InputError
from ..files.netcdf import cf_attributes
from ..nomenclature import QUALITY_FLAGS, variable
from ..optics import ALL_GASES
from ..radiance import FIRE_BANDS, THERMAL
from ..satellites import SATELLITES, gas_fit_covers
from .account import (
    condensate_account,
    condensate_warnings,
    droplet_account,
    model_attributes,
    negative_account,
    pressure_range,
)
from .albedo import surface_albedo
from .angles import SATELLITE_LONGITUDE, angle_flags, find_angles
from .background import background_attribute, background_variables
from .checks import check_scenario
from .cloud_optics import check_cloud_optics, check_ice_optics, optics_attributes
from .column_air import complete_air, completion_heights, highest_top
from .droplet_number import DropletNumber
from .emissivity import Emissivity
from .fires import burning_columns
from .gases import air_fields, check_gases, gases_attribute, has_hot_ground
from .grounds import OceanWind, anisotropic_fields
from .hydrometeors import Hydrometeors, hydrometeor_paths
from .land import LandAlbedo
from .snow_and_ice import IceAlbedo
from .species import PlumeSpecification, plume_variables
from .standard_profile import nearest_standard_atmosphere, standard_profile

_AIR_ABOVE = "US Standard Atmosphere 1976, scaled to the pressure at the model's top"


def scenario(
    model: xr.Dataset,
    *,
    albedo: xr.Dataset | None = None,
    ocean_albedo: float | None = None,
    ocean_wind: OceanWind | None = None,
    land_albedo: LandAlbedo | None = None,
    sea_ice_albedo: IceAlbedo | None = None,
    snow_albedo: IceAlbedo | None = None,
    emissivity: Emissivity | None = None,
    plumes: Mapping[str, PlumeSpecification] | None = None,
    satellite: str = "GOES-16",
    satellite_longitude: float | None = None,
    bands: Sequence[str] = GRASSO2013,
    gases: Sequence[str] = ALL_GASES,
    hydrometeors: Sequence[str] | None = None,
    microphysics: str | None = None,
    droplet_number: DropletNumber | None = None,
    cloud_optics: str = LIQUID_OPTICS[0],
    ice_optics: str = ICE_OPTICS[0],
    flat_sun: bool = False,
    standard_atmosphere: str | None = None,
    added_heights: Sequence[float] | None = None,
    fires: xr.Dataset | None = None,
    hot_ground: bool | None = None,
    background_aerosol: float | None = None,
    rows: slice = slice(None),
) -> xr.Dataset:
    """Specify a scene, or a block of its rows, from a model's output.

    The columns are completed to the top of the atmosphere (`complete_air`), condensate becomes
    paths (`hydrometeor_paths`), the ground gets its albedo (`surface_albedo`), sun and satellite
    their places (`find_angles`), and plumes and fires are added (`burning_columns`); where gases
    absorb or something shines, so are gases (`gas_amounts`) and temperatures
    (`level_temperature`). Condensate that is not
    simulated is warned of.

    Parameters
    ----------
    model
        One time of a model Dataset, whole or a block of rows.
    albedo
        Albedo of the ground as `files.read_mcd43a1` returns it; with weights of kernels land
        reflects by them (`surface.RossLi`), without it is Lambertian. [-]
    ocean_albedo
        Albedo of water, or of all that `albedo` lacks where the model has no land mask, in all
        bands but C07. [-]
    ocean_wind
        Wind over open water, a number [m s-1] or ``"model"`` for the model's own, by which it
        glints (`surface.Ocean`), in all bands but C07; in place of `ocean_albedo`.
    land_albedo
        Albedo of land that has none of `albedo`, in all bands but C07: a number, or ``"model"`` for
        the model's own, of all sunlight. [-]
    sea_ice_albedo, snow_albedo
        Of sea ice without snow, and of snow, where the model has them: a number for all bands but
        C07, or a type in `surface.SNOW_AND_ICE_ALBEDO`. Columns with sea ice have no albedo without
        it, those with snow that of the file; both are warned of. [-]
    emissivity
        Of the ground in C07, needed there; see `thermal_albedo`.
    plumes
        Plumes by species, in the whole scene.
    satellite, satellite_longitude
        Name of the satellite, and where it stands if not at its `SATELLITE_LONGITUDE`. [degree]
    bands
        Bands to be simulated.
    gases
        Gases that absorb, of `optics.ALL_GASES`; ``()`` leaves them out.
    hydrometeors
        Classes of condensate to be simulated beside cloud water, of `CLASSES`; None for those that
        this block has. The blocks of a scene need the same.
    microphysics
        Scheme of `abi_operator.microphysics` by which the model's condensate is understood; None
        for the model's own.
    droplet_number
        Number of droplets where the model has none; None for that of the microphysics
        scheme, or general ones where it has none (`DropletNumber`). [m-3]
    cloud_optics
        By which theory liquid cloud scatters: ``"mie"``, or ``"mitchell"`` for that of Grasso et
        al. (2013); see `LiquidCloud`.
    ice_optics
        Whose asymmetry factor crystals have: ``"fu"``, smooth columns, or ``"rough"``; see
        `Hydrometeor`.
    flat_sun
        Whether a low sun shines through flat layers, and not through those of a sphere from a solar
        zenith angle of 65 degrees on (`sun_secant`).
    standard_atmosphere
        Name of the one that gives ozone, and what is above the model; None for the nearest
        (`nearest_standard_atmosphere`). The blocks of a scene need the same.
    added_heights
        Heights of levels to add above the model's top; None for `completion_heights` of this block.
        The blocks of a scene need the same. [m]
    fires
        Fires of the whole scene, as `files.read_fires` returns them; None if there is none. The
        blocks of a scene need the same.
    hot_ground
        Whether some ground of the scene shines in C05 and C06 without a fire, whatever other bands
        there are; None for that of this block (`has_hot_ground`). The blocks of a scene need the
        same.
    background_aerosol
        Optical depth at 550 nm of aerosol that is everywhere (`optics.background_aerosol`), None
        for none. [-]
    rows
        The rows of the scene that `model` holds.

    Returns
    -------
    xarray.Dataset
        Variables of `nomenclature.SCENARIO` and of the plumes and, where they are simulated, of
        `nomenclature.OPTIONAL`, `nomenclature.GROUND`, `nomenclature.FIRE` and of the
        hydrometeors; coordinates ``band``, ``band_wavelength`` and ``time``.
        Attributes account for what was assumed, completed and left out (`add_accounts`).

    Raises
    ------
    InputError
        Where albedo or emissivity is missing or does not cover the scene, a number of particles
        cannot be assumed, more burns than a column has ground, the gases of a band are not known of
        the satellite, optics of clouds have no such name, or a value is out of its range.
    """
    bands, gases = check_bands(bands), check_gases(tuple(gases))
    check_cloud_optics(cloud_optics)
    check_ice_optics(ice_optics)
    check_absorption(satellite, bands, gases)
    if added_heights is None:
        added_heights = completion_heights(highest_top(model))
    pressure, height, top_pressure = complete_air(model, tuple(added_heights))
    condensate = hydrometeor_paths(
        model,
        droplet_number,
        classes=None if hydrometeors is None else tuple(hydrometeors),
        microphysics=microphysics,
    )
    ground, ground_sources = surface_albedo(
        model,
        bands,
        albedo,
        ocean_albedo,
        emissivity,
        ocean_wind=ocean_wind,
        land_albedo=land_albedo,
        sea_ice_albedo=sea_ice_albedo,
        snow_albedo=snow_albedo,
    )
    by_direction, of_grounds = anisotropic_fields(
        model, bands, albedo, ocean_wind, snow_has_albedo=snow_albedo is not None
    )
    position = {name: model[name].values for name in ("latitude", "longitude")}
    time = model["time"].values
    if satellite_longitude is None:
        satellite_longitude = SATELLITE_LONGITUDE[satellite]
    angles = find_angles(time, **position, satellite_longitude=satellite_longitude)
    no_albedo = np.uint8(QUALITY_FLAGS["no_albedo"]) * np.isnan(ground).any(axis=0)
    standard = standard_profile(
        standard_atmosphere or nearest_standard_atmosphere(position["latitude"], time)
    )
    if hot_ground is None:
        hot_ground = has_hot_ground(model)
    emits = bool(set(bands) & set(FIRE_BANDS if hot_ground or fires is not None else THERMAL))
    of_air, assumed = air_fields(model, height, standard, gases, emits=emits)
    if fires is not None:
        burning = burning_columns(model, fires, first_row=rows.start or 0)
        of_air |= {"fire_fraction": burning.fraction, "fire_temperature": burning.temperature}
        assumed |= burning.attributes
    fields = {
        "pressure": pressure,
        "height": height,
        "surface_albedo": ground,
        "solar_zenith_angle": angles.solar_zenith,
        "view_zenith_angle": angles.view_zenith,
        "relative_azimuth_angle": angles.relative_azimuth,
        "quality_flag": angle_flags(angles) | no_albedo,
    }
    fields |= by_direction | of_air | _paths(condensate, len(added_heights))
    dataset = _dataset(fields, position, bands, time)
    for species, specification in (plumes or {}).items():
        dataset = dataset.assign(plume_variables(species, specification, bands, rows))
    if background_aerosol is not None:
        dataset = dataset.assign(background_variables(background_aerosol, bands))
        assumed |= background_attribute(background_aerosol)
    check_scenario(dataset, first_row=rows.start or 0)
    for sentence in condensate_warnings(condensate):
        warnings.warn(sentence, UserWarning, stacklevel=2)
    return dataset.assign_attrs(
        model_attributes(model)
        | {"satellite": satellite, "satellite_longitude": satellite_longitude}
        | {"gases": gases_attribute(gases), **optics_attributes(cloud_optics, ice_optics)}
        | {"sun_path": "flat" if flat_sun else "spherical"}
        | {"air_above_model": _AIR_ABOVE, "num_levels_above_model": len(added_heights)}
        | assumed
        | ground_sources
        | of_grounds
        | pressure_range(top_pressure)
        | droplet_account(condensate, model)
        | condensate_account(condensate)
        | negative_account(model)
    )


def check_absorption(satellite: str, bands: Sequence[str], gases: Sequence[str]) -> None:
    """Raise `InputError` where absorption in a band is not known of a satellite, or it is none."""
    if satellite not in SATELLITES:
        raise InputError(f"satellite {satellite!r} is not known; choose from {list(SATELLITES)}.")
    for band in bands:
        if gases and not gas_fit_covers(satellite, band):
            raise InputError(
                f"the absorption by gases in {band} is not known of {satellite}; simulate without "
                "gases, without this band, or of another satellite."
            )


def _dataset(
    fields: dict[str, np.ndarray],
    position: dict[str, np.ndarray],
    bands: Sequence[str],
    time: np.ndarray,
) -> xr.Dataset:
    """Fields by name, with their coordinates and what the conventions want to be said of them."""
    wavelengths = [BANDS[band].wavelength_um for band in bands]
    return xr.Dataset(
        {name: (_dims(name), field, cf_attributes(name)) for name, field in fields.items()},
        coords={name: (_dims(name), x, cf_attributes(name)) for name, x in position.items()}
        | {
            "band": ("band", list(bands), cf_attributes("band")),
            "band_wavelength": ("band", wavelengths, cf_attributes("band_wavelength")),
            "time": time,
        },
    )


def _paths(condensate: Hydrometeors, num_added: int) -> dict[str, np.ndarray]:
    """Paths of condensate, in the layers of the model under as many empty ones as were added."""
    fields = {}
    for name, paths in condensate.paths.items():
        word = "liquid" if name == "cloud" else name
        for quantity in ("mass", "number"):
            layers = getattr(paths, quantity)
            nothing = np.zeros((num_added, *layers.shape[1:]))
            fields[f"{word}_{quantity}_path"] = np.concatenate([nothing, layers])
    return fields


def _dims(name: str) -> tuple[str, ...]:
    entry = variable(name)
    assert entry is not None
    return entry.dims
