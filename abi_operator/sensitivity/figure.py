"""What a figure is: panels, lines that are printed, and the maps behind it."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from .panels import Panel


class Figure(NamedTuple):
    """A picture with what is said of it.

    Parameters
    ----------
    panels
        In order, row by row.
    columns
        Panels in a row.
    lines
        To be printed.
    fields
        Maps (y, x) by name, for a file.
    caption
        A line beneath the panels.
    """

    panels: Sequence[Panel]
    columns: int
    lines: Sequence[str]
    fields: Mapping[str, np.ndarray]
    caption: str
