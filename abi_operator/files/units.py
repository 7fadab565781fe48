"""Whether the units that a file states for a variable are the ones that are expected."""

import re

import xarray as xr

from .errors import InputError
from .netcdf import FilePath

# What has no unit, is only counted, or says of what, in the words of models and their tools.
_NUMBERS = {"count", "number", "particles", "fraction", "flag", "category", "none", "unitless"}
_NUMBERS |= {"dimensionless", "nondimensional", "dry", "air"}
_NUMBERS |= {"north", "south", "east", "west", "n", "e"}
# Other spellings of units; all that begins with these is degrees of an angle.
_SPELLINGS = {"pascal": "pa", "pascals": "pa", "kelvin": "k", "degk": "k", "kilogram": "kg"}
_SPELLINGS |= {"meter": "m", "meters": "m", "metre": "m", "metres": "m"}
_ANGLE = re.compile(r"deg(ree)?s?(_?(n|north|e|east))?")
# A unit and its exponent, written as m2, m^2, m**2 or m(2), behind a stroke or not.
_FACTOR = re.compile(r"(/?)\s*([a-z_%]+)\s*(?:\^|\*\*)?\s*[({]?\s*([-+]?\d+)?\s*[)}]?")


def check_units(array: xr.DataArray, expected: str, path: FilePath) -> None:
    """Raise `InputError` where a variable states other units than those expected.

    A variable that states none, or empty ones as WRF does, passes: its values will tell.

    Parameters
    ----------
    array
        A variable of a file.
    expected
        Its units, such as ``"kg kg-1"``.
    path
        The file.
    """
    stated = str(array.attrs.get("units", "")).strip()
    if stated and _factors(stated) != _factors(expected):
        raise InputError(
            f"{array.name} in {path} has the units {stated!r} where {expected!r} are expected; "
            "convert it, or correct its attribute if that is what is wrong."
        )


def _factors(units: str) -> dict[str, int]:
    """Exponents of the units in a product; those that cancel are left out."""
    exponents: dict[str, int] = {}
    for match in _FACTOR.finditer(units.lower()):
        stroke, word, exponent = (group or "" for group in match.groups())
        if word in _NUMBERS:
            continue
        name = "degree" if _ANGLE.fullmatch(word) else _SPELLINGS.get(word, word)
        power = int(exponent or 1) * (-1 if stroke else 1)
        exponents[name] = exponents.get(name, 0) + power
    return {name: power for name, power in exponents.items() if power}
