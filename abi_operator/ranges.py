"""What values may be: one range for each quantity, whoever checks it and wherever it comes from.

There are two questions. What can be at all is asked of the solver's arguments (`SOLVER`), of states
and of the plumes that go into them (`STATE`); a scenario's fields are those of its columns and have
the same ranges. What can be weather is a narrower question, asked of scenarios and of the files
behind them (`WEATHER`; what only a model has stands in `files.plausible`). All ranges are of finite
numbers, and a number is judged in its own precision: one step above 1 is outside [0, 1].
"""

import math
from typing import Any, NamedTuple


class Range(NamedTuple):
    """Allowed values of a quantity.

    Parameters
    ----------
    low, high
        The ends, in the unit.
    ends
        Which of the two belong to it: ``"[]"`` both, ``"[)"`` the lower, ``"(]"`` the upper,
        ``"()"`` none.
    unit
        ``"1"`` where there is none.
    sentence
        How to say what is allowed; empty for words that follow from the ends and the unit.
    """

    low: float
    high: float
    ends: str = "[]"
    unit: str = "1"
    sentence: str = ""

    def holds(self, x: Any) -> Any:
        """Whether numbers are inside, one by one; those that are not finite never are."""
        above = x >= self.low if self.ends[0] == "[" else x > self.low
        below = x <= self.high if self.ends[1] == "]" else x < self.high
        return above & below

    @property
    def interval(self) -> str:
        """As mathematics writes it, ``[0, 1)``."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.ends[0]}{self.low:g}, {self.high:g}{self.ends[1]}{unit}"

    @property
    def words(self) -> str:
        """What is allowed, in words, ``0 m or more``."""
        if self.sentence:
            return self.sentence
        unit = "" if self.unit == "1" else f" {self.unit}"
        least = f"above {self.low:g}" if self.ends[0] == "(" else f"{self.low:g}"
        if math.isinf(self.high):
            if math.isinf(self.low):
                return "finite"
            return least + unit + (" or more" if self.ends[0] == "[" else "")
        if self.ends == "[]":
            return f"{self.low:g} to {self.high:g}{unit}"
        most = f"{'below' if self.ends[1] == ')' else 'at most'} {self.high:g}{unit}"
        return f"{least}{'' if self.ends[0] == '(' else ' or more'} and {most}"


_INF = math.inf

FINITE = Range(-_INF, _INF, "()")
SHARE = Range(0.0, 1.0)
# Below what nobody means, as units mixed up give it, and before products of amounts are no numbers:
# of a layer of 1e20 the light is off by 1 %, of one of 1e30 by anything.
_DEPTH = Range(0.0, 1e15, "[)")
_SOURCE = Range(0.0, 1e20, "[)")
_NOT_NEGATIVE = Range(0.0, _INF, "[)")
_AMOUNT = Range(0.0, 1e6, "[)")
_POSITIVE = Range(0.0, 1e6, "()")
_COSINE = Range(0.0, 1.0, "(]")
_EDGE = Range(0.0, 1e9, "[)", "m")
# Degrees Celsius of the ground and of most air lie below.
_TEMPERATURE = Range(50.0, 1e5, "()", "K")
# Foam covers all of a sea from 37 m/s on by the law that `surface.Ocean` follows.
_WIND = Range(0.0, 37.0, "[]", "m s-1")
_ZENITH = Range(0.0, math.pi, "[]", "rad", "0 to pi (angles are in rad)")
# A difference of two azimuths is 2 pi at most, in float32 too; what is more is degrees.
_AZIMUTH = Range(-6.2832, 6.2832, "[]", "rad", "-2 pi to 2 pi (angles are in rad)")
# Of water in these bands: in none of them is light faster in it than in a vacuum, and what would be
# more than this is no water. [-]
_REFRACTION, _ABSORPTION = Range(1.0, 10.0), Range(0.0, 10.0)
# At either end all light is scattered into one direction, for which there is no phase function.
_ASYMMETRY = Range(-1.0, 1.0, "()")

SOLVER: dict[str, Range] = {
    "tau": _DEPTH,
    "ssa": SHARE,
    "moments": Range(-1.0, 1.0),
    "albedo": SHARE,
    "mu0": _COSINE,
    "mu": _COSINE,
    "relative_azimuth": _AZIMUTH,
    # That of an asymmetry factor a hair below 1 is 1e32.
    "phase_function": _NOT_NEGATIVE,
    "secant": _POSITIVE,
    "solar_irradiance": _SOURCE,
    "planck_levels": _SOURCE,
    "surface_emission": _SOURCE,
    "isotropic_top": _SOURCE,
}
"""By argument of the solver, in the order of the call."""

STATE: dict[str, Range] = {
    "pressure": Range(0.0, 1e7, "[)", "Pa"),
    "temperature": _TEMPERATURE,
    "surface_temperature": _TEMPERATURE,
    "height": Range(-1e9, 1e9, "()", "m"),
    "mass_path": Range(0.0, 1e6, "[)", "kg m-2"),
    "number_path": Range(0.0, 1e20, "[)", "m-2"),
    "vapour": Range(0.0, 1e6, "[)", "kg m-2"),
    "ozone": Range(0.0, 1e9, "[)", "DU"),
    "carbon_dioxide": SHARE,
    "methane": SHARE,
    "nitrous_oxide": SHARE,
    "base": _EDGE,
    "top": _EDGE,
    "aod_550": _AMOUNT,
    "scale_height": Range(0.0, 1e9, "()", "m"),
    "extinction_550": Range(0.0, 1e6, "[)", "m-1"),
    "brightness": SHARE,
    "relative_extinction": _AMOUNT,
    "ssa": SHARE,
    "asymmetry": _ASYMMETRY,
    "effective_radius_um": Range(0.0, 1e6, "()", "um"),
    "fraction": SHARE,
    "albedo": SHARE,
    "water_share": SHARE,
    "wind_speed": _WIND,
    "water_reflectance": SHARE,
    "foam_reflectance": SHARE,
    "refractive_index": _REFRACTION,
    "absorption_index": _ABSORPTION,
    "solar_zenith": _ZENITH,
    "view_zenith": _ZENITH,
    "relative_azimuth": _AZIMUTH,
}
"""By name of a field, wherever in a state it is; a plume is also given its `aod_550`."""

WEATHER: dict[str, Range] = {
    "latitude": Range(-90.0, 90.0, "[]", "degrees"),
    "longitude": Range(-360.0, 360.0, "[]", "degrees"),
    # Of levels, which reach above and below a model's layers.
    "temperature": Range(100.0, 500.0, "[]", "K"),
    # From the Antarctic plateau, at 175 K (Scambos et al. 2018, doi:10.1029/2018GL078133), to lava.
    "surface_temperature": Range(150.0, 1500.0, "[]", "K"),
    "wind_speed": _WIND,
    # Less than a whole column of air weighs.
    "mass_path": Range(0.0, 1.0e4, "[]", "kg m-2"),
}
"""By name of a quantity that has a narrower range where a scenario or a file says that it is."""
