"""Where something burns: pixels that are brighter than what surrounds them.

A fire makes a pixel shine in the band of the longest wavelength that was measured (C07 of all
three) long before it can be told how hot it is. The score of a pixel is how far its measurement
exceeds the mean of the pixels around it that do not burn, in standard deviations of these and of
the noise together,

.. math:: z = \\frac{L - \\bar L}{\\sqrt{\\sigma_\\epsilon^2 + s^2}},

the contextual test of L. Giglio et al. [1]_ in one band. It is a mask for a retrieval and no fire
product: bright cloud edges and coasts exceed their surroundings as well.

References
----------
.. [1] L. Giglio et al., "An enhanced contextual fire detection algorithm for MODIS", Remote Sens.
   Environ., 87, 273-282, 2003, doi:10.1016/S0034-4257(03)00184-6
"""

from typing import NamedTuple

import numpy as np
import scipy

from abi_operator.instrument import Imager
from abi_operator.products import surrounding_mean

from .observation import noise_sigma

HALF_WIDTH = 5
"""Pixels from the middle of a surrounding square to its edge. [-]"""
DETECTED = 4.0
"""Score from which a pixel is taken to burn. [-]"""

# Of the median absolute departure, in a standard deviation of normal numbers.
_MEDIAN_DEPARTURE = 1.4826


class Surroundings(NamedTuple):
    """What is seen around each pixel.

    Parameters
    ----------
    score
        Of the detection, (y, x); NaN where nothing was measured. [-]
    mean, deviation
        Of the pixels around that do not burn, (band, y, x), in the unit of the measurement; NaN
        where all of them burn.
    """

    score: np.ndarray
    mean: np.ndarray
    deviation: np.ndarray


def hottest_of(bands: tuple[str, ...]) -> int:
    """Number of the band in which fires are looked for: that of the longest wavelength."""
    return bands.index(max(bands))


def surroundings(
    measured: np.ndarray,
    bands: tuple[str, ...],
    imager: Imager,
    threshold: float = DETECTED,
) -> Surroundings:
    """Score the pixels of one image, and look around each of them.

    Parameters
    ----------
    measured
        Reflectance factor, or radiance in C07, (band, y, x); NaN where there is none.
    bands, imager
        Names of the bands, and the instrument.
    threshold
        Score from which a pixel burns and is no surroundings of others. [-]
    """
    hottest = hottest_of(bands)
    image = measured[hottest]
    noise = noise_sigma(np.nan_to_num(image), bands[hottest], imager)
    burning = _robust_score(image, noise) >= threshold
    mean, deviation = _around(measured, burning)
    with np.errstate(invalid="ignore"):
        score = (image - mean[hottest]) / np.hypot(noise, deviation[hottest])
    # Amid flames there is nothing to compare with: what burnt at first sight burns.
    score = np.where(np.isnan(score) & burning, np.inf, score)
    mean, deviation = _around(measured, score >= threshold)
    return Surroundings(score, mean, deviation)


def _robust_score(image: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """By median and median departure, which do not mind that some of the pixels burn."""
    known = np.isfinite(image)
    filled = np.where(known, image, np.median(image[known]) if known.any() else 0.0)
    size = 2 * HALF_WIDTH + 1
    middle = scipy.ndimage.median_filter(filled, size, mode="nearest")
    departure = scipy.ndimage.median_filter(np.abs(filled - middle), size, mode="nearest")
    return np.where(known, (filled - middle) / np.hypot(noise, _MEDIAN_DEPARTURE * departure), 0)


def _around(measured: np.ndarray, burning: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    mean = np.asarray(surrounding_mean(measured, burning, HALF_WIDTH))
    # About the overall level, so that the difference of squares keeps its digits.
    known = np.isfinite(measured)
    level = np.mean(np.where(known, measured, 0), axis=(1, 2), keepdims=True)
    squares = np.asarray(surrounding_mean((measured - level) ** 2, burning, HALF_WIDTH))
    return mean, np.sqrt(np.maximum(squares - (mean - level) ** 2, 0))
