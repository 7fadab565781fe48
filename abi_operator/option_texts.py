"""What is typed behind the options of a command: numbers, names, or either."""

import typer

from .scene import most_streams

ALL, NONE = "all", "none"


def streams(text: str) -> float:
    """An even number of streams, or the error that they may leave."""
    share = text.endswith("%")
    try:
        streams = float(text.removesuffix("%")) / 100 if share else int(text)
    except ValueError:
        raise typer.BadParameter(
            f"streams are an even number or a percentage; got {text}."
        ) from None
    if share and not 0 < streams < 1:  # from 1 on it would count streams
        raise typer.BadParameter(
            f"the error that streams may leave is above 0% and below 100%; got {text}."
        )
    if not share and (streams < 2 or streams % 2):
        raise typer.BadParameter(f"the number of streams is even, 2 or more; got {text}.")
    try:
        most_streams(streams)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    return streams


def names(text: str, everything: tuple[str, ...]) -> tuple[str, ...]:
    """Names that are separated by commas; all of them, or none."""
    if text in (ALL, NONE):
        return everything if text == ALL else ()
    return tuple(name.strip() for name in text.split(","))


def number(text: str | None) -> float | str | None:
    """A number where the text is one."""
    try:
        return None if text is None else float(text)
    except ValueError:
        return text
