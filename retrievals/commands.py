"""Commands that `abi_operator`'s command line finds by their entry points."""

from importlib import import_module
from math import inf
from pathlib import Path
from typing import Annotated, Any

import typer
import xarray as xr

from abi_operator.bands import check_bands
from abi_operator.commands import one_sentence, typed
from abi_operator.files import (
    InputError,
    check_output_folder,
    output_folder,
    read_result,
    reading,
)
from abi_operator.radiance import FIRE_BANDS

from . import retrieve_options as options
from .fires import BACKGROUNDS
from .images import REFLECTIVE
from .kinds import retrieve_kind, retrieve_smoke, vector_of
from .prior_file import DECLARED, read_prior
from .product_file import read_retrieval
from .scoring import format_report, score_retrieval

RETRIEVAL = "retrieval.nc"
SCORES = "scores.csv"


def retrieve(
    context: typer.Context,
    kind: options.Kind,
    result: options.Result,
    out: options.Out,
    bands: options.Bands = None,
    retrieve_ssa: options.RetrieveSsa = False,
    effective_radius: options.EffectiveRadius = False,
    noise: options.Noise = False,
    seed: options.Seed = None,
    prior: options.Prior = None,
    diagnostics: options.Diagnostics = False,
    smooth: options.Smooth = None,
    where: options.Where = None,
    background: options.Background = None,
) -> None:
    """Retrieve a plume, cloud or fires from a simulated result."""
    try:
        vector = vector_of(kind, retrieve_ssa, effective_radius)
        chosen = (
            None
            if bands is None
            else check_bands(
                [band.strip() for band in bands.split(",")],
                FIRE_BANDS if kind == "fire" else REFLECTIVE,
            )
        )
        _check_background(kind, background)
        if seed is not None and not noise:
            raise ValueError("--seed is of the noise that --noise adds; give both, or neither.")
        prior = _smooth_prior(kind, smooth, diagnostics, prior)
        if where not in (None, "all"):
            raise ValueError(f"--where is 'all' or nothing; got {where!r}.")
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    how: dict[str, Any] = {} if background is None else {"background": background}
    how |= {} if where is None else {"where": where}
    how |= {} if smooth is None else {"smooth": smooth}
    with one_sentence(), reading(str(result)), read_result(result) as dataset:
        check_output_folder(out.absolute().parent)
        retrieval = retrieve_kind(
            dataset,
            kind,
            bands=chosen,
            retrieve_ssa=retrieve_ssa,
            effective_radius=effective_radius,
            noise=noise,
            seed=seed or 0,
            prior=None if prior is None else read_prior(prior, vector),
            diagnostics=diagnostics,
            **how,
        )
        # The latest event first, as `history` has it.
        event = f"{retrieval.attrs['history']}: {typed(context)}"
        retrieval.attrs["history"] = "\n".join([event, str(dataset.attrs["history"])])
        _write(retrieval, out)
    typer.echo(f"wrote {out}")


def _smooth_prior(
    kind: str, smooth: float | None, diagnostics: bool, prior: str | None
) -> str | None:
    """The prior that is used, as smoothness needs one."""
    if smooth is None:
        return prior
    if kind == "fire":
        raise ValueError("--smooth is of plumes and cloud; a fire is one pixel's.")
    if diagnostics:
        raise ValueError("--diagnostics are of single pixels; leave out --smooth.")
    if not 0 < smooth < inf:
        raise ValueError(f"--smooth is a length above 0 pixels; got {smooth:g}.")
    return DECLARED if prior is None else prior


def _check_background(kind: str, background: str | None) -> None:
    if background is not None and kind != "fire":
        raise ValueError(f"--background is of fires; {kind} has none.")
    if background not in (None, *BACKGROUNDS):
        raise ValueError(f"no background {background!r}; choose from {', '.join(BACKGROUNDS)}.")


def score(
    result: Annotated[Path, typer.Argument(help="Result of a simulation, with the truth.")],
    retrieval: Annotated[Path, typer.Argument(help="What was retrieved from it.")],
    csv: Annotated[
        Path | None, typer.Option(help="File for the scores, too, those of all bins.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            help="Folder for pictures of truth, retrieval and error, scatter and coverage; needs "
            "matplotlib (pip install matplotlib)."
        ),
    ] = None,
) -> None:
    """Score a retrieval against the truth that was specified."""
    with (
        one_sentence(),
        reading(f"{result} or {retrieval}"),
        read_result(result) as truth,
        read_retrieval(retrieval) as retrieved,
    ):
        report = score_retrieval(truth, retrieved)
        if csv is not None:
            with output_folder(csv.absolute().parent) as folder:
                _write_csv(report, folder / csv.name)
        if plot is not None:
            with output_folder(plot) as folder:
                paths = _pictures().write_pictures(truth, retrieved, folder)
            for path in paths:
                typer.echo(f"wrote {plot / path.name}")
    typer.echo(format_report(report))


def _pictures() -> Any:
    """The module that draws, which imports matplotlib."""
    try:
        return import_module("retrievals.scoring.pictures")
    except ModuleNotFoundError as error:
        raise InputError(
            f"--plot needs {error.name}; install it with pip install matplotlib."
        ) from error


def finish_demo(folder: Path) -> None:
    """Retrieve the smoke of a demonstration from its result, and score it.

    Reads ``result.nc`` in `folder`, writes ``retrieval.nc`` and ``scores.csv`` beside it and prints
    the scores. Trouble with the result is an `InputError`.
    """
    path = folder / "result.nc"
    with reading(str(path)), read_result(path) as result:
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
    """Write scores by group, then counts and shares of result codes, then the detection, then what
    intervals hold, which are a table of their own: no row stands for several of another's."""
    dims = [dim for dim in ("group", "code", "detection") if dim in report.dims]
    of_dims = [[n for n, x in report.data_vars.items() if x.dims == (dim,)] for dim in dims]
    intervals = [n for n, x in report.data_vars.items() if len(x.dims) > 1]
    chosen = [names for names in (*of_dims, intervals) if names]
    tables = [report[names].reset_coords(drop=True).to_dataframe() for names in chosen]
    path.write_text("\n".join(table.to_csv() for table in tables))
