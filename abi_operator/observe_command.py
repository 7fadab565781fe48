"""The command ``abi-operator observe``: a result as the imager would report it."""

from pathlib import Path
from typing import Annotated

import typer
import xarray as xr

from .commands import one_sentence, typed, user_warnings
from .files import ResultWriter, output_folder, read_result, reading, stored
from .instrument import Imager
from .scene import observed

# Attributes that every file has of itself.
_OWN = "Conventions", "source", "history", "title", "files_made_of_this_one"


def observe(
    context: typer.Context,
    result: Annotated[Path, typer.Argument(help="result.nc of a simulation.")],
    out: Annotated[Path, typer.Option(help="File for what is reported (NetCDF).")],
    footprint: Annotated[
        int,
        typer.Option(
            min=1,
            help="Columns that a pixel sees along each axis: radiance is averaged before anything "
            "saturates. Of more than one the file is an image, without the air's layers.",
        ),
    ] = 1,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="Add the instrument's noise, drawn by this number; none without."),
    ] = None,
    calibration: Annotated[
        bool,
        typer.Option(
            "--calibration",
            help="Add an error of the calibration as well, one for each of C01 to C06; of C07 none "
            "is specified.",
        ),
    ] = False,
    fire_saturation_temperature: Annotated[
        float | None,
        typer.Option(
            min=250,
            max=500,
            help="Brightness temperature in K at which C07 saturates, 400 in Grasso et al. (2013); "
            "the end of the files' range without.",
        ),
    ] = None,
    quantised: Annotated[
        bool, typer.Option("--quantised", help="Round radiances to the counts of L1b files.")
    ] = False,
) -> None:
    """Put a simulated result through the instrument: footprint, noise, ceilings and counts.

    Radiances, reflectances and brightness temperatures are replaced with what the imager would
    report, and saturated tells where it could tell no more.

    \b
    abi-operator observe fires/result.nc --seed 1 --out fires/observed.nc
    abi-operator retrieve fire fires/observed.nc --out fires/retrieval.nc
    """
    with one_sentence(), user_warnings(), reading(str(result)), read_result(result) as dataset:
        imager = Imager(
            str(dataset.attrs.get("satellite", "GOES-16")),
            fire_saturation_temperature=fire_saturation_temperature,
            quantised=quantised,
        )
        report = observed(dataset, imager, footprint=footprint, seed=seed, calibration=calibration)
        # The writer puts the map there itself.
        names = [name for name in ("x", "y", "crs") if name in report.variables]
        grid = xr.Dataset(coords={name: report[name].variable for name in names})
        report = report.drop_vars(names)
        with output_folder(out.absolute().parent) as folder:
            with ResultWriter(
                folder / out.name,
                times=report["time"].values,
                shape=(report.sizes["y"], report.sizes["x"]),
                moving="time" in report["latitude"].dims,
                attributes={"history": str(report.attrs.get("history", ""))},
                grid=grid if "crs" in names else None,
                command=typed(context),
            ) as writer:
                for time in range(report.sizes["time"]):
                    writer.write(time, slice(None), stored(report.isel(time=time)))
                writer.add_attributes({k: v for k, v in report.attrs.items() if k not in _OWN})
        saturated = report["saturated"].sum([d for d in report["saturated"].dims if d != "band"])
        bands = map(str, report["band"].values)
        counts = [f"{band} {int(n)}" for band, n in zip(bands, saturated.values, strict=True)]
        lost = [dataset.sizes[d] - footprint * report.sizes[d] for d in ("y", "x")]
    typer.echo(f"wrote {out}")
    typer.echo(f"saturated pixels: {', '.join(counts)}")
    if any(lost):
        typer.echo(f"left out: {lost[0]} rows in the north and {lost[1]} columns in the east")
