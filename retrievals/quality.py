"""Whether a minimum can be trusted: from inversions to result codes."""

import numpy as np

from .diagnostics import probability_of_cost
from .inverse import Inversion
from .results import ResultCode
from .state_vector import StateVector

EXACT_COST = 1e-6
"""Largest cost of a fit to measurements without noise: a thousandth of a standard deviation. [-]"""

SMALLEST_PROBABILITY = 1e-3
"""Fits that noise makes worse less often than this are poor. [-]"""

RIVAL_COST = 4.0
"""A second minimum rivals the first if its cost is higher by less than this: two sigma. [-]"""

_SAME_X = 1e-3  # minima that are closer than this, or than their errors, are one

# Where measurements do not determine x, its variance is infinite, or by rounding below 0: errors
# are NaN then, and minima at infinity are NaN apart. Both have codes, and need no warning.
_no_warning = np.errstate(invalid="ignore")


@_no_warning
def sigmas(vector: StateVector, inversion: Inversion) -> np.ndarray:
    """Posterior standard deviation of each quantity, in its unit; NaN where there is none."""
    variance = np.diagonal(inversion.covariance, axis1=-2, axis2=-1)
    return np.asarray(vector.slopes(inversion.x)) * np.sqrt(variance)


@_no_warning
def same_solution(one: Inversion, two: Inversion) -> np.ndarray:
    """Whether two solutions of each pixel are one, to what a minimisation leaves."""
    apart = np.abs(np.asarray(one.x) - np.asarray(two.x))
    return np.asarray(~(apart > _SAME_X).any(axis=-1))


@_no_warning
def result_codes(
    vector: StateVector,
    best: Inversion,
    rival: Inversion,
    num_values: np.ndarray,
    *,
    exact: bool,
    bounded: bool | np.ndarray = False,
) -> np.ndarray:
    """Judge the solutions of all pixels.

    Parameters
    ----------
    vector
        Meaning of x.
    best, rival
        Solution of each pixel, and the minimum to which the other start led (the same again where
        there was no other).
    num_values
        Number of measurements of each pixel.
    exact
        Whether the measurements are free of noise, and no prior pulls the solution away from them.
    bounded
        Which pixels have saturated bands: the likelihood of a bound is 1 far above the ceiling
        alone, so that no fit of theirs has to be exact.
    """
    alone = np.all(best.prior_cost == 0)
    freedom = np.broadcast_to(num_values - (vector.size if alone else 0), best.cost.shape)
    probability = probability_of_cost(best.cost, np.maximum(freedom, 1))
    # A prior pulls away from bounds, too, where all bands are saturated: no fit has to be exact.
    determined = (freedom <= 0) & alone
    to_be_met = (determined | exact) & ~np.asarray(bounded)
    explained = np.where(to_be_met, best.cost <= EXACT_COST, probability >= SMALLEST_PROBABILITY)
    apart = np.abs(np.asarray(rival.x) - np.asarray(best.x))
    if exact:
        rivalled = (rival.cost <= EXACT_COST) & (apart > _SAME_X).any(axis=-1)
    else:
        error = np.sqrt(np.diagonal(best.covariance, axis1=-2, axis2=-1))
        rivalled = rival.cost < best.cost + RIVAL_COST
        rivalled &= (apart > np.maximum(error, _SAME_X)).any(axis=-1)
    codes = np.full(best.cost.shape, ResultCode.SUCCESS, np.int8)
    codes[~_observable(vector, best)] = ResultCode.NOT_OBSERVABLE
    codes[rival.converged & rivalled] = ResultCode.MULTIPLE_SOLUTIONS
    codes[~explained] = ResultCode.POOR_FIT
    codes[~best.converged] = ResultCode.NOT_CONVERGED
    finite = np.isfinite(best.cost) & np.isfinite(best.x).all(-1)
    if not alone:  # beside a prior nothing is undetermined: what is NaN are slopes of the operator
        finite &= ~np.isnan(best.covariance).any((-2, -1))
    codes[~finite] = ResultCode.NONFINITE
    return codes


def _observable(vector: StateVector, inversion: Inversion) -> np.ndarray:
    """Whether all quantities are known as well as they are asked to be."""
    values, errors = vector.values(inversion.x), sigmas(vector, inversion)
    observable = np.isfinite(errors).all(axis=-1)
    for i, quantity in enumerate(vector.quantities):
        if quantity.largest_error is not None:
            allowed = quantity.largest_error(np.asarray(values[quantity.name]))
            observable &= errors[..., i] <= allowed
    return np.asarray(observable)
