"""The command ``abi-operator nir-test``."""

from pathlib import Path
from typing import Annotated

import typer
import xarray as xr

from ..commands import one_sentence, typed
from ..files import InputError, output_folder, read_result
from .nir_report import account_of, csv_of, report_lines, rows_of, write_picture
from .nir_study import nir_study

_RESULT = typer.Argument(help="result.nc of a simulation, all of it.")
_TIME = typer.Option(min=0, help="Which of the result's times, counted from 0.")
_OUT = typer.Option(help="Folder for what is found; made if need be.")


def nir_test(
    context: typer.Context,
    result: Annotated[Path, _RESULT],
    out: Annotated[Path, _OUT],
    species: Annotated[str, typer.Option(help="Name of the plume that is changed.")] = "ash",
    change: Annotated[
        float, typer.Option(help="By how much of itself the near infrared changes, up and down.")
    ] = 0.1,
    pixel_by_pixel: Annotated[
        bool,
        typer.Option(
            "--pixel-by-pixel",
            help="Change every pixel by that, with a single-scattering albedo of its own, and not "
            "their mean, with one for the scene.",
        ),
    ] = False,
    smallest_brightness: Annotated[
        float,
        typer.Option(
            min=0, max=1, help="Count pixels where the plume's picture is as bright, or brighter."
        ),
    ] = 0.2,
    time: Annotated[int, _TIME] = 0,
) -> None:
    """Change how bright a plume is in the near infrared and tell what becomes of green.

    The test of Grasso et al. (2013): the single-scattering albedo of the ash in C03 is changed
    until the ash is 10 % brighter there, and then darker, and green is derived from both. Writes
    maps (nir_test.nc), a picture (nir_test.png) and the table that is printed (nir_test.csv).

    \b
    abi-operator demo --plume ash --out ash
    abi-operator nir-test ash/result.nc --out ash/nir-test
    """
    with one_sentence():
        image = read_image(result, time)
        study = nir_study(
            image,
            species=species,
            change=change,
            pixel_by_pixel=pixel_by_pixel,
            smallest_brightness=smallest_brightness,
        )
        study.attrs["history"] = history(context, image)
        with output_folder(out) as folder:
            write_dataset(study, folder / "nir_test.nc")
            write_picture(folder / "nir_test.png", study, image)
            rows = [*rows_of(study), *account_of(study, image)]
            (folder / "nir_test.csv").write_text(csv_of(rows))
    for name in ("nir_test.nc", "nir_test.png", "nir_test.csv"):
        typer.echo(f"wrote {out / name}")
    for line in report_lines(study, image):
        typer.echo(line)


def read_image(path: Path, time: int) -> xr.Dataset:
    """One time of a result, in memory; an `InputError` where there is none of that number."""
    with read_result(path) as result:
        if time >= result.sizes["time"]:
            raise InputError(
                f"{path} has {result.sizes['time']} times, counted from 0; got --time {time}."
            )
        return result.isel(time=time).load()


def history(context: typer.Context, image: xr.Dataset) -> str:
    """The command that is running, and before it what made the result."""
    return "\n".join([typed(context), str(image.attrs.get("history", ""))])


def write_dataset(dataset: xr.Dataset, path: Path) -> None:
    """Write maps as NetCDF."""
    compressed = {name: {"zlib": True, "complevel": 1} for name in dataset.data_vars}
    unfilled = {name: {"_FillValue": None} for name in dataset.coords}
    dataset.to_netcdf(path, engine="netcdf4", encoding=compressed | unfilled)
