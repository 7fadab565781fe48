"""How well a score tells pixels with a plume or a fire from those without."""

from typing import NamedTuple

import numpy as np
import scipy


class Detection(NamedTuple):
    """Quality of a detection; NaN where there is nothing to be detected, or nothing else.

    Parameters
    ----------
    num_true, num_pixels
        Pixels with what is looked for, and all.
    threshold
        Score from which a pixel is detected.
    hit_rate
        Share detected of the pixels that have it. [-]
    false_alarm_rate
        Share detected of those that do not. [-]
    false_alarm_ratio
        Share of those that do not have it among all detected. [-]
    roc_area
        Probability that the score of one that has it exceeds that of one that does not, ties
        counting half: the area under the curve of hit rate against false alarm rate. [-]
    """

    num_true: int
    num_pixels: int
    threshold: float
    hit_rate: float
    false_alarm_rate: float
    false_alarm_ratio: float
    roc_area: float


def detection(score: np.ndarray, truth: np.ndarray, threshold: float) -> Detection:
    """Judge a score.

    Parameters
    ----------
    score
        Of each pixel, the larger the surer; minus infinity where there is none. [-]
    truth
        Whether it has what is looked for.
    threshold
        Score from which a pixel is detected.
    """
    score, truth = np.ravel(score), np.ravel(truth)
    found = score >= threshold
    hits, alarms, num_true, num_others = (
        int(np.count_nonzero(x)) for x in (found & truth, found & ~truth, truth, ~truth)
    )
    pairs = num_true * num_others
    # Mann and Whitney: ranks tell how many of the others each of them exceeds.
    exceeded = scipy.stats.rankdata(score)[truth].sum() - num_true * (num_true + 1) / 2
    return Detection(
        num_true,
        truth.size,
        threshold,
        _share(hits, num_true),
        _share(alarms, num_others),
        _share(alarms, hits + alarms),
        _share(float(exceeded), pairs),
    )


def _share(part: float, of: int) -> float:
    return part / of if of else float("nan")
