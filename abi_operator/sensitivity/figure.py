"""What a figure is: panels, lines that are printed, and the maps behind it."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..files.result import CONVENTIONS
from .panels import Panel
from .place import with_place


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

    def maps(self, image: xr.Dataset) -> xr.Dataset:
        """The maps where and when the result is that they were made of."""
        fields = {
            name: (("y", "x"), values, {"units": "1", "long_name": name.replace("_", " ")})
            for name, values in self.fields.items()
        }
        attributes = {"Conventions": CONVENTIONS, "title": self.caption}
        return with_place(xr.Dataset(fields, attrs=attributes), image)
