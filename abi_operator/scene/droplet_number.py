"""Number of cloud droplets, where a model has none."""

from typing import NamedTuple

import numpy as np
import xarray as xr


class DropletNumber(NamedTuple):
    """Number of droplets per volume of cloud, where the model has none. [m-3]

    The defaults are round numbers typical of marine and of continental stratiform cloud in the
    observations that Miles et al. [1]_ collected.

    Parameters
    ----------
    water, land
        Over either, where the model has a land mask.
    unknown
        Where it has none.

    References
    ----------
    .. [1] N. L. Miles et al., "Cloud droplet size distributions in low-level stratiform clouds",
       J. Atmos. Sci., 57, 295-311, 2000,
       doi:10.1175/1520-0469(2000)057<0295:CDSDIL>2.0.CO;2
    """

    water: float = 100e6
    land: float = 300e6
    unknown: float = 100e6

    def over(self, model: xr.Dataset) -> np.ndarray:
        """Number per volume in each column (y, x). [m-3]"""
        if "land_mask" not in model:
            return np.full((model.sizes["y"], model.sizes["x"]), self.unknown)
        return np.where(model["land_mask"].values > 0, self.land, self.water)

    def describe(self, model: xr.Dataset) -> str:
        """Say which numbers are assumed."""
        if "land_mask" not in model:
            return f"{self.unknown / 1e6:g} cm-3"
        return f"{self.water / 1e6:g} cm-3 over water, {self.land / 1e6:g} cm-3 over land"
