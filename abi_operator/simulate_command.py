"""The command ``abi-operator simulate``: what it asks, and what it prints.

Inputs are opened and checked before a folder is made.
"""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from . import option_texts
from .atmosphere import ICE_OPTICS, LIQUID_OPTICS
from .bands import BANDS, GRASSO2013, check_bands
from .commands import one_sentence, typed, user_warnings
from .files import output_folder
from .machine.backend import device_in_words
from .microphysics import SCHEMES
from .optics import ALL_GASES
from .satellites import SATELLITES
from .scene import CLASSES, ERROR_BUDGET, DropletNumber
from .settings import NUM_STREAMS
from .simulation import Report, Request, Species, open_scene, pictures_of_before, simulate_scene
from .surface import EMISSIVITY_3900NM, SNOW_AND_ICE_ALBEDO

_IMAGER_BANDS = tuple(name for name in BANDS if name != "green")


def simulate(
    context: typer.Context,
    wrf: Annotated[
        list[Path],
        typer.Argument(
            metavar="WRFOUT...",
            help="Output of the WRF model (wrfout_*): one file or more of one domain, any times, "
            "or patterns of names.",
        ),
    ],
    out: Annotated[
        Path, typer.Option(help="Folder for result.nc and the pictures (PNG); made if need be.")
    ],
    time: Annotated[
        str | None,
        typer.Option(
            help="Times to simulate, as 2005-08-28T12:00 or 2005-08-28 for those of a day, or "
            "counted from 0; several by commas. All without."
        ),
    ] = None,
    bands: Annotated[
        str,
        typer.Option(
            help=f"Bands to simulate, of {', '.join(BANDS)}; all: C01 to C07. "
            "C01,C02,C03 make a picture in natural colours."
        ),
    ] = ",".join(GRASSO2013),
    albedo: Annotated[
        Path | None,
        typer.Option(
            help="How bright the land is: MODIS albedo MCD43A1 (kernel weights and quality) of "
            "Band1, 2, 3, 6 and 7, also of Band5 for C04 and C05 and of Band4 for green, as a "
            "NetCDF file from AppEEARS, projection Geographic."
        ),
    ] = None,
    ocean_albedo: Annotated[
        float | None,
        typer.Option(
            min=0, max=1, help="How bright water is, in all bands but C07: 0.03 to 0.06 is usual."
        ),
    ] = None,
    land_kernels: Annotated[
        bool,
        typer.Option(
            "--land-kernels",
            help="Let land reflect by the kernels of the albedo file (Ross-Li), brighter with the "
            "sun behind the satellite, and not evenly.",
        ),
    ] = False,
    ocean_wind: Annotated[
        str | None,
        typer.Option(
            help="Let water glint, by a wind of so many m/s or by the model's (model), in place of "
            "--ocean-albedo."
        ),
    ] = None,
    land_albedo: Annotated[
        str | None,
        typer.Option(
            help="Albedo of land that the albedo file, if any, has none of: a number for all bands "
            "but C07, or model (its own, broadband)."
        ),
    ] = None,
    sea_ice_albedo: Annotated[
        str | None,
        typer.Option(
            help="Albedo of sea ice, where the model has some: a number for all bands but C07, or "
            f"one of {', '.join(SNOW_AND_ICE_ALBEDO)}. Without it such columns are left out."
        ),
    ] = None,
    snow_albedo: Annotated[
        str | None,
        typer.Option(
            help="Albedo of the model's snow on the ground, likewise. Without it the ground has "
            "that of the file."
        ),
    ] = None,
    broadband: Annotated[
        bool,
        typer.Option(
            help="Where the albedo file lacks a band, take its broadband albedo for it, which is "
            "less exact."
        ),
    ] = False,
    emissivity: Annotated[
        str | None,
        typer.Option(
            help="Of the ground in C07, which C07 needs: a number, model (its own, broadband), "
            "land-use (that of each column's land use), or one of "
            f"{', '.join(EMISSIVITY_3900NM)}."
        ),
    ] = None,
    plume: Annotated[
        Path | None,
        typer.Option(
            help="Add a plume where this greyscale PNG is bright, one pixel a column, north at "
            "the top."
        ),
    ] = None,
    plume_species: Annotated[Species, typer.Option(help="What the plume is made of.")] = (
        Species.SMOKE
    ),
    plume_aod: Annotated[
        float, typer.Option(min=0, help="Optical depth of the plume at 550 nm where it is white.")
    ] = 2.0,
    background_aerosol: Annotated[
        float | None,
        typer.Option(
            min=0,
            help="Optical depth at 550 nm of aerosol that is everywhere, thinning upwards by 1/e "
            "in 2 km, with the optics of smoke: 0.1 is usual over land. None without.",
        ),
    ] = None,
    fires: Annotated[
        Path | None,
        typer.Option(
            help="Let fires burn: a table (CSV) with latitude, longitude, temperature [K] and area "
            "[m2] of each, and start and end (UTC) if it does not burn all the time. They shine in "
            "C05, C06 and C07."
        ),
    ] = None,
    gases: Annotated[
        str, typer.Option(help=f"Gases that absorb: all, none, or some of {', '.join(ALL_GASES)}.")
    ] = option_texts.ALL,
    hydrometeors: Annotated[
        str,
        typer.Option(
            help="Rain and ice to simulate beside cloud water: all that WRFOUT has, none, or some "
            f"of {', '.join(CLASSES)}."
        ),
    ] = option_texts.ALL,
    microphysics: Annotated[
        str | None,
        typer.Option(
            help="Scheme to assume in place of the model's where it gives no number of particles: "
            f"{', '.join(SCHEMES)}."
        ),
    ] = None,
    droplet_number: Annotated[
        str | None,
        typer.Option(
            metavar="N | WATER,LAND",
            help="Cloud droplets per cm3 where the model has no number of them; if not given, what "
            "its microphysics assumes, or else 100,300.",
        ),
    ] = None,
    cloud_optics: Annotated[
        str,
        typer.Option(
            metavar=" | ".join(LIQUID_OPTICS),
            help="How cloud droplets scatter: by Mie theory, or as in Grasso et al. (2013), by "
            "modified anomalous diffraction, without a rainbow.",
        ),
    ] = LIQUID_OPTICS[0],
    ice_optics: Annotated[
        str,
        typer.Option(
            metavar=" | ".join(ICE_OPTICS),
            help="How strongly crystals of ice scatter forwards: as Fu's smooth columns, or as "
            "severely roughened crystals of many habits.",
        ),
    ] = ICE_OPTICS[0],
    flat_sun: Annotated[
        bool,
        typer.Option(
            "--flat-sun",
            help="Let a sun lower than 25 degrees shine through flat layers, and not through those "
            "of a sphere.",
        ),
    ] = False,
    satellite: Annotated[
        str, typer.Option(help=f"Whose imager looks: {', '.join(SATELLITES)}.")
    ] = "GOES-16",
    satellite_longitude: Annotated[
        float | None,
        typer.Option(
            min=-180,
            max=360,
            help="Where the satellite stands above the equator, in degrees, east positive, if not "
            "at its usual place.",
        ),
    ] = None,
    num_streams: Annotated[
        str,
        typer.Option(
            metavar="NUMBER|PERCENT",
            help="Directions by which scattered light is computed, even: more are more exact and "
            "slower. Or the error that they may leave in 99 of 100 pixels, such as 0.5%, by which "
            "each pixel has as many as clear air, plumes or cloud need.",
        ),
    ] = str(NUM_STREAMS),
    error_budget: Annotated[
        float,
        typer.Option(
            min=0,
            help="Relative error of the reflectance that may be made for speed, in 99 of 100 "
            "pixels; with 0 nothing is left out.",
        ),
    ] = ERROR_BUDGET,
    variables: Annotated[
        str,
        typer.Option(
            help="What result.nc keeps: all, which `abi-operator retrieve` needs; image, without "
            "the air's layers, a fifth of the size or less; or names such as "
            "reflectance_factor,radiance."
        ),
    ] = option_texts.ALL,
    rayleigh_correction: Annotated[
        bool,
        typer.Option(
            help="Take the blue haze of the air out of the picture in natural colours; result.nc "
            "has it in any case."
        ),
    ] = True,
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
    for name in report.files:
        typer.echo(f"wrote {out / name}")
    for name in sorted(set(before) - set(report.files)):
        typer.echo(f"removed {out / name}, a picture of the result before")
    for line in report.lines:
        typer.echo(line)
    typer.echo(f"computed on {device_in_words()}")
