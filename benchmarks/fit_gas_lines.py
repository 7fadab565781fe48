"""What the fits of vapour to line-by-line sums have in common: its amounts, and its continuum.

The continuum is grey within a band, so it is fitted by itself and the exponential sum holds the
lines. Used by `fit_gas_c06.py` and `fit_gas_c07.py`.
"""

import numpy as np
from lines_of_air import Spectrum, weights

from abi_operator.atmosphere import Atmosphere
from abi_operator.optics.gas.amounts import (
    Amount,
    foreign_continuum_vapour,
    self_continuum_vapour,
)

HEIGHTS = (0.0, 1e3, 2e3, 3e3, 5e3, 8e3)
LONGEST = np.array([1.0, 2.0, 4.0, 6.0])
CONTINUA = {"self": self_continuum_vapour, "foreign": foreign_continuum_vapour}


def vapour_amounts(column: Atmosphere, lines: Amount) -> list[np.ndarray]:
    """Layer amounts for lines, for the self and for the foreign continuum."""
    amounts = (lines, *CONTINUA.values())
    return [np.asarray(amount(column), np.float64) for amount in amounts]


def continuum(found: list[Spectrum], band: str, source: float) -> dict[str, float]:
    """Depth per unit of amount, by continuum, with the least error of transmittance; printed."""
    fitted = {}
    for part, amount in CONTINUA.items():
        units, depths = [], []
        for one in found:
            share = weights(band, one.grid, source)
            layers = np.asarray(amount(one.column), np.float64)
            for height in HEIGHTS:
                count = int(np.flatnonzero(np.asarray(one.column.height) == height)[0])
                units.append(layers[:count].sum())
                depths.append(share @ one.depths[part][:count].sum(axis=0))
        x, y = np.array(units), np.array(depths)
        trial = np.linspace(0.7, 1.3, 601) * y.sum() / x.sum()
        exact = np.exp(-np.outer(LONGEST, y))
        error = [np.abs(np.exp(-np.outer(LONGEST, k * x)) - exact).max() for k in trial]
        best = int(np.argmin(error))
        fitted[part] = float(f"{trial[best]:.4g}")
        print(f"{band}: {part} continuum {fitted[part]}, largest error {error[best]:.5f}")
    return fitted
