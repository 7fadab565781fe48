"""The worst columns of `stress.py` against the solver of 40 digits of the tests.

That solver (`tests/forty_digits.py`) shares neither code nor algorithm with this package's, and
knows how much rounding has left of its own result. It solves the same discrete ordinates, from the
same numbers.
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from forty_digits import forty_digit_radiance  # noqa: E402

FLOOR = 1e-3


def error(columns, row, num_streams, value):
    """Error of one column's value, relative as in `stress_checks`; NaN where there is no truth."""
    own = {name: np.asarray(x[row], np.float64) for name, x in columns.items()}
    phase, mu0 = own.pop("phase_function"), float(own["mu0"])
    solar, sources = own.pop("solar_irradiance", None), {}
    for name in ("planck_levels", "surface_emission", "isotropic_top"):
        if name in own:
            sources[name] = own.pop(name)
    irradiance = 1.0 if solar is None else float(solar)
    try:
        truth = forty_digit_radiance(
            **own,
            num_streams=num_streams,
            corrected=True,
            solar_irradiance=irradiance,
            phase_function=phase,
            **sources,
        )
    except ArithmeticError:
        return np.nan
    if solar is None:
        truth, floor = np.pi * truth / mu0, FLOOR
    else:
        strongest = [sources["planck_levels"].max(), *(np.max(x) for x in sources.values())]
        floor = FLOOR * max(*strongest, irradiance * mu0 / np.pi)
    return abs(value - truth) / max(abs(truth), floor)
