"""Commands that `abi_operator`'s command line finds by their entry points."""

from pathlib import Path
from typing import Annotated

import typer
import xarray as xr

from abi_operator.bands import GRASSO2013, check_bands
from abi_operator.commands import one_sentence, typed
from abi_operator.files import InputError, output_folder, read_result

from .scoring import format_report, score_retrieval
from .smoke import BANDS, retrieve_smoke

RETRIEVAL = "retrieval.nc"
SCORES = "scores.csv"


def retrieve(
    context: typer.Context,
    result: Annotated[
        Path, typer.Argument(help="result.nc of a simulation with a plume of smoke.")
    ],
    out: Annotated[Path, typer.Option(help="File to write, NetCDF.")],
    bands: Annotated[str, typer.Option(help="Bands to retrieve from.")] = ",".join(BANDS),
    retrieve_ssa: Annotated[
        bool,
        typer.Option(
            help="Retrieve how much the smoke absorbs, too: its single-scattering albedo."
        ),
    ] = False,
    noise: Annotated[bool, typer.Option(help="Add the imager's noise first.")] = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
) -> None:
    """Retrieve the optical depth of smoke from a simulated result."""
    try:
        names = check_bands([name.strip() for name in bands.split(",")], GRASSO2013)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    with one_sentence(), read_result(result) as dataset:
        retrieval = retrieve_smoke(
            dataset, bands=names, retrieve_ssa=retrieve_ssa, noise=noise, seed=seed
        )
        # The latest event first, as `history` has it.
        event = f"{retrieval.attrs['history']}: {typed(context)}"
        retrieval.attrs["history"] = "\n".join([event, str(dataset.attrs["history"])])
        _write(retrieval, out)
    typer.echo(f"wrote {out}")


def score(
    result: Annotated[Path, typer.Argument(help="Result of a simulation, with the truth.")],
    retrieval: Annotated[Path, typer.Argument(help="What was retrieved from it.")],
    csv: Annotated[Path | None, typer.Option(help="File for the scores, too.")] = None,
) -> None:
    """Score a retrieval against the truth that was specified."""
    with one_sentence(), read_result(result) as truth, _open_retrieval(retrieval) as retrieved:
        report = score_retrieval(truth, retrieved)
        if csv is not None:
            with output_folder(csv.absolute().parent) as folder:
                _write_csv(report, folder / csv.name)
    typer.echo(format_report(report))


def finish_demo(folder: Path) -> None:
    """Retrieve the smoke of a demonstration from its result, and score it.

    Reads ``result.nc`` in `folder`, writes ``retrieval.nc`` and ``scores.csv`` beside it and prints
    the scores. Trouble with the result is an `InputError`.
    """
    with read_result(folder / "result.nc") as result:
        typer.echo("retrieving smoke from the simulated reflectances")
        retrieval = retrieve_smoke(result)
        report = score_retrieval(result, retrieval)
    with output_folder(folder) as files:
        _to_netcdf(retrieval, files / RETRIEVAL)
        _write_csv(report, files / SCORES)
    for name in (RETRIEVAL, SCORES):
        typer.echo(f"wrote {folder / name}")
    typer.echo(format_report(report))


def _write(retrieval: xr.Dataset, out: Path) -> None:
    """Write a file that appears whole or not at all."""
    with output_folder(out.absolute().parent) as folder:
        _to_netcdf(retrieval, folder / out.name)


def _to_netcdf(retrieval: xr.Dataset, path: Path) -> None:
    compressed = {name: {"zlib": True, "complevel": 1} for name in retrieval.data_vars}
    unfilled = {name: {"_FillValue": None} for name in retrieval.coords}
    retrieval.to_netcdf(path, engine="netcdf4", encoding=compressed | unfilled)


def _write_csv(report: xr.Dataset, path: Path) -> None:
    """Write scores by group, then counts and shares of result codes."""
    by_group = report.drop_dims("code").to_dataframe()
    by_code = report.drop_dims("group").to_dataframe()
    path.write_text(by_group.to_csv() + "\n" + by_code.to_csv())


def _open_retrieval(path: Path) -> xr.Dataset:
    if not path.is_file():
        raise InputError(f"{path} does not exist or is not a file; check the path.")
    try:
        dataset = xr.open_dataset(path, engine="netcdf4", decode_timedelta=False)
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(f"{path} cannot be read as NetCDF ({error}).") from error
    if "result_code" not in dataset:
        dataset.close()
        raise InputError(f"{path} has no result_code; give a file that a retrieval wrote.")
    return dataset
