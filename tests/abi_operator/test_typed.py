"""What a file's history says was typed can be typed again."""

import shlex
from typing import Annotated

import typer
from typer.testing import CliRunner

from abi_operator.commands import typed


def test_options_given_more_than_once_are_repeated():
    app = typer.Typer()

    @app.command("study")
    def study(
        context: typer.Context,
        files: list[str],
        sigma: Annotated[list[str] | None, typer.Option()] = None,
        plot: bool = False,
    ) -> None:
        typer.echo(typed(context))

    words = ["a.nc", "b c.nc", "--sigma", "ssa=1", "--sigma", "aod=2", "--plot"]
    said = shlex.split(CliRunner().invoke(app, words).output)
    assert said == ["abi-operator", "study", *words]
