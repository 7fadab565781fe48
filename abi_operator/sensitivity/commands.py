"""The commands ``abi-operator nir-test``, ``sensitivity`` and ``figure``."""

from pathlib import Path
from typing import Annotated, Any

import typer
import xarray as xr

from ..atmosphere import Fire
from ..commands import one_sentence, typed
from ..files import InputError, output_folder, read_result
from ..files.netcdf import load_all
from . import nir_report, sensitivity_report
from .declarations import BY_BAND, SHORT_NAMES
from .figure_albedo import albedo_figure
from .figure_fires import fires_figure
from .figure_green import green_figure
from .nir_study import nir_study
from .panels import write_panels
from .scene_study import Sampling, sensitivity_study

_RESULT = typer.Argument(help="result.nc of a simulation, all of it.")
_TIME = typer.Option(min=0, help="Which of the result's times, counted from 0.")
_SAMPLED = typer.Option(min=1, help="Pixels that are checked.")
_SEED = typer.Option(min=0, help="Seed of the draws.")
_FIRE = typer.Option(
    metavar="SHARE,KELVIN",
    help="What burns in every pixel where fires are asked for.",
)
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
            nir_report.write_picture(folder / "nir_test.png", study, image)
            rows = [*nir_report.rows_of(study), *nir_report.account_of(study, image)]
            (folder / "nir_test.csv").write_text(nir_report.csv_of(rows))
    _say("nir_test", out, nir_report.report_lines(study, image))


def sensitivity(
    context: typer.Context,
    result: Annotated[Path, _RESULT],
    of: Annotated[
        str,
        typer.Option(
            help="What is looked at, by commas: bands (brf; C05 and C06 with the light of the "
            "scene's fires, or beside fire_contrast with that of --fire), green (derived; "
            "green:bah2018 and so on; green_band is simulated), fire_contrast."
        ),
    ],
    to: Annotated[
        str,
        typer.Option(
            help=f"What is changed, by commas: {', '.join(SHORT_NAMES)}; of one band "
            f"{', '.join(f'{name}_C03' for name in BY_BAND)}; or a path in the state, such as "
            "atmosphere.gases.methane, which is changed by a factor."
        ),
    ],
    out: Annotated[Path, _OUT],
    species: Annotated[
        str | None, typer.Option(help="Name of the plume, where the result has several.")
    ] = None,
    where: Annotated[
        str, typer.Option(help="Pixels to look at: plume, where there is one, or all.")
    ] = "plume",
    sigma: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="Step and standard deviation of an input, in place of the declared one; of a path "
            "in the state relative, as it is changed by a factor.",
        ),
    ] = None,
    correlation: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME,NAME=VALUE", help="Between two inputs; 0 without."),
    ] = None,
    fire: Annotated[str, _FIRE] = "0.04,800",
    second_order: Annotated[
        bool, typer.Option(help="Find second derivatives, which takes the longest.")
    ] = True,
    samples: Annotated[
        int, typer.Option(min=0, help="Draws a pixel to check the variance by; 0 for no check.")
    ] = 256,
    sampled_pixels: Annotated[int, _SAMPLED] = 64,
    seed: Annotated[int, _SEED] = 0,
    time: Annotated[int, _TIME] = 0,
) -> None:
    """Tell how a scene's image hangs on what is in the scene, and which of it counts most.

    Exact derivatives, elasticities, the change for a step up and down, second derivatives and each
    input's part of the variance, checked by sampling. Writes maps (sensitivity.nc), a picture
    (sensitivity.png) and the rankings that are printed (sensitivity.csv).

    \b
    abi-operator sensitivity ash/result.nc --of C03,green,fire_contrast \\
        --to aod_550,ssa,albedo --out ash/sensitivity
    """
    with one_sentence():
        image = read_image(result, time)
        study = sensitivity_study(
            image,
            _names(of),
            _names(to),
            species=species,
            where=where,  # pyright: ignore[reportArgumentType]
            sigma=_once([_pair(text, "--sigma") for text in sigma or []], "--sigma"),
            correlations=_once([_correlation(text) for text in correlation or []], "--correlation"),
            fire=_fire(fire),
            second_order=second_order,
            sampling=Sampling(samples, sampled_pixels, seed),
        )
        study.attrs["history"] = history(context, image)
        with output_folder(out) as folder:
            write_dataset(study, folder / "sensitivity.nc")
            sensitivity_report.write_picture(folder / "sensitivity.png", study)
            table = sensitivity_report.csv_of(sensitivity_report.ranking(study))
            (folder / "sensitivity.csv").write_text(table)
    _say("sensitivity", out, sensitivity_report.report_lines(study))


def figure(
    context: typer.Context,
    name: Annotated[str, typer.Argument(help="One of green, albedo and fires.")],
    result: Annotated[Path, _RESULT],
    out: Annotated[Path, _OUT],
    fire: Annotated[str, _FIRE] = "0.04,800",
    time: Annotated[int, _TIME] = 0,
) -> None:
    """Draw one of the paper's arguments on a scene.

    green: derived green beside simulated light of 0.555 um. albedo: how fires and a plume stand
    out from land with MODIS and with constant albedo. fires: which fires show in C06, by the
    ground, the time of day and their temperature. Writes NAME.png and, of maps, NAME.nc, and
    prints figures.

    \b
    abi-operator figure green ash/result.nc --out ash/figures
    """
    if name not in _FIGURES:
        raise typer.BadParameter(f"no figure {name!r}; choose from {', '.join(_FIGURES)}.")
    with one_sentence():
        image = read_image(result, time)
        drawn = _FIGURES[name](image, _fire(fire))
        with output_folder(out) as folder:
            write_panels(folder / f"{name}.png", drawn.panels, drawn.columns, drawn.caption)
            if drawn.fields:
                maps = drawn.maps(image).assign_attrs(history=history(context, image))
                write_dataset(maps, folder / f"{name}.nc")
    typer.echo(f"wrote {out / name}.png")
    if drawn.fields:
        typer.echo(f"wrote {out / name}.nc")
    for line in drawn.lines:
        typer.echo(line)


_FIGURES = {
    "green": lambda image, _fire: green_figure(image),
    "albedo": albedo_figure,
    "fires": fires_figure,
}


def _say(name: str, out: Path, lines: list[str]) -> None:
    for ending in ("nc", "png", "csv"):
        typer.echo(f"wrote {out / name}.{ending}")
    for line in lines:
        typer.echo(line)


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",")]


def _pair(text: str, option: str) -> tuple[str, float]:
    """A name and a number, of ``NAME=VALUE``."""
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise InputError(f"{option} takes NAME=VALUE with a number; got {text!r}.") from None


def _once(pairs: list[tuple[Any, float]], option: str) -> dict[Any, float]:
    """Numbers by what they are of, which an option gives once."""
    found = dict(pairs)
    if len(found) < len(pairs):
        raise InputError(f"{option} takes each name or pair once; got one of them more often.")
    return found


def _correlation(text: str) -> tuple[tuple[str, str], float]:
    names, value = _pair(text, "--correlation")
    first, _, second = (name.strip() for name in names.partition(","))
    return (first, second), value


def _fire(text: str) -> Fire:
    try:
        fraction, temperature = (float(x) for x in text.split(","))
    except ValueError:
        raise InputError(f"--fire takes a share and a temperature in K; got {text!r}.") from None
    return Fire(fraction, temperature)  # pyright: ignore[reportArgumentType]


def read_image(path: Path, time: int) -> xr.Dataset:
    """One time of a result, in memory; an `InputError` where there is none of that number."""
    with read_result(path) as result:
        if time >= result.sizes["time"]:
            raise InputError(
                f"{path} has {result.sizes['time']} times, counted from 0; got --time {time}."
            )
        return load_all(result.isel(time=time), path)


def history(context: typer.Context, image: xr.Dataset) -> str:
    """The command that is running, and before it what made the result."""
    return "\n".join([typed(context), str(image.attrs.get("history", ""))])


def write_dataset(dataset: xr.Dataset, path: Path) -> None:
    """Write maps as NetCDF."""
    compressed = {name: {"zlib": True, "complevel": 1} for name in dataset.data_vars}
    unfilled = {name: {"_FillValue": None} for name in dataset.coords}
    # A projection is named as such, and not among the coordinates.
    named = dataset.reset_coords([name for name in ("crs",) if name in dataset.coords])
    named.to_netcdf(path, engine="netcdf4", encoding=compressed | unfilled)
