"""The command line: ``abi-operator simulate`` and ``abi-operator demo``.

Inputs are opened and checked before a folder is made; what is wrong with one of them is said in
one sentence, with exit code 2. Other packages add commands of their own by entry points of the
group ``abi_operator.commands``; the entry named ``demo`` is called at the end of the demonstration
with the folder that holds its result.

All commands run in float64, with the processor's widest vectors, and keep what they compile
(``--no-cache``). Every usable core works without being told: the operator cuts its columns among
threads, and so do the retrievals. More CPU devices of JAX would do nothing for either.
"""

import gc
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Annotated, Any

import jax
import typer

from . import _ending, _kept
from ._version import __version__
from .bands import BANDS, GRASSO2013, check_bands
from .commands import one_sentence
from .demo import write_demo
from .files import output_folder
from .guard.commands import jacobian
from .microphysics import SCHEMES
from .optics import ALL_GASES
from .satellites import SATELLITES
from .scene import CLASSES, DropletNumber
from .simulation import (
    Report,
    Request,
    Species,
    open_scene,
    pictures_of_before,
    simulate_scene,
)
from .speed import default_cache_folder, usable_cores, use_compilation_cache, use_compiler_flags
from .surface import EMISSIVITY_3900NM, SNOW_AND_ICE_ALBEDO

COMMANDS = "abi_operator.commands"
"""Group of the entry points by which other packages add commands."""

# Albedo of the sea in the demonstration. [-]
_DEMO_OCEAN_ALBEDO = 0.03

_ALL, _NONE = "all", "none"
_NO_CACHE = "--no-cache"
_NO_CACHE_HELP = "Use and keep no compiled programs; also behind a command's name."
_VERSION = "Say which version this is."
_IMAGER_BANDS = tuple(name for name in BANDS if name != "green")


@contextmanager
def _user_warnings() -> Iterator[None]:
    """Collect warnings; print each once, as a plain line, at the end."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        yield
    for message in dict.fromkeys(str(warning.message) for warning in caught):
        typer.echo(f"warning: {message}", err=True)


def _print(report: Report, out: Path, before: list[str]) -> None:
    for name in report.files:
        typer.echo(f"wrote {out / name}")
    for name in sorted(set(before) - set(report.files)):
        typer.echo(f"removed {out / name}, a picture of the result before")
    for line in report.lines:
        typer.echo(line)
    cores = usable_cores()
    typer.echo(f"computed on {cores} core{'s' if cores > 1 else ''}")


def simulate(
    wrf: Annotated[
        list[Path],
        typer.Argument(
            metavar="WRFOUT...",
            help="Output of WRF: one file or more of one domain, any times, or patterns of names.",
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder for the result and its pictures.")],
    time: Annotated[
        str | None,
        typer.Option(
            help="Times to simulate, as 2005-08-28T12:00 or 2005-08-28 for those of a day, or "
            "counted from 0; several by commas. All without."
        ),
    ] = None,
    bands: Annotated[
        str, typer.Option(help=f"Bands to simulate, of {', '.join(BANDS)}; all: C01 to C07.")
    ] = ",".join(GRASSO2013),
    albedo: Annotated[
        Path | None, typer.Option(help="MODIS albedo, MCD43A1 in NetCDF from AppEEARS.")
    ] = None,
    ocean_albedo: Annotated[
        float | None, typer.Option(min=0, max=1, help="Albedo of water, in all bands but C07.")
    ] = None,
    land_albedo: Annotated[
        str | None,
        typer.Option(
            help="Albedo of land that the albedo file, if any, has none of: a number for all bands "
            "but C07, or model (its own, broadband)."
        ),
    ] = None,
    sea_ice_albedo: Annotated[
        str | None,
        typer.Option(
            help="Albedo of sea ice, where the model has some: a number for all bands but C07, or "
            f"one of {', '.join(SNOW_AND_ICE_ALBEDO)}. Without it such columns are left out."
        ),
    ] = None,
    snow_albedo: Annotated[
        str | None,
        typer.Option(
            help="Albedo of the model's snow on the ground, likewise. Without it the ground has "
            "that of the file."
        ),
    ] = None,
    broadband: Annotated[
        bool, typer.Option(help="Let broadband albedo stand in for missing spectral bands.")
    ] = False,
    emissivity: Annotated[
        str | None,
        typer.Option(
            help="Of the ground in C07: a number, model (its own, broadband), land-use (that of "
            "each column's land use), or one of "
            f"{', '.join(EMISSIVITY_3900NM)}."
        ),
    ] = None,
    plume: Annotated[
        Path | None, typer.Option(help="Greyscale PNG, one pixel a column, north at the top.")
    ] = None,
    plume_species: Annotated[Species, typer.Option(help="What the plume is made of.")] = (
        Species.SMOKE
    ),
    plume_aod: Annotated[
        float, typer.Option(min=0, help="Optical depth at 550 nm where the plume is white.")
    ] = 2.0,
    gases: Annotated[
        str, typer.Option(help=f"Gases that absorb: all, none, or some of {', '.join(ALL_GASES)}.")
    ] = _ALL,
    hydrometeors: Annotated[
        str,
        typer.Option(help=f"Beside cloud water: all, none, or some of {', '.join(CLASSES)}."),
    ] = _ALL,
    microphysics: Annotated[
        str | None,
        typer.Option(
            help="Scheme to assume in place of the model's where it gives no number of particles: "
            f"{', '.join(SCHEMES)}."
        ),
    ] = None,
    droplet_number: Annotated[
        str | None,
        typer.Option(
            metavar="N | WATER,LAND",
            help="Cloud droplets per cm3 where the model has no number of them; if not given, what "
            "its microphysics assumes, or else 100,300.",
        ),
    ] = None,
    satellite: Annotated[str, typer.Option(help=f"One of {', '.join(SATELLITES)}.")] = "GOES-16",
    satellite_longitude: Annotated[
        float | None,
        typer.Option(min=-180, max=360, help="In degrees, east positive, if not as usual."),
    ] = None,
    num_streams: Annotated[int, typer.Option(min=2, help="Streams of the solver, even.")] = 8,
) -> None:
    """Simulate what the imager would see of a scene in a weather model's output."""
    if num_streams % 2:
        raise typer.BadParameter(f"the number of streams is even; got {num_streams}.")
    try:
        names = check_bands(_names(bands, _IMAGER_BANDS))
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    with one_sentence():
        droplets = None if droplet_number is None else DropletNumber.from_text(droplet_number)
    request = Request(
        wrf,
        time=time,
        bands=names,
        albedo=albedo,
        ocean_albedo=ocean_albedo,
        land_albedo=_number(land_albedo),
        sea_ice_albedo=_number(sea_ice_albedo),
        snow_albedo=_number(snow_albedo),
        broadband=broadband,
        emissivity=_number(emissivity),
        plume=plume,
        plume_species=plume_species,
        plume_aod=plume_aod,
        gases=_names(gases, ALL_GASES),
        hydrometeors=None if hydrometeors == _ALL else _names(hydrometeors, CLASSES),
        microphysics=microphysics,
        droplet_number=droplets,
        satellite=satellite,
        satellite_longitude=satellite_longitude,
        num_streams=num_streams,
    )
    with one_sentence(), _user_warnings():
        scene = open_scene(request)
        before = pictures_of_before(out)
        with output_folder(out, outdated=before) as folder:
            report = simulate_scene(scene, folder)
        _print(report, out, before)


def _names(text: str, everything: tuple[str, ...]) -> tuple[str, ...]:
    """Names that are separated by commas; all of them, or none."""
    if text in (_ALL, _NONE):
        return everything if text == _ALL else ()
    return tuple(name.strip() for name in text.split(","))


def _number(text: str | None) -> float | str | None:
    """A number where the text is one."""
    try:
        return None if text is None else float(text)
    except ValueError:
        return text


def demo(
    size: Annotated[int, typer.Option(min=8, help="Rows and columns of the scene.")] = 64,
    out: Annotated[Path, typer.Option(help="Folder for inputs and results.")] = Path("abi-demo"),
    seed: Annotated[int, typer.Option(min=0, help="Another seed is another coast.")] = 0,
) -> None:
    """Make up a smoky Californian coast, simulate it, retrieve the smoke and score the result."""
    with one_sentence(), _user_warnings():
        before = pictures_of_before(out)
        with output_folder(out, outdated=before) as folder:
            inputs = write_demo(folder / "inputs", size=size, seed=seed)
            # As in the paper, which neglects absorption by gases.
            request = Request(inputs.wrf, inputs.albedo, _DEMO_OCEAN_ALBEDO, inputs.plume, gases=())
            report = simulate_scene(open_scene(request), folder)
        _print(report, out, before)
    for entry in entry_points(group=COMMANDS, name="demo"):
        finish_demo = _load(entry)
        if finish_demo is not None:
            with one_sentence():
                finish_demo(out)


def _load(entry: EntryPoint) -> Callable[..., Any] | None:
    """What an entry point names, or None with a note where its package does not import."""
    try:
        return entry.load()
    except Exception as error:  # whatever ails another package, our own commands work
        typer.echo(f"note: {entry.name} of {entry.module} is not available ({error})", err=True)
        return None


def make_app(prepare: Callable[[bool], None] = lambda keep_programs: None) -> typer.Typer:
    """Build the command line with our commands and those of other packages.

    Parameters
    ----------
    prepare
        Called before any command, with whether it may keep what it compiles.
    """
    app = typer.Typer(
        help="Differentiable synthetic imagery of the GOES-R Advanced Baseline Imager."
        f"\n\n\b\nCompiled programs are kept for the next command in\n{_cache_folder()}",
        no_args_is_help=True,
        add_completion=False,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},  # of all commands
    )

    @app.callback()
    def before_every_command(  # pyright: ignore[reportUnusedFunction]
        context: typer.Context,
        no_cache: Annotated[bool, typer.Option(_NO_CACHE, help=_NO_CACHE_HELP)] = False,
        version: Annotated[
            bool, typer.Option("--version", callback=_say_version, is_eager=True, help=_VERSION)
        ] = False,
    ) -> None:
        prepare(not no_cache)
        context.with_resource(jax.enable_x64(True))

    app.command()(simulate)
    app.command()(demo)
    app.add_typer(jacobian, name="jacobian")
    for entry in sorted(entry_points(group=COMMANDS), key=lambda entry: entry.name):
        command = None if entry.name == "demo" else _load(entry)
        if command is not None:
            app.command(entry.name)(command)
    return app


def _say_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"abi-operator {__version__}")
        raise typer.Exit


def _cache_folder() -> str:
    try:
        return str(default_cache_folder())
    except RuntimeError:
        return "the user's cache folder"


def _prepare_process(keep_programs: bool) -> None:
    """Settle how a process of our own ends and what it computes with, before JAX starts."""
    _ending.end_at_signals()
    # Tracing makes many small objects that stay; a tenth of it is a search for some that do not.
    gc.freeze()
    gc.set_threshold(50_000)
    use_compiler_flags()
    if not keep_programs:
        jax.config.update("jax_enable_compilation_cache", False)
    with _user_warnings():
        folder = use_compilation_cache()
    if folder is not None:
        _kept.use(folder)


def main(name: str | None = None) -> None:
    """Run the command line, in a process of its own, which help calls by its name."""
    words = sys.argv[1:]
    # An option of all commands, which may stand behind the name of one as well.
    if _NO_CACHE in words:
        words = [_NO_CACHE, *(word for word in words if word != _NO_CACHE)]
    make_app(_prepare_process)(words, prog_name=name)
