"""The command ``abi-operator tune``."""

from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer
import xarray as xr

from abi_operator.commands import one_sentence, typed
from abi_operator.files import InputError, output_folder, read_result, reading

from ..prior_file import read_prior
from .observed import read_observed
from .plume_numbers import NUMBERS
from .report import csv_of, report_lines
from .study import Errors, compared, numbers_of, tuned


def tune(
    context: typer.Context,
    result: Annotated[Path, typer.Argument(help="result.nc of a simulation, all of it.")],
    observed: Annotated[
        list[Path],
        typer.Argument(
            help="What was observed, NetCDF: a result (of observe), files of ABI (L1b or CMI, one "
            "or several), or variables named C01, brf_C01 or, of MODIS, Band3 and so on, with "
            "latitude and longitude."
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder for what is found; made if need be.")],
    fit: Annotated[
        str | None,
        typer.Option(
            help=f"Numbers of the plume to be fitted, by commas: {', '.join(NUMBERS)}. Without, "
            "scene and observation are compared as they are."
        ),
    ] = None,
    species: Annotated[
        str | None, typer.Option(help="Name of the plume, where the result has several.")
    ] = None,
    bands: Annotated[
        str | None, typer.Option(help="Bands, by commas; all that both have without.")
    ] = None,
    nearest: Annotated[
        float | None,
        typer.Option(
            metavar="KM",
            help="Where grids differ, take the nearest observed pixel within so many km.",
        ),
    ] = None,
    brf: Annotated[
        bool,
        typer.Option(
            "--brf",
            help="Observed numbers were divided by the cosine of the solar zenith angle, where "
            "their names do not say; those of results and of ABI's files were not.",
        ),
    ] = False,
    where: Annotated[
        str, typer.Option(help="Pixels that decide: plume, or clear, those without cloud.")
    ] = "plume",
    calibration: Annotated[
        bool,
        typer.Option(
            "--calibration",
            help="Each band's gain is unknown, by the instrument's calibration error, and found.",
        ),
    ] = False,
    forward_error: Annotated[
        float, typer.Option(help="Relative error of the model in each pixel and band by itself.")
    ] = 0.0,
    prior: Annotated[
        str,
        typer.Option(help="TOML file with mean and sigma of [strength] and others, or 'declared'."),
    ] = "declared",
    time: Annotated[int, typer.Option(min=0, help="Which of the result's times, from 0.")] = 0,
    plot: Annotated[
        bool,
        typer.Option("--plot", help="Draw maps and histograms; needs matplotlib."),
    ] = False,
) -> None:
    """Compare a scene with what was observed of it, and tune its plume, as Grasso et al. did.

    Statistics in the plume and outside, histograms and maps of differences, band by band
    (tuning.nc, tuning.csv). With --fit a few numbers of the plume, each one for all of its pixels,
    are fitted to the observed image, with errors, and it is told whether the model then explains
    what was observed.

    \b
    abi-operator observe demo/result.nc --seed 1 --out demo/observed.nc
    abi-operator tune demo/result.nc demo/observed.nc --fit strength,ssa,height --out demo/tuning
    """
    pictures = _pictures() if plot else None
    with one_sentence(), reading(f"{result} or {', '.join(map(str, observed))}"):
        with read_result(result) as whole:
            image = one_time(whole, time)
            seen = read_observed(
                observed,
                image,
                nearest_km=nearest,
                quantity="brf" if brf else "reflectance_factor",
            )
            how: dict[str, Any] = {"species": species, "bands": _names(bands)}
            if fit is None:
                found = compared(image, seen, **how)
            else:
                numbers = _names(fit) or []
                vector = read_prior(prior, numbers_of(image, numbers, species))
                errors = Errors(calibration, forward_error)
                how |= {"where": where, "errors": errors}
                found = tuned(image, seen, vector, **how)
            event = f"{found.attrs['history']}: {typed(context)}"
            found.attrs["history"] = "\n".join([event, str(whole.attrs["history"])])
        with output_folder(out) as folder:
            _to_netcdf(found, folder / "tuning.nc")
            (folder / "tuning.csv").write_text(csv_of(found))
            drawn = [] if pictures is None else pictures.write_pictures(found, folder)
    typer.echo("\n".join(report_lines(found)))
    for name in ("tuning.nc", "tuning.csv", *(path.name for path in drawn)):
        typer.echo(f"wrote {out / name}")


def one_time(result: xr.Dataset, time: int) -> xr.Dataset:
    """A result at one of its times."""
    if time >= result.sizes["time"]:
        raise InputError(f"the result has {result.sizes['time']} times; --time {time} is none.")
    return result.isel(time=time)


def _names(text: str | None) -> list[str] | None:
    if text is None:
        return None
    return [name.strip() for name in text.split(",") if name.strip()]


def _pictures() -> Any:
    """The module that draws, which imports matplotlib."""
    with one_sentence():
        try:
            return import_module("retrievals.tuning.pictures")
        except ModuleNotFoundError as error:
            raise InputError(
                f"--plot needs {error.name}; install it with pip install matplotlib."
            ) from error


def _to_netcdf(found: xr.Dataset, path: Path) -> None:
    maps = [name for name, array in found.data_vars.items() if {"y", "x"} <= set(array.dims)]
    compressed = {name: {"zlib": True, "complevel": 1} for name in maps}
    unfilled = {name: {"_FillValue": None} for name in found.coords}
    found.to_netcdf(path, engine="netcdf4", encoding=compressed | unfilled)
