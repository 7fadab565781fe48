"""The command ``abi-operator experiment``."""

from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer
import xarray as xr

from abi_operator.commands import one_sentence, typed
from abi_operator.files import InputError, output_folder

from . import EXPERIMENTS
from .experiment import Experiment
from .tables import format_table


def experiment(
    context: typer.Context,
    name: Annotated[
        str | None, typer.Argument(help="Which one; without it all of them are listed.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            help="Folder for the table (NetCDF) and a picture of it; needs matplotlib "
            "(pip install matplotlib)."
        ),
    ] = None,
    size: Annotated[
        int | None,
        typer.Option(
            min=4,
            help="Rows and columns of an image; of truth the root of how many pixels, of "
            "ash-colour how many grounds.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of all that is random.")] = 0,
) -> None:
    """Retrieve what is made up for a question, and print how well: see the list without a name."""
    if name is None:
        typer.echo("\n".join(f"{key}: {one.sentence}" for key, one in EXPERIMENTS.items()))
        return
    if name not in EXPERIMENTS:
        raise typer.BadParameter(f"no experiment {name!r}; choose from {', '.join(EXPERIMENTS)}.")
    chosen = EXPERIMENTS[name]
    how: dict[str, Any] = {"seed": seed} if size is None else {"seed": seed, "size": size}
    with one_sentence():
        figures = None if output is None else _figures()  # before an experiment that takes minutes
        table = chosen.run(**how)
        table.attrs |= {"title": chosen.sentence, "source": typed(context)}
        typer.echo(format_table(table))
        if output is not None:
            with output_folder(output) as folder:
                files = _written(name, chosen, table, figures, folder)
            for file in files:
                typer.echo(f"wrote {output / file}")


def _written(
    name: str, chosen: Experiment, table: xr.Dataset, figures: Any, folder: Path
) -> tuple[str, str]:
    """Names of the files, of the table and of its picture."""
    table.to_netcdf(folder / f"{name}.nc", engine="netcdf4")
    figure = figures.Figure(layout="constrained")
    chosen.draw(table, figure)
    figure.savefig(folder / f"{name}.png", dpi=100)
    return f"{name}.nc", f"{name}.png"


def _figures() -> Any:
    """The module of matplotlib that makes figures without a screen."""
    try:
        return import_module("matplotlib.figure")
    except ModuleNotFoundError as error:
        raise InputError(
            f"--output needs {error.name}; install it with pip install matplotlib."
        ) from error
