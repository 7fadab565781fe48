"""Options of ``abi-operator tune``, each with the text of its help.

`command.tune` takes them in and has their defaults.
"""

from pathlib import Path
from typing import Annotated

import typer

from .plume_numbers import NUMBERS

Result = Annotated[Path, typer.Argument(help="result.nc of a simulation, all of it.")]
Observed = Annotated[
    list[Path],
    typer.Argument(
        help="What was observed, NetCDF: a result (of observe), files of ABI (L1b or CMI, one "
        "or several), or variables named C01, brf_C01 or, of MODIS, Band3 and so on, with "
        "latitude and longitude."
    ),
]
Out = Annotated[Path, typer.Option(help="Folder for what is found; made if need be.")]
Fit = Annotated[
    str | None,
    typer.Option(
        help=f"Numbers of the plume to be fitted, by commas: {', '.join(NUMBERS)}. Without, "
        "scene and observation are compared as they are."
    ),
]
Species = Annotated[
    str | None, typer.Option(help="Name of the plume, where the result has several.")
]
Bands = Annotated[str | None, typer.Option(help="Bands, by commas; all that both have without.")]
Nearest = Annotated[
    float | None,
    typer.Option(
        metavar="KM",
        help="Where grids differ, take the nearest observed pixel within so many km.",
    ),
]
Brf = Annotated[
    bool,
    typer.Option(
        "--brf",
        help="Observed numbers were divided by the cosine of the solar zenith angle, where "
        "their names do not say; those of results and of ABI's files were not.",
    ),
]
Where = Annotated[
    str | None,
    typer.Option(
        help="Pixels that decide a fit: plume, all of it (the default), or clear, those without "
        "cloud."
    ),
]
Calibration = Annotated[
    bool,
    typer.Option(
        "--calibration",
        help="Each band's gain is unknown to a fit, by the instrument's calibration error, and "
        "found.",
    ),
]
ForwardError = Annotated[
    float | None,
    typer.Option(
        help="Relative error of the fitted model in each pixel and band by itself; 0 without."
    ),
]
Prior = Annotated[
    str | None,
    typer.Option(
        help="TOML file with mean and sigma of [strength] and others to be fitted, or 'declared' "
        "(the default)."
    ),
]
Time = Annotated[int, typer.Option(min=0, help="Which of the result's times, from 0.")]
Plot = Annotated[
    bool,
    typer.Option("--plot", help="Draw maps and histograms; needs matplotlib."),
]
