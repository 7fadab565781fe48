"""Pictures with several panels: maps, their colours, and histograms, each under its title."""

from collections.abc import Sequence
from os import PathLike
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageDraw, ImageFont

# ColorBrewer's RdBu of 11 classes (C. Brewer and M. Harrower, colorbrewer2.org), blue first.
_BLUE_TO_RED = (
    np.array(
        [
            (5, 48, 97),
            (33, 102, 172),
            (67, 147, 195),
            (146, 197, 222),
            (209, 229, 240),
            (247, 247, 247),
            (253, 219, 199),
            (244, 165, 130),
            (214, 96, 77),
            (178, 24, 43),
            (103, 0, 31),
        ]
    )
    / 255
)
# Lines of a histogram, and where there is no value. [0 to 1]
_LINES = ((178, 24, 43), (33, 102, 172), (27, 120, 55))
_NOTHING = 0.8

# Of a panel, its title, its bar and the room around it. [pixels]
_WIDTH, _TITLE, _BAR, _MARGIN, _FONT = 384, 24, 34, 14, 14


class Bar(NamedTuple):
    """Colours of a map and the values at their ends, with a unit."""

    low: float
    high: float
    unit: str


class Panel(NamedTuple):
    """One map (y, x, 3), 0 to 1, the southernmost row first, or a histogram as it is."""

    title: str
    picture: np.ndarray
    bar: Bar | None = None
    is_map: bool = True


def change_map(title: str, values: np.ndarray, largest: float, unit: str) -> Panel:
    """Map of changes: blue below zero, red above it, white where nothing changes, NaN grey.

    Parameters
    ----------
    title, unit
        What it is of.
    values
        Changes (y, x).
    largest
        Value of the darkest red, and less zero of the darkest blue.
    """
    return Panel(title, _diverging(values / largest), Bar(-largest, largest, unit))


def histogram(
    title: str, series: dict[str, np.ndarray], low: float, high: float, unit: str
) -> Panel:
    """Shares of pixels by value, of several series over one another.

    Parameters
    ----------
    title, unit
        What it is of.
    series
        Values by name; those beyond the ends count at the ends.
    low, high
        Ends of the axis.
    """
    picture = Image.new("RGB", (_WIDTH, _WIDTH), "white")
    draw, edges = ImageDraw.Draw(picture), np.linspace(low, high, 49)
    bottom, room = _WIDTH - 30, _WIDTH - 60
    shares = {
        name: np.histogram(np.clip(x, low, high), edges)[0] / max(len(x), 1)
        for name, x in series.items()
    }
    most = max(max(share.max() for share in shares.values()), 1e-9)
    step = _WIDTH / (len(edges) - 1)
    for k, (name, share) in enumerate(shares.items()):
        colour = _LINES[k % len(_LINES)]
        heights = bottom - room * share / most
        outline = [(0.0, float(bottom))]
        for i, height in enumerate(heights):
            outline += [(i * step, float(height)), ((i + 1) * step, float(height))]
        draw.line([*outline, (float(_WIDTH), float(bottom))], fill=colour, width=2)
        draw.text((8, 4 + 18 * k), name, fill=colour, font=_font())
    draw.line([(0, bottom), (_WIDTH, bottom)], fill="black")
    _ends(draw, bottom + 6, Bar(low, high, unit))
    draw.text((_WIDTH - 8, 4), f"{100 * most:.0f} % a bin", fill="black", font=_font(), anchor="ra")
    return Panel(title, np.asarray(picture) / 255, is_map=False)


def scatter(title: str, x: np.ndarray, y: np.ndarray, high: float, axes: str) -> Panel:
    """How many pixels have which pair of values, the darker the more, and the line of equals.

    Parameters
    ----------
    title, axes
        What it is of, and what the axes are.
    x, y
        Pairs.
    high
        Where both axes, which begin at 0, end; pairs beyond are not shown.
    """
    count = np.histogram2d(y, x, 96, ((0, high), (0, high)))[0]
    shade = np.log1p(count) / max(float(np.log1p(count.max())), 1e-9)
    field = np.kron(1 - shade[::-1], np.ones((_WIDTH // 96, _WIDTH // 96)))
    levels = np.repeat(np.rint(255 * field)[..., None], 3, axis=-1).astype(np.uint8)
    picture = Image.fromarray(levels)
    draw = ImageDraw.Draw(picture)
    draw.line([(0, _WIDTH - 1), (_WIDTH - 1, 0)], fill=_LINES[0], width=1)
    draw.rectangle([0, 0, _WIDTH - 1, _WIDTH - 1], outline="black")
    draw.text((8, 4), f"{axes}, 0 to {high:.2g}", fill="black", font=_font())
    return Panel(title, np.asarray(picture) / 255, is_map=False)


def curves(
    title: str,
    x: np.ndarray,
    series: dict[str, np.ndarray],
    low: float,
    high: float,
    axes: str,
    *,
    period: float | None = None,
) -> Panel:
    """Lines over one another, NaN left out.

    Parameters
    ----------
    title, axes
        What it is of, and what the axes are.
    x
        Rising values of the first axis, which runs between them.
    series
        Values by name, each as long as x.
    low, high
        Ends of the second axis; beyond them lines run along the edge.
    period
        Of the first axis, on which numbers begin again at 0 as hours do at 24; None where they
        do not.
    """
    picture = Image.new("RGB", (_WIDTH, _WIDTH), "white")
    draw, bottom, top = ImageDraw.Draw(picture), _WIDTH - 30, 44
    across = (x - x[0]) / (x[-1] - x[0]) * (_WIDTH - 1)
    for k, (name, values) in enumerate(series.items()):
        share = np.clip((values - low) / (high - low), 0, 1)
        colour = _curve_colour(k, len(series))
        good = np.isfinite(values)
        points = [
            (float(a), float(bottom - s * (bottom - top)))
            for a, s in zip(across[good], share[good], strict=True)
        ]
        if len(points) > 1:
            draw.line(points, fill=colour, width=2)
        draw.text((8 + 74 * k, 4), name, fill=colour, font=_font())
    draw.rectangle([0, top, _WIDTH - 1, bottom], outline="black")
    draw.text((8, 24), f"{axes}, {low:.3g} to {high:.3g}", fill="black", font=_font())
    _ends(draw, bottom + 6, Bar(float(x[0]), float(x[-1]), ""), sign="", period=period)
    return Panel(title, np.asarray(picture) / 255, is_map=False)


def write_panels(
    path: str | PathLike[str], panels: Sequence[Panel], columns: int, caption: str = ""
) -> None:
    """Write panels as one PNG, row by row.

    Parameters
    ----------
    path
        The file to write.
    panels
        The first is at the upper left.
    columns
        Panels in a row.
    caption
        A line beneath them all.
    """
    pictures = [_drawn(panel) for panel in panels]
    height = max(picture.height for picture in pictures) + _MARGIN
    rows = -(-len(pictures) // columns)
    foot = _TITLE if caption else 0
    size = columns * (_WIDTH + _MARGIN) + _MARGIN, rows * height + _MARGIN + foot
    sheet = Image.new("RGB", size, "white")
    for k, picture in enumerate(pictures):
        place = _MARGIN + (k % columns) * (_WIDTH + _MARGIN), _MARGIN + (k // columns) * height
        sheet.paste(picture, place)
    if caption:
        draw = ImageDraw.Draw(sheet)
        draw.text((_MARGIN, rows * height + _MARGIN), caption, fill="black", font=_font())
    sheet.save(path, format="PNG")


def _drawn(panel: Panel) -> Image.Image:
    missing = np.isnan(panel.picture).any(axis=-1, keepdims=True)
    levels = np.rint(255 * np.clip(np.where(missing, _NOTHING, panel.picture), 0, 1))
    image = Image.fromarray((np.flipud(levels) if panel.is_map else levels).astype(np.uint8))
    height = max(1, round(image.height * _WIDTH / image.width))
    image = image.resize((_WIDTH, height), Image.Resampling.NEAREST)
    sheet = Image.new("RGB", (_WIDTH, _TITLE + height + _BAR), "white")
    draw = ImageDraw.Draw(sheet)
    draw.text((0, 2), panel.title, fill="black", font=_font())
    sheet.paste(image, (0, _TITLE))
    if panel.bar is not None:
        colours = _diverging(np.broadcast_to(np.linspace(-1, 1, _WIDTH), (10, _WIDTH)))
        bar = Image.fromarray(np.rint(255 * colours).astype(np.uint8))
        sheet.paste(bar, (0, _TITLE + height + 4))
        _ends(draw, _TITLE + height + 16, panel.bar)
    return sheet


def _curve_colour(k: int, count: int) -> tuple[int, int, int]:
    """From blue, the first, to red."""
    shade = _diverging(np.array([[-0.8 + 1.6 * k / max(count - 1, 1)]]))[0, 0]
    red, green, blue = (int(x) for x in np.rint(200 * shade))
    return red, green, blue


def _ends(
    draw: ImageDraw.ImageDraw, y: float, bar: Bar, sign: str = "+", period: float | None = None
) -> None:
    texts = _end_texts(bar, sign, period)
    for text, x, anchor in zip(texts, (0, _WIDTH / 2, _WIDTH), ("la", "ma", "ra"), strict=True):
        draw.text((x, y), text, fill="black", font=_font(), anchor=anchor)


def _end_texts(bar: Bar, sign: str, period: float | None) -> tuple[str, str, str]:
    """What is written at the lower end, in the middle and at the upper end."""
    values = bar.low, (bar.low + bar.high) / 2, bar.high
    low, middle, high = (x if period is None else x % period for x in values)
    return f"{low:{sign}.4g}", f"{middle:.4g}", f"{high:{sign}.4g} {bar.unit}"


def _diverging(share: np.ndarray) -> np.ndarray:
    """Colours (y, x, 3) of values from -1, blue, over 0, white, to 1, red."""
    at = np.linspace(-1, 1, len(_BLUE_TO_RED))
    return np.stack([np.interp(share, at, channel) for channel in _BLUE_TO_RED.T], axis=-1)


def _font() -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(_FONT)
