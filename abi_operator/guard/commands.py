"""The commands ``abi-operator jacobian save``, ``check`` and ``accept``."""

from pathlib import Path
from typing import Annotated

import typer

from ..bands import BANDS
from ..commands import one_sentence
from .baseline import read_baseline, versions
from .comparison import Comparison
from .report import NUM_ROWS, report
from .scenario import STANDARD
from .workflow import accept, check, save

jacobian = typer.Typer(
    help="Guard values and Jacobians of all bands with respect to every input.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
"""The commands, for the command line to take in."""

_FILE = typer.Argument(metavar="FILE", help="The baseline, NetCDF.")
_SCENARIO = typer.Option(help="module:function or file.py:function that returns the states.")
_ROWS = typer.Option("--rows", min=1, help="Rows of the table to show.")


@jacobian.command("save")
def _save(
    file: Annotated[Path, _FILE],
    scenario: Annotated[str, _SCENARIO] = STANDARD,
    bands: Annotated[
        str | None, typer.Option(help="Bands, of " + ", ".join(BANDS) + "; all without.")
    ] = None,
    num_streams: Annotated[
        int | None, typer.Option(min=2, help="Streams, in place of the operator's default.")
    ] = None,
    satellite: Annotated[
        str | None, typer.Option(help="Satellite, in place of the operator's default.")
    ] = None,
) -> None:
    """Evaluate a scenario, by default the project's own columns, and write its baseline."""
    names = None if bands is None else tuple(name.strip() for name in bands.split(","))
    given = {"num_streams": num_streams, "satellite": satellite}
    settings = {name: value for name, value in given.items() if value is not None}
    with one_sentence():
        baseline = save(file, scenario, names, **settings)
    of = baseline.jacobians
    typer.echo(
        f"wrote {file}: {len(of.columns)} columns, {len(of.bands)} bands, {len(of.inputs)} inputs"
    )


@jacobian.command("check")
def _check(
    file: Annotated[Path, _FILE],
    scenario: Annotated[str | None, _SCENARIO] = None,
    rows: Annotated[int, _ROWS] = NUM_ROWS,
) -> None:
    """Evaluate what a baseline is of and compare; exit code 1 where something moved."""
    with one_sentence():
        comparison = check(file, scenario)
    typer.echo(f"{file}: {report(comparison, rows)}")
    if comparison:
        stored = read_baseline(file).versions
        for name, version in versions().items():
            if stored[name] != version:
                typer.echo(f"{name} is {version}, was {stored[name]}.")
        typer.echo(how_to_accept(file, scenario))
        raise typer.Exit(1)


@jacobian.command("accept")
def _accept(
    file: Annotated[Path, _FILE],
    reason: Annotated[str, typer.Option(help="Why it moved; kept in the file's history.")],
    scenario: Annotated[str | None, _SCENARIO] = None,
    rows: Annotated[int, _ROWS] = NUM_ROWS,
) -> None:
    """Replace a baseline by what is computed now, with a reason."""
    with one_sentence():
        comparison: Comparison = accept(file, reason, scenario)
    typer.echo(f"{file}: {report(comparison, rows)}")
    written = comparison or comparison.to_keep
    typer.echo(f"wrote {file}" if written else f"{file} stays as it is")


def how_to_accept(file: Path, scenario: str | None) -> str:
    """What to do where a change is wanted."""
    option = "" if scenario is None else f" --scenario {scenario}"
    return (
        "If you did not mean to change this, it is a bug. If you did, look at the table, then\n"
        f'  abi-operator jacobian accept {file}{option} --reason "what changed, and why"\n'
        "and commit the file: the reason is kept in its history."
    )
