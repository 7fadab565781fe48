"""Numbers that say how far retrieved values are from the truth."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..results import expected_error


class Score(NamedTuple):
    """Agreement of retrieved and true values; NaN where there are too few of them.

    Parameters
    ----------
    num_pairs
        Number of pairs.
    bias, rmse, max_error
        Mean, root mean square and largest absolute value of retrieved minus true. [-]
    correlation, slope
        Pearson's correlation, and slope of the regression of retrieved on true values. [-]
    within
        Share of pairs inside the expected error (`expected_error` of the truth, of optical depth).
        [-]
    """

    num_pairs: int
    bias: float
    rmse: float
    max_error: float
    correlation: float
    slope: float
    within: float


Allowed = Callable[[np.ndarray], np.ndarray]


def score(
    retrieved: np.ndarray, truth: np.ndarray, allowed: Allowed | None = expected_error
) -> Score:
    """Score pairs of values, all of them finite.

    Parameters
    ----------
    retrieved, truth
        The pairs.
    allowed
        Error that is expected of a true value; None where nobody says what is to be expected.
    """
    retrieved, truth = np.ravel(retrieved).astype(float), np.ravel(truth).astype(float)
    if retrieved.size == 0:
        return Score(0, *[float("nan")] * 6)
    error = retrieved - truth
    spread = truth - truth.mean()
    covariance = np.mean(spread * (retrieved - retrieved.mean()))
    variance = np.mean(spread**2)
    deviations = np.sqrt(variance) * retrieved.std()
    return Score(
        num_pairs=error.size,
        bias=float(error.mean()),
        rmse=float(np.sqrt(np.mean(error**2))),
        max_error=float(np.abs(error).max()),
        correlation=float(covariance / deviations) if deviations > 0 else float("nan"),
        slope=float(covariance / variance) if variance > 0 else float("nan"),
        within=float("nan") if allowed is None else float(np.mean(np.abs(error) <= allowed(truth))),
    )


def binned_scores(
    retrieved: np.ndarray,
    truth: np.ndarray,
    by: np.ndarray,
    edges: tuple[float, ...],
    allowed: Allowed | None = expected_error,
) -> list[Score]:
    """Score the pairs in each bin ``edges[i] < by <= edges[i + 1]``; the first is closed."""
    bins = np.maximum(np.digitize(by, edges, right=True) - 1, 0)
    chosen = [bins == i for i in range(len(edges) - 1)]
    return [score(retrieved[rows], truth[rows], allowed) for rows in chosen]


def standardised_spread(error: np.ndarray, sigma: np.ndarray) -> tuple[float, float]:
    """Mean square of error / sigma, and the share of errors within one sigma. [-]

    1 and 0.68 where posterior errors are right and normal.
    """
    ratio = error / sigma
    return float(np.mean(ratio**2)), float(np.mean(np.abs(ratio) <= 1))
