"""Numbers that say how far retrieved values are from the truth, and from what they claim to be."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..results import expected_error

PERCENTILES = (5, 25, 50, 75, 95)
"""Of the errors. [%]"""
NORMAL_95 = 1.959964
"""Standard deviations to both sides that hold 95 % of normal numbers. [-]"""


class Score(NamedTuple):
    """Agreement of retrieved and true values, in their unit; NaN where there are too few of them.

    Parameters
    ----------
    num_pairs
        Number of pairs.
    bias, rmse, max_error
        Mean, root mean square and largest absolute value of retrieved minus true.
    correlation, slope
        Pearson's correlation, and slope of the regression of retrieved on true values; NaN where
        true values are all the same, or retrieved ones are, for the correlation. [-]
    within
        Share of pairs inside the expected error (`expected_error` of the truth, of optical depth).
        [-]
    percentile_5, percentile_25, percentile_50, percentile_75, percentile_95
        Of retrieved minus true.
    coverage_68, coverage_95
        Share of errors within one, and within 1.96 posterior standard deviations: 0.683 and 0.95
        where these are right and errors normal. [-]
    chi_square
        Reduced chi-square of the errors, the mean square of error / standard deviation: 1 where
        these are right. [-]
    """

    num_pairs: int
    bias: float
    rmse: float
    max_error: float
    correlation: float
    slope: float
    within: float
    percentile_5: float
    percentile_25: float
    percentile_50: float
    percentile_75: float
    percentile_95: float
    coverage_68: float
    coverage_95: float
    chi_square: float


Allowed = Callable[[np.ndarray], np.ndarray]


def score(
    retrieved: np.ndarray,
    truth: np.ndarray,
    allowed: Allowed | None = expected_error,
    sigma: np.ndarray | None = None,
) -> Score:
    """Score pairs of values, all of them finite.

    Parameters
    ----------
    retrieved, truth
        The pairs.
    allowed
        Error that is expected of a true value; None where nobody says what is to be expected.
    sigma
        Posterior standard deviations of the retrieved values; None where there are none.
    """
    retrieved, truth = np.ravel(retrieved).astype(float), np.ravel(truth).astype(float)
    if retrieved.size == 0:
        return Score(0, *[float("nan")] * (len(Score._fields) - 1))
    error = retrieved - truth
    spread = truth - truth.mean()
    covariance = np.mean(spread * (retrieved - retrieved.mean()))
    variance = np.mean(spread**2)
    deviations = np.sqrt(variance) * retrieved.std()
    varies = _varies(truth) and variance > 0
    correlates = varies and _varies(retrieved) and deviations > 0
    percentiles = zip(PERCENTILES, np.percentile(error, PERCENTILES), strict=True)
    return Score(
        num_pairs=error.size,
        bias=float(error.mean()),
        rmse=float(np.sqrt(np.mean(error**2))),
        max_error=float(np.abs(error).max()),
        correlation=float(covariance / deviations) if correlates else float("nan"),
        slope=float(covariance / variance) if varies else float("nan"),
        within=float("nan") if allowed is None else float(np.mean(np.abs(error) <= allowed(truth))),
        **{f"percentile_{rank}": float(value) for rank, value in percentiles},
        **_calibration(error, sigma),
    )


def _varies(values: np.ndarray) -> bool:
    """Whether numbers differ by more than rounding, of which their variance is never free."""
    return bool(np.ptp(values) > 8 * np.finfo(float).eps * np.abs(values).max())


def _calibration(error: np.ndarray, sigma: np.ndarray | None) -> dict[str, float]:
    """Coverages and chi-square of errors."""
    names = ("coverage_68", "coverage_95", "chi_square")
    if sigma is None:
        return dict.fromkeys(names, float("nan"))
    sigma = np.ravel(sigma).astype(float)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(error) / sigma
    found = (np.mean(ratio <= 1), np.mean(ratio <= NORMAL_95), np.mean(ratio**2))
    return {name: float(value) for name, value in zip(names, found, strict=True)}


def binned_scores(
    retrieved: np.ndarray,
    truth: np.ndarray,
    by: np.ndarray,
    edges: tuple[float, ...],
    allowed: Allowed | None = expected_error,
    sigma: np.ndarray | None = None,
) -> list[Score]:
    """Score the pairs in each bin ``edges[i] < by <= edges[i + 1]``; the first is closed."""
    bins = np.maximum(np.digitize(by, edges, right=True) - 1, 0)
    chosen = [bins == i for i in range(len(edges) - 1)]
    return [
        score(retrieved[rows], truth[rows], allowed, None if sigma is None else sigma[rows])
        for rows in chosen
    ]
