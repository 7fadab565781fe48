"""What to simulate, from which files: all that a command line asks."""

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

from .atmosphere import ICE_OPTICS, LIQUID_OPTICS
from .bands import GRASSO2013
from .files import InputError
from .files.stored import ALL
from .optics import ALL_GASES
from .radiance import THERMAL
from .scene import ERROR_BUDGET, DropletNumber, Emissivity, IceAlbedo, LandAlbedo, OceanWind
from .settings import NUM_STREAMS

PLUME_AOD = 2.0
"""Optical depth at 550 nm of a plume where its picture is white, unless another is given. [-]"""


class Species(StrEnum):
    """Plumes with published optics."""

    SMOKE = "smoke"
    ASH = "ash"


class Request(NamedTuple):
    """What to simulate, from which files.

    Parameters
    ----------
    wrf
        Output of WRF, one file or more, as `files.open_wrf_series` takes them.
    albedo
        MODIS albedo, as `files.read_mcd43a1` takes it.
    ocean_albedo
        Albedo of water, in all bands. [-]
    land_kernels
        Whether land reflects by the kernels of the albedo file.
    ocean_wind
        As `scene.scenario` takes it, in place of `ocean_albedo`.
    plume
        Picture of a plume, as `files.read_plume` takes it.
    plume_species, plume_aod
        What the plume is made of, None for smoke; optical depth at 550 nm where the picture is
        white, None for `PLUME_AOD`. [-]
    bands, broadband
        Bands to simulate, and whether broadband albedo may stand in for a missing one.
    emissivity
        Of the ground in C07, as `scene.scenario` takes it.
    land_albedo, sea_ice_albedo, snow_albedo
        As `scene.scenario` takes them. [-]
    fires
        Table of fires, as `files.read_fires` takes it.
    gases, hydrometeors, microphysics, droplet_number, cloud_optics, ice_optics, flat_sun
        As `scene.scenario` takes them; of hydrometeors, None means all that the model has.
    background_aerosol
        Optical depth at 550 nm of aerosol beside the plume, None for none. [-]
    satellite, satellite_longitude
        Name; degrees, east positive, where it does not stand at its usual place.
    time
        Index or name of the times to simulate, as `files.WrfSeries.find` takes it; None for all.
    num_streams, error_budget
        Streams of the solver or the relative error that they may leave, and that which may be made
        for speed, as `scene.simulate` takes them.
    variables
        What the result keeps, as `files.stored` takes it.
    rayleigh_correction
        Whether the air is taken out of pictures in natural colours.
    command
        What was typed, for the result's history.
    """

    wrf: Path | Sequence[Path]
    albedo: Path | None = None
    ocean_albedo: float | None = None
    plume: Path | None = None
    plume_species: Species | None = None
    plume_aod: float | None = None
    fires: Path | None = None
    land_kernels: bool = False
    ocean_wind: OceanWind | None = None
    bands: tuple[str, ...] = GRASSO2013
    broadband: bool = False
    emissivity: Emissivity | None = None
    gases: tuple[str, ...] = ALL_GASES
    hydrometeors: tuple[str, ...] | None = None
    microphysics: str | None = None
    droplet_number: DropletNumber | None = None
    cloud_optics: str = LIQUID_OPTICS[0]
    ice_optics: str = ICE_OPTICS[0]
    flat_sun: bool = False
    background_aerosol: float | None = None
    satellite: str = "GOES-16"
    satellite_longitude: float | None = None
    time: int | str | None = None
    num_streams: float = NUM_STREAMS
    error_budget: float | None = ERROR_BUDGET
    land_albedo: LandAlbedo | None = None
    sea_ice_albedo: IceAlbedo | None = None
    snow_albedo: IceAlbedo | None = None
    variables: tuple[str, ...] = (ALL,)
    rayleigh_correction: bool = True
    command: str | None = None


def check_effects(request: Request) -> None:
    """Raise `InputError` where something is given that would have no effect without another."""
    thermal = set(request.bands) & set(THERMAL)
    if request.emissivity is not None and not thermal:
        raise InputError(
            f"an emissivity (--emissivity) is that of the ground in {', '.join(THERMAL)}; simulate "
            "that band, too (--bands), or leave the emissivity out."
        )
    if request.plume is None:
        given = {"--plume-species": request.plume_species, "--plume-aod": request.plume_aod}
        for name in (name for name, value in given.items() if value is not None):
            raise InputError(f"{name} is of a plume; name its picture (--plume), or leave it out.")
    if request.albedo is None:
        if request.land_kernels:
            raise InputError(
                "kernels of the land are those of an albedo file; name one (--albedo)."
            )
        if request.broadband:
            raise InputError(
                "broadband albedo (--broadband) is that of an albedo file; name one (--albedo)."
            )
    if set(request.bands) == thermal:
        _check_thermal_alone(request)


def _check_thermal_alone(request: Request) -> None:
    """Raise `InputError` where the ground of bands of sunlight is told and there are none."""
    grounds = {
        "an albedo file (--albedo)": request.albedo,
        "an albedo of the ocean (--ocean-albedo)": request.ocean_albedo,
        "a wind over water (--ocean-wind)": request.ocean_wind,
        "an albedo of land (--land-albedo)": request.land_albedo,
        "an albedo of sea ice (--sea-ice-albedo)": request.sea_ice_albedo,
        "an albedo of snow (--snow-albedo)": request.snow_albedo,
    }
    for name in (name for name, value in grounds.items() if value is not None):
        raise InputError(
            f"{name} is of bands of sunlight; simulate one beside {', '.join(THERMAL)} (--bands), "
            "or leave it out."
        )
