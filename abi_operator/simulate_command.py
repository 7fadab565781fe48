"""The command ``abi-operator simulate``: what it does with its options, and what it prints.

Inputs are opened and checked before a folder is made.
"""

from functools import partial
from pathlib import Path

import typer

from . import option_texts
from . import simulate_options as options
from .atmosphere import ICE_OPTICS, LIQUID_OPTICS
from .bands import BANDS, GRASSO2013, check_bands
from .commands import one_sentence, typed, user_warnings
from .files import output_folder
from .machine.backend import device_in_words
from .optics import ALL_GASES
from .scene import CLASSES, ERROR_BUDGET, DropletNumber
from .settings import NUM_STREAMS
from .simulation import Report, Request, open_scene, pictures_of_before, simulate_scene

_IMAGER_BANDS = tuple(name for name in BANDS if name != "green")
_BANDS = ",".join(GRASSO2013)


def simulate(
    context: typer.Context,
    wrf: options.Wrf,
    out: options.Out,
    time: options.Time = None,
    bands: options.Bands = _BANDS,
    albedo: options.Albedo = None,
    ocean_albedo: options.OceanAlbedo = None,
    land_kernels: options.LandKernels = False,
    ocean_wind: options.OceanWind = None,
    land_albedo: options.LandAlbedo = None,
    sea_ice_albedo: options.SeaIceAlbedo = None,
    snow_albedo: options.SnowAlbedo = None,
    broadband: options.Broadband = False,
    emissivity: options.Emissivity = None,
    plume: options.Plume = None,
    plume_species: options.PlumeSpecies = None,
    plume_aod: options.PlumeAod = None,
    background_aerosol: options.BackgroundAerosol = None,
    fires: options.Fires = None,
    gases: options.Gases = option_texts.ALL,
    hydrometeors: options.Hydrometeors = option_texts.ALL,
    microphysics: options.Microphysics = None,
    droplet_number: options.DropletNumber = None,
    cloud_optics: options.CloudOptics = LIQUID_OPTICS[0],
    ice_optics: options.IceOptics = ICE_OPTICS[0],
    flat_sun: options.FlatSun = False,
    satellite: options.Satellite = "GOES-16",
    satellite_longitude: options.SatelliteLongitude = None,
    num_streams: options.NumStreams = str(NUM_STREAMS),
    error_budget: options.ErrorBudget = ERROR_BUDGET,
    variables: options.Variables = option_texts.ALL,
    rayleigh_correction: options.RayleighCorrection = True,
) -> None:
    """Simulate what the imager would see of a scene in a weather model's output.

    Writes a folder with result.nc (reflectances and radiances of every band, and what they were
    computed from) and a picture of every time. Land needs --albedo or --land-albedo, water
    --ocean-albedo or --ocean-wind; columns without an albedo are left out (flag no_albedo).

    \b
    abi-operator simulate wrfout_d01_2005-08-28_18:00:00 --ocean-albedo 0.06 --out sea
    abi-operator simulate wrfout_d01_2005-08-28_18:00:00 --albedo MCD43A1.nc \\
        --ocean-albedo 0.03 --bands all --emissivity grassland --out coast

    `abi-operator demo --size 16` makes files to try it with.
    """
    streams = option_texts.streams(num_streams)
    if not error_budget < 1:
        raise typer.BadParameter(f"an error budget is below 1; got {error_budget}.")
    try:
        names = check_bands(option_texts.names(bands, _IMAGER_BANDS))
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    with one_sentence():
        droplets = None if droplet_number is None else DropletNumber.from_text(droplet_number)
    request = Request(
        wrf,
        time=time,
        bands=names,
        albedo=albedo,
        ocean_albedo=ocean_albedo,
        land_kernels=land_kernels,
        ocean_wind=option_texts.number(ocean_wind),
        land_albedo=option_texts.number(land_albedo),
        sea_ice_albedo=option_texts.number(sea_ice_albedo),
        snow_albedo=option_texts.number(snow_albedo),
        broadband=broadband,
        emissivity=option_texts.number(emissivity),
        plume=plume,
        plume_species=plume_species,
        plume_aod=plume_aod,
        fires=fires,
        gases=option_texts.names(gases, ALL_GASES),
        hydrometeors=None
        if hydrometeors == option_texts.ALL
        else option_texts.names(hydrometeors, CLASSES),
        microphysics=microphysics,
        droplet_number=droplets,
        cloud_optics=cloud_optics,
        ice_optics=ice_optics,
        flat_sun=flat_sun,
        background_aerosol=background_aerosol,
        satellite=satellite,
        satellite_longitude=satellite_longitude,
        num_streams=streams,
        error_budget=error_budget or None,
        variables=tuple(name.strip() for name in variables.split(",")),
        rayleigh_correction=rayleigh_correction,
        command=typed(context),
    )
    with one_sentence(), user_warnings():
        scene = open_scene(request)
        before = pictures_of_before(out)
        outdated = partial(pictures_of_before, out)
        with output_folder(out, outdated=outdated, keeps_parts=True) as folder:
            report = simulate_scene(scene, folder)
        print_report(report, out, before)


def print_report(report: Report, out: Path, before: list[str]) -> None:
    """Say what was written and what was removed, and what the simulation has to say of itself."""
    for name in report.files:
        typer.echo(f"wrote {out / name}")
    for name in sorted(set(before) - set(report.files)):
        typer.echo(f"removed {out / name}, a picture of the result before")
    for line in report.lines:
        typer.echo(line)
    typer.echo(f"computed on {device_in_words()}")
