"""Options of ``abi-operator retrieve``, each with the text of its help.

`commands.retrieve` takes them in and has their defaults.
"""

from pathlib import Path
from typing import Annotated

import typer

from .kinds import KINDS

Kind = Annotated[str, typer.Argument(help=f"What to retrieve: {', '.join(KINDS)}.")]
Result = Annotated[
    Path,
    typer.Argument(
        help="result.nc of a simulation with such a plume, with cloud, or with C07 for fires."
    ),
]
Out = Annotated[Path, typer.Option(help="File to write, NetCDF.")]
Bands = Annotated[
    str | None,
    typer.Option(
        help="Bands to retrieve from; C01,C02,C03 of plumes, C02,C06 of cloud and C05,C06,C07 "
        "of fires."
    ),
]
RetrieveSsa = Annotated[
    bool,
    typer.Option(help="Retrieve how much the plume absorbs, too: its single-scattering albedo."),
]
EffectiveRadius = Annotated[
    bool,
    typer.Option(help="Retrieve the size of a plume's particles, too, by tables of Mie theory."),
]
Noise = Annotated[bool, typer.Option(help="Add the imager's noise first.")]
Seed = Annotated[int | None, typer.Option(min=0, help="Seed of the noise; 0 without.")]
Prior = Annotated[
    str | None,
    typer.Option(
        help="What is known before: a TOML file with mean and sigma of [aod_550] and "
        "others, or 'declared' for wide ones that are built in."
    ),
]
Diagnostics = Annotated[
    bool,
    typer.Option(help="Write averaging kernels, gains, errors by source and intervals, too."),
]
Smooth = Annotated[
    float | None,
    typer.Option(
        help="Retrieve the image as a whole: pixels up to about so many pixels apart are "
        "alike. With the 'declared' prior unless --prior names one."
    ),
]
Where = Annotated[
    str | None,
    typer.Option(
        help="'all' to retrieve every usable pixel and not only where there is a plume, or "
        "where a fire stands out; without plume it needs a prior. Cloud is retrieved where the "
        "result has cloud water, and nowhere else."
    ),
]
Background = Annotated[
    str | None,
    typer.Option(
        help="How the ground beside a fire is known: 'stored' (the default), as the result "
        "says, or 'neighbours', as the pixels around it show."
    ),
]
