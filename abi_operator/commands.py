"""What the commands of this package and of others that join its command line share."""

from collections.abc import Iterator
from contextlib import contextmanager

import typer

from .files import InputError


@contextmanager
def one_sentence() -> Iterator[None]:
    """Say what is wrong with an input in one sentence, and leave with exit code 2."""
    try:
        yield
    except InputError as error:
        typer.echo(f"abi-operator: {error}", err=True)
        raise typer.Exit(2) from None
