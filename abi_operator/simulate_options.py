"""Options of ``abi-operator simulate``, each with the text of its help.

`simulate_command` takes them in and has their defaults.
"""

from pathlib import Path
from typing import Annotated

import typer

from .atmosphere import ICE_OPTICS, LIQUID_OPTICS
from .bands import BANDS
from .microphysics import SCHEMES
from .optics import ALL_GASES
from .request import PLUME_AOD, Species
from .satellites import SATELLITES
from .scene import CLASSES
from .surface import EMISSIVITY_3900NM, SNOW_AND_ICE_ALBEDO

# Input, output, and what of it.
Wrf = Annotated[
    list[Path],
    typer.Argument(
        metavar="WRFOUT...",
        help="Output of the WRF model (wrfout_*): one file or more of one domain, any times, "
        "or patterns of names.",
    ),
]
Out = Annotated[
    Path, typer.Option(help="Folder for result.nc and the pictures (PNG); made if need be.")
]
Time = Annotated[
    str | None,
    typer.Option(
        help="Times to simulate, as 2005-08-28T12:00 or 2005-08-28 for those of a day, or "
        "counted from 0; several by commas. All without."
    ),
]
Bands = Annotated[
    str,
    typer.Option(
        help=f"Bands to simulate, of {', '.join(BANDS)}; all: C01 to C07. "
        "C01,C02,C03 make a picture in natural colours."
    ),
]

# The ground.
Albedo = Annotated[
    Path | None,
    typer.Option(
        help="How bright the land is: MODIS albedo MCD43A1 (kernel weights, of any quality) of "
        "Band1, 2, 3, 6 and 7, also of Band5 for C04 and C05 and of Band4 for green, as a "
        "NetCDF file from AppEEARS, projection Geographic."
    ),
]
OceanAlbedo = Annotated[
    float | None,
    typer.Option(
        min=0, max=1, help="How bright water is, in all bands but C07: 0.03 to 0.06 is usual."
    ),
]
LandKernels = Annotated[
    bool,
    typer.Option(
        "--land-kernels",
        help="Let land reflect by the kernels of the albedo file (Ross-Li), brighter with the "
        "sun behind the satellite, and not evenly.",
    ),
]
OceanWind = Annotated[
    str | None,
    typer.Option(
        help="Let water glint, by a wind of so many m/s or by the model's (model), in place of "
        "--ocean-albedo."
    ),
]
LandAlbedo = Annotated[
    str | None,
    typer.Option(
        help="Albedo of land that the albedo file, if any, has none of: a number for all bands "
        "but C07, or model (its own, broadband)."
    ),
]
SeaIceAlbedo = Annotated[
    str | None,
    typer.Option(
        help="Albedo of sea ice, where the model has some: a number for all bands but C07, or "
        f"one of {', '.join(SNOW_AND_ICE_ALBEDO)}. Without it such columns are left out."
    ),
]
SnowAlbedo = Annotated[
    str | None,
    typer.Option(
        help="Albedo of the model's snow on the ground, likewise. Without it the ground has "
        "that of the file."
    ),
]
Broadband = Annotated[
    bool,
    typer.Option(
        help="Where the albedo file lacks a band, take its broadband albedo for it, which is "
        "less exact."
    ),
]
Emissivity = Annotated[
    str | None,
    typer.Option(
        help="Of the ground in C07, which C07 needs: a number, model (its own, broadband), "
        "land-use (that of each column's land use), or one of "
        f"{', '.join(EMISSIVITY_3900NM)}."
    ),
]

# What is added to the model's air and ground.
Plume = Annotated[
    Path | None,
    typer.Option(
        help="Add a plume where this greyscale PNG is bright, one pixel a column, north at the top."
    ),
]
PlumeSpecies = Annotated[
    Species | None,
    typer.Option(help="What the plume is made of.", show_default=str(Species.SMOKE)),
]
PlumeAod = Annotated[
    float | None,
    typer.Option(
        min=0,
        help="Optical depth of the plume at 550 nm where it is white.",
        show_default=f"{PLUME_AOD:g}",
    ),
]
BackgroundAerosol = Annotated[
    float | None,
    typer.Option(
        min=0,
        help="Optical depth at 550 nm of aerosol that is everywhere, thinning upwards by 1/e "
        "in 2 km, with the optics of smoke: 0.1 is usual over land. None without.",
    ),
]
Fires = Annotated[
    Path | None,
    typer.Option(
        help="Let fires burn: a table (CSV) with latitude, longitude, temperature [K] and area "
        "[m2] of each, and start and end (UTC) if it does not burn all the time. They shine in "
        "C05, C06 and C07."
    ),
]

# Air and clouds.
Gases = Annotated[
    str, typer.Option(help=f"Gases that absorb: all, none, or some of {', '.join(ALL_GASES)}.")
]
Hydrometeors = Annotated[
    str,
    typer.Option(
        help="Rain and ice to simulate beside cloud water: all that WRFOUT has, none, or some "
        f"of {', '.join(CLASSES)}."
    ),
]
Microphysics = Annotated[
    str | None,
    typer.Option(
        help="Scheme to assume in place of the model's where it gives no number of particles: "
        f"{', '.join(SCHEMES)}."
    ),
]
DropletNumber = Annotated[
    str | None,
    typer.Option(
        metavar="N | WATER,LAND",
        help="Cloud droplets per cm3 where the model has no number of them; if not given, what "
        "its microphysics assumes, or else 100,300.",
    ),
]
CloudOptics = Annotated[
    str,
    typer.Option(
        metavar=" | ".join(LIQUID_OPTICS),
        help="How cloud droplets scatter: by Mie theory, or as in Grasso et al. (2013), by "
        "modified anomalous diffraction, without a rainbow.",
    ),
]
IceOptics = Annotated[
    str,
    typer.Option(
        metavar=" | ".join(ICE_OPTICS),
        help="How strongly crystals of ice scatter forwards: as Fu's smooth columns, or as "
        "severely roughened crystals of many habits.",
    ),
]

# Sun and satellite.
FlatSun = Annotated[
    bool,
    typer.Option(
        "--flat-sun",
        help="Let a sun lower than 25 degrees shine through flat layers, and not through those "
        "of a sphere.",
    ),
]
Satellite = Annotated[str, typer.Option(help=f"Whose imager looks: {', '.join(SATELLITES)}.")]
SatelliteLongitude = Annotated[
    float | None,
    typer.Option(
        min=-180,
        max=360,
        help="Where the satellite stands above the equator, in degrees, east positive, if not "
        "at its usual place.",
    ),
]

# The solver, and what is kept.
NumStreams = Annotated[
    str,
    typer.Option(
        metavar="NUMBER|PERCENT",
        help="Directions by which scattered light is computed, even: more are more exact and "
        "slower. Or the error that they may leave in 99 of 100 pixels, such as 0.5%, by which "
        "each pixel has as many as clear air, plumes or cloud need.",
    ),
]
ErrorBudget = Annotated[
    float,
    typer.Option(
        min=0,
        help="Relative error of the reflectance that may be made for speed, in 99 of 100 "
        "pixels; with 0 nothing is left out.",
    ),
]
Variables = Annotated[
    str,
    typer.Option(
        help="What result.nc keeps: all, which `abi-operator retrieve` needs; image, without "
        "the air's layers, a fifth of the size or less; or names such as "
        "reflectance_factor,radiance."
    ),
]
RayleighCorrection = Annotated[
    bool,
    typer.Option(
        help="Take the blue haze of the air out of the picture in natural colours; result.nc "
        "has it in any case."
    ),
]
