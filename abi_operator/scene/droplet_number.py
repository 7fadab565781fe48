"""Number of cloud droplets, where a model has none."""

import math
from typing import NamedTuple, Self

import numpy as np
import xarray as xr

from ..files import InputError
from ..microphysics import own_droplet_number

# Largest number that is believed: ten times that of the dirtiest clouds. [m-3] (It is smaller than
# any number per m3 would be that is taken for one per cm3.)
_LARGEST = 1e10


class DropletNumber(NamedTuple):
    """Number of droplets per volume of cloud, where the model has none. [m-3]

    The defaults are round numbers typical of marine and of continental stratiform cloud in the
    observations that Miles et al. [1]_ collected. They stand where the model's microphysics scheme
    assumes no number of its own (`assumed_droplets`).

    Parameters
    ----------
    water, land
        Over either, where the model has a land mask.
    unknown
        Where it has none; None where that is an error.

    References
    ----------
    .. [1] N. L. Miles et al., "Cloud droplet size distributions in low-level stratiform clouds",
       J. Atmos. Sci., 57, 295-311, 2000,
       doi:10.1175/1520-0469(2000)057<0295:CDSDIL>2.0.CO;2
    """

    water: float = 100e6
    land: float = 300e6
    unknown: float | None = 100e6

    @classmethod
    def everywhere(cls, number: float) -> Self:
        """The same number over water and land. [m-3]"""
        return cls(number, number, number)

    @classmethod
    def from_text(cls, text: str) -> Self:
        """Read ``"N"`` or ``"WATER,LAND"``, in droplets per cm3.

        Raises
        ------
        InputError
            Where the text is neither, or a number is out of range.
        """
        try:
            numbers = [1e6 * float(word) for word in text.split(",")]
        except ValueError:
            numbers = []
        if len(numbers) not in (1, 2):
            raise InputError(
                f"a number of droplets is N or WATER,LAND, in droplets per cm3; got {text!r}."
            )
        found = cls.everywhere(numbers[0]) if len(numbers) == 1 else cls(*numbers, unknown=None)
        found.check()
        return found

    def check(self) -> None:
        """Raise `InputError` for a number that no cloud has."""
        for number in self:
            if number is not None and not 0 < number <= _LARGEST:
                raise InputError(
                    f"a number of droplets is {number / 1e6:g} cm-3; it must be above 0 and at "
                    f"most {_LARGEST / 1e6:g} cm-3."
                )

    def over(self, model: xr.Dataset) -> np.ndarray:
        """Number per volume in each column (y, x). [m-3]

        Raises
        ------
        InputError
            Where numbers over water and land differ and the model does not tell the two apart.
        """
        self.check()
        if "land_mask" in model:
            return np.where(model["land_mask"].values > 0, self.land, self.water)
        if self.unknown is None:
            raise InputError(
                "the model has no land mask (LANDMASK or XLAND in WRF's files) to tell water from "
                f"land; give one number of droplets for both, not {self.water / 1e6:g} and "
                f"{self.land / 1e6:g} cm-3."
            )
        return np.full((model.sizes["y"], model.sizes["x"]), self.unknown)

    def describe(self, model: xr.Dataset) -> str:
        """Say which numbers are assumed."""
        over_either = {self.water, self.land} if "land_mask" in model else {self.unknown}
        if len(over_either) == 2:
            return f"{self.water / 1e6:g} cm-3 over water, {self.land / 1e6:g} cm-3 over land"
        number = f"{(over_either.pop() or math.nan) / 1e6:g} cm-3"
        if self.water == self.land:
            return number
        return f"{number} over water and land alike, as the model has no land mask"


class AssumedDroplets(NamedTuple):
    """Numbers that are assumed, and in words where they are from."""

    number: DropletNumber
    source: str


def assumed_droplets(chosen: DropletNumber | None, scheme: str) -> AssumedDroplets:
    """Numbers that are chosen, else those of the model's scheme, else `DropletNumber`'s defaults.

    Parameters
    ----------
    chosen
        What was asked for; None for nothing.
    scheme
        Microphysics scheme by which the model is understood.
    """
    if chosen is not None:
        return AssumedDroplets(chosen, "as asked for")
    own = own_droplet_number(scheme)
    if own is not None:
        number = DropletNumber.everywhere(own)
        return AssumedDroplets(number, f"as the microphysics {scheme} does")
    why = f"the microphysics {scheme} assumes none"
    return AssumedDroplets(DropletNumber(), f"typical of stratiform cloud; {why}")
