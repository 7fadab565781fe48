"""What an experiment is."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import xarray as xr

if TYPE_CHECKING:  # which only drawing needs
    from matplotlib.figure import Figure


class Experiment(NamedTuple):
    """A question, as two functions.

    Parameters
    ----------
    run
        From ``size`` and ``seed``, both by name and with defaults, to a Dataset whose attribute
        ``rows`` names the dimensions of the table.
    draw
        Onto a figure of matplotlib, from that Dataset.
    """

    run: Callable[..., xr.Dataset]
    draw: "Callable[[xr.Dataset, Figure], None]"

    @property
    def sentence(self) -> str:
        """The question, the first sentence of the function's docstring."""
        return (self.run.__doc__ or "").strip().split("\n\n")[0].replace("\n    ", " ")
