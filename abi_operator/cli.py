"""The command line: ``abi-operator`` and its commands.

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
from collections.abc import Callable
from functools import partial
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Annotated, Any

import jax
import typer

from . import _ending
from ._version import __version__
from .bands import GRASSO2013
from .commands import one_sentence, typed, user_warnings
from .demo import write_demo
from .files import output_folder
from .guard.commands import jacobian
from .machine import kept
from .machine.speed import default_cache_folder, use_compilation_cache, use_compiler_flags
from .observe_command import observe
from .sensitivity.commands import figure, nir_test, sensitivity
from .simulate_command import print_report, simulate
from .simulation import Request, Species, open_scene, pictures_of_before, simulate_scene

COMMANDS = "abi_operator.commands"
"""Group of the entry points by which other packages add commands."""

# Albedo of the sea in the demonstration. [-]
_DEMO_OCEAN_ALBEDO = 0.03
# Streams of the solver there. [-]
_DEMO_STREAMS = 8

_NO_CACHE = "--no-cache"
_NO_CACHE_HELP = "Use and keep no compiled programs; also behind a command's name."
_VERSION = "Say which version this is."


def demo(
    context: typer.Context,
    size: Annotated[int, typer.Option(min=8, help="Rows and columns of the scene.")] = 64,
    out: Annotated[Path, typer.Option(help="Folder for inputs and results.")] = Path("abi-demo"),
    seed: Annotated[int, typer.Option(min=0, help="Another seed is another coast.")] = 0,
    plume: Annotated[
        Species, typer.Option(help="What the plumes are made of; ash, at 8 to 11 km.")
    ] = Species.SMOKE,
) -> None:
    """Make up a smoky Californian coast and simulate it: a first run, which needs no files.

    Writes model output, albedo, a plume's picture and a table of fires, as `abi-operator simulate`
    takes them, into the folder inputs, and beside it result.nc and a picture of it in natural
    colours. Where the retrievals are installed, which come with this package, the smoke is then
    retrieved from the simulated image and compared with the smoke that was made up (retrieval.nc,
    scores.csv). With --plume ash the same plumes are of volcanic ash, for `abi-operator nir-test`;
    none is retrieved.
    """
    with one_sentence(), user_warnings():
        before = pictures_of_before(out)
        outdated = partial(pictures_of_before, out)
        # A large scene is simulated in blocks, those of which that are done a next run finds.
        with output_folder(out, outdated=outdated, keeps_parts=True) as folder:
            inputs = write_demo(folder / "inputs", size=size, seed=seed)
            # As in the paper, which neglects absorption by gases. Nothing is left out, since the
            # retrieval is to find the very optical depths that made the image; and few streams, as
            # most of a first run is compiling.
            request = Request(
                inputs.wrf,
                inputs.albedo,
                _DEMO_OCEAN_ALBEDO,
                inputs.plume,
                plume_species=plume,
                bands=GRASSO2013 if plume == Species.SMOKE else (*GRASSO2013, "green"),
                gases=(),
                num_streams=_DEMO_STREAMS,
                error_budget=None,
            )
            request = request._replace(command=typed(context))
            report = simulate_scene(open_scene(request), folder)
        print_report(report, out, before)
    if plume != Species.SMOKE:
        return
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
    app.command()(observe)
    app.command()(nir_test)
    app.command()(sensitivity)
    app.command()(figure)
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
    with user_warnings():
        folder = use_compilation_cache()
    if folder is not None:
        kept.use(folder)


def main(name: str | None = None) -> None:
    """Run the command line, in a process of its own, which help calls by its name."""
    words = sys.argv[1:]
    # An option of all commands, which may stand behind the name of one as well.
    if _NO_CACHE in words:
        words = [_NO_CACHE, *(word for word in words if word != _NO_CACHE)]
    make_app(_prepare_process)(words, prog_name=name)
