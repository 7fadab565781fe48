"""Liquid cloud as paths through the layers, and the condensate that is left out."""

from typing import NamedTuple

import numpy as np
import xarray as xr

from ..constants import FREEZING
from .column_air import dry_air_path

NOT_SIMULATED = {
    "rain": "rain_mixing_ratio",
    "cloud ice": "ice_mixing_ratio",
    "snow": "snow_mixing_ratio",
    "graupel": "graupel_mixing_ratio",
    "hail": "hail_mixing_ratio",
}
"""Condensate that the operator does not simulate: its variable in a model Dataset."""

# WRF's number of WSM3, in which cloud water below 0 C is ice. (WRF Registry; Hong et al. 2004,
# doi:10.1175/1520-0493(2004)132<0103:ARATIM>2.0.CO;2)
_WSM3 = 3


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


class LiquidPaths(NamedTuple):
    """Droplets of the layers (layer, y, x), and in how many layers their number is assumed.

    Parameters
    ----------
    mass, number
        Mass and number per horizontal area. [kg m-2], [m-2]
    num_assumed
        Layers in which the number is assumed and not the model's. [-]
    """

    mass: np.ndarray
    number: np.ndarray
    num_assumed: int


def liquid_paths(model: xr.Dataset, assumed: DropletNumber) -> LiquidPaths:
    """Mass and number of droplets in the layers of a model.

    The number is the model's where it has one; where there is cloud water without it, it is
    `assumed` times the thickness of the layer.
    """
    air = dry_air_path(model)
    mass = air * model["cloud_mixing_ratio"].values
    if "cloud_number_mixing_ratio" in model:
        number = air * model["cloud_number_mixing_ratio"].values
    else:
        number = np.zeros_like(mass)
    without = (mass > 0) & (number == 0)
    thickness = -np.diff(model["height"].values, axis=0)
    number = np.where(without, assumed.over(model) * thickness, number)
    return LiquidPaths(mass, number, int(without.sum()))


class Condensate(NamedTuple):
    """Condensate of a model, summed over layers and columns. [kg m-2]

    Parameters
    ----------
    total
        All condensate.
    left_out
        By kind, what is not simulated; kinds of which there is none are not listed.
    ice_as_droplets
        Cloud water that is ice in truth and is simulated as droplets.
    """

    total: float
    left_out: dict[str, float]
    ice_as_droplets: float


def condensate(model: xr.Dataset) -> Condensate:
    """Weigh the condensate of a model that is simulated, and that is not."""
    air = dry_air_path(model)
    liquid = air * model["cloud_mixing_ratio"].values
    left_out = {
        kind: float((air * model[name].values).sum())
        for kind, name in NOT_SIMULATED.items()
        if name in model
    }
    left_out = {kind: mass for kind, mass in left_out.items() if mass > 0}
    frozen = model["temperature"].values < FREEZING
    wsm3 = model.attrs.get("microphysics_scheme") == _WSM3
    return Condensate(
        total=float(liquid.sum()) + sum(left_out.values()),
        left_out=left_out,
        ice_as_droplets=float(liquid[frozen].sum()) if wsm3 else 0.0,
    )
