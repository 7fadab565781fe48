"""What the commands of this package and of others that join its command line share."""

import shlex
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import typer

from .files import InputError
from .files.opening import leave_where_the_library_is_lost


@contextmanager
def one_sentence() -> Iterator[None]:
    """Say what is wrong with an input in one sentence, and leave with exit code 2."""
    try:
        yield
    except InputError as error:
        typer.echo(f"abi-operator: {error}", err=True)
        leave_where_the_library_is_lost(2)
        raise typer.Exit(2) from None


def typed(context: typer.Context) -> str:
    """The command that is running, with those options that were given, for a file's history."""
    words = ["abi-operator", context.info_name or ""]
    for parameter in context.command.params:
        source = context.get_parameter_source(parameter.name or "")
        if source is None or source.name != "COMMANDLINE":
            continue
        value = context.params[parameter.name or ""]
        if parameter.param_type_name == "argument":
            words += _words(value)
        elif isinstance(value, bool):
            words.append((parameter.opts if value else parameter.secondary_opts)[0])
        else:
            for word in _words(value):
                words += [parameter.opts[0], word]
    return shlex.join(words)


def _words(value: Any) -> list[str]:
    return [str(one) for one in value] if isinstance(value, list | tuple) else [str(value)]


@contextmanager
def user_warnings() -> Iterator[None]:
    """Collect warnings; print each once, as a plain line, at the end."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        yield
    for message in dict.fromkeys(str(warning.message) for warning in caught):
        typer.echo(f"warning: {message}", err=True)
