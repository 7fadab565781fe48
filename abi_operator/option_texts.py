"""What is typed behind the options of a command: numbers, names, or either."""

import typer

from .scene import most_streams

ALL, NONE = "all", "none"


def streams(text: str) -> float:
    """An even number of streams, or the error that they may leave."""
    try:
        streams = float(text.removesuffix("%")) / 100 if text.endswith("%") else int(text)
        most = most_streams(streams) if streams < 1 else streams
    except ValueError as error:
        word = str(error) if "streams" in str(error) else f"got {text}."
        raise typer.BadParameter(f"streams are an even number or a percentage; {word}") from None
    if not streams > 0 or most < 2 or most % 2:
        raise typer.BadParameter(f"the number of streams is even, 2 or more; got {text}.")
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
