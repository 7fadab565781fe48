"""Whether a minimum can be trusted: from inversions to result codes."""

import numpy as np

from .diagnostics import probability_of_cost
from .inverse import Inversion
from .results import ResultCode, expected_error
from .state_vector import StateVector

EXACT_COST = 1e-6
"""Largest cost of a fit to measurements without noise: a thousandth of a standard deviation. [-]"""

SMALLEST_PROBABILITY = 1e-3
"""Fits that noise makes worse less often than this are poor. [-]"""

RIVAL_COST = 4.0
"""A second minimum rivals the first if its cost is higher by less than this: two sigma. [-]"""

_SAME_AOD = 1e-4  # minima that are closer than this, or than their errors, are one


def aod_550_sigma(vector: StateVector, inversion: Inversion) -> np.ndarray:
    """Posterior standard deviation of the optical depth. [-]"""
    variance = inversion.covariance[..., 0, 0]
    return np.asarray(vector.aod_550_slope(inversion.x)) * np.sqrt(variance)


def result_codes(
    vector: StateVector, best: Inversion, rival: Inversion, num_bands: int, *, exact: bool
) -> np.ndarray:
    """Judge the solutions of all pixels.

    Parameters
    ----------
    vector
        Meaning of x.
    best, rival
        Solution of each pixel, and the minimum to which the other start led (the same again where
        there was no other).
    num_bands
        Number of measurements of a pixel.
    exact
        Whether the measurements are free of noise, and no prior pulls the solution away from them.
    """
    degrees_of_freedom = num_bands - (vector.size if np.all(best.prior_cost == 0) else 0)
    if exact or degrees_of_freedom == 0:
        explained = best.cost <= EXACT_COST
    else:
        explained = probability_of_cost(best.cost, degrees_of_freedom) >= SMALLEST_PROBABILITY
    aod_550 = np.asarray(vector.aod_550(best.x))
    sigma = aod_550_sigma(vector, best)
    apart = np.abs(np.asarray(vector.aod_550(rival.x)) - aod_550)
    if exact:
        rivalled = (rival.cost <= EXACT_COST) & (apart > _SAME_AOD)
    else:
        rivalled = (rival.cost < best.cost + RIVAL_COST) & (apart > np.maximum(sigma, _SAME_AOD))
    codes = np.full(aod_550.shape, ResultCode.SUCCESS, np.int8)
    codes[~(sigma <= expected_error(aod_550))] = ResultCode.NOT_OBSERVABLE
    codes[rival.converged & rivalled] = ResultCode.AMBIGUOUS
    codes[~explained] = ResultCode.POOR_FIT
    codes[~best.converged] = ResultCode.NOT_CONVERGED
    codes[~np.isfinite(best.cost) | ~np.isfinite(best.x).all(-1)] = ResultCode.NONFINITE
    return codes
