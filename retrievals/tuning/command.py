"""The command ``abi-operator tune``."""

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import typer
import xarray as xr

from abi_operator.commands import one_sentence, typed
from abi_operator.files import InputError, output_folder, read_result, reading

from ..prior_file import DECLARED, read_prior
from . import options
from .observed import read_observed
from .report import csv_of, report_lines
from .study import Errors, compared, numbers_of, tuned


def tune(
    context: typer.Context,
    result: options.Result,
    observed: options.Observed,
    out: options.Out,
    fit: options.Fit = None,
    species: options.Species = None,
    bands: options.Bands = None,
    nearest: options.Nearest = None,
    brf: options.Brf = False,
    where: options.Where = None,
    calibration: options.Calibration = False,
    forward_error: options.ForwardError = None,
    prior: options.Prior = None,
    time: options.Time = 0,
    plot: options.Plot = False,
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
    if fit is None:
        of_fit = {
            "--where": where,
            "--calibration": calibration or None,
            "--forward-error": forward_error,
            "--prior": prior,
        }
        _check_unused(of_fit)
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
                declared = numbers_of(image, numbers, species)
                vector = read_prior(DECLARED if prior is None else prior, declared)
                errors = Errors(calibration, forward_error or 0.0)
                how |= {"where": where or "plume", "errors": errors}
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


def _check_unused(options: Mapping[str, object]) -> None:
    """Refuse options of a fit, by name, of which one was given where nothing is fitted."""
    with one_sentence():
        given = [name for name, value in options.items() if value is not None]
        if given:
            are = "is" if len(given) == 1 else "are"
            raise InputError(f"{', '.join(given)} {are} of a fit; say what to fit with --fit.")


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
