"""The worst columns of `stress.py` against the solver of 40 digits of the tests.

That solver (`tests/forty_digits.py`) shares neither code nor algorithm with this package's, and
knows how much rounding has left of its own result. It solves the same discrete ordinates, from the
same numbers.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from forty_digits import forty_digit_albedo, forty_digit_radiance  # noqa: E402

FLOOR = 1e-3


def truth(columns, row, num_streams, albedo=None):
    """Reflectance or radiance of one column, over ground of its own albedo or another.

    NaN where 40 digits cannot be had.
    """
    own = {name: np.asarray(x[row], np.float64) for name, x in columns.items()}
    solar = own.get("solar_irradiance")
    if albedo is not None:
        own["albedo"] = albedo
    irradiance = {"solar_irradiance": 1.0 if solar is None else float(solar)}
    try:
        found = forty_digit_radiance(**own | irradiance, num_streams=num_streams, corrected=True)
    except ArithmeticError:
        return np.nan
    return np.pi * found / own["mu0"] if solar is None else found


def error(columns, row, num_streams, value):
    """Error of one column's value, relative as in `stress_checks`."""
    right, floor = truth(columns, row, num_streams), FLOOR
    if "planck_levels" in columns:
        sources = ("planck_levels", "surface_emission", "isotropic_top")
        sun = columns["solar_irradiance"][row] * columns["mu0"][row] / np.pi
        floor = FLOOR * max(sun, *(np.max(columns[name][row]) for name in sources))
    return abs(value - right) / max(abs(right), floor)


def falls(columns, row, num_streams):
    """How far the equations themselves have a reflectance below 0, or one that falls in albedo.

    Few streams have, where phase functions are sharp. 0 where they have neither.
    """
    black, own, white = (truth(columns, row, num_streams, a) for a in (0.0, None, 1.0))
    return max(-black, black - own, own - white, 0.0)


def outside(columns, row, num_streams):
    """How far the equations themselves have a plane albedo below 0 or above 1, where few streams
    cut off phase functions. 0 where they do not, or 40 digits cannot be had."""
    lit = ("tau", "ssa", "moments", "albedo", "mu0")
    own = {name: np.asarray(columns[name][row], np.float64) for name in lit}
    try:
        share = forty_digit_albedo(**own, num_streams=num_streams)
    except ArithmeticError:
        return 0.0
    return max(-share, share - 1, 0.0)
