"""What many pixels must be before they are retrieved, and a code for each that is not."""

import jax
import numpy as np

from .forward import THERMAL, ForwardModel
from .observation import LARGEST_REFLECTANCE_FACTOR, Observation
from .prior import Prior
from .results import ResultCode


def checked(
    forward: ForwardModel, observations: Observation, prior: Prior | None
) -> tuple[np.ndarray, Observation, Prior | None]:
    """Codes of the pixels that cannot be retrieved, and what is to be retrieved in one form.

    Parameters
    ----------
    forward
        The forward model.
    observations
        Measurements, pixels leading.
    prior
        One for all pixels or for each.

    Returns
    -------
    Codes, `SUCCESS` where a pixel may be attempted; observations and priors of one floating type,
    in which a pixel that is not attempted has no measurements, and the prior of another.

    Raises
    ------
    ValueError
        Where there are no pixels, numbers of bands or of unknowns do not fit, or
        most reflectance factors are in percent.
    """
    dtype = jax.dtypes.canonicalize_dtype(np.float64)
    measured, sigma = (np.asarray(x, dtype) for x in (observations.measured, observations.sigma))
    bands = forward.bands
    for name, array in (("measured", measured), ("sigma", sigma)):
        if array.ndim != 2 or array.shape[1] != len(bands) or array.shape != measured.shape:
            raise ValueError(
                f"{name} of the observations has the shape {array.shape}; it needs one row for "
                f"each pixel and the {len(bands)} columns {', '.join(bands)}."
            )
    num_pixels = len(measured)
    if num_pixels == 0:
        raise ValueError("there are no pixels to retrieve: the observations have no rows.")
    present = np.isfinite(measured) & np.isfinite(sigma)
    reflective = np.array([band != THERMAL for band in bands])
    too_bright = present & reflective & (measured > LARGEST_REFLECTANCE_FACTOR)
    if too_bright.any(axis=1).mean() > 0.5:
        raise ValueError(
            f"reflectance factors reach {measured[too_bright].max():.3g}; a bright cloud has 1: "
            "these seem to be in percent, so divide measurements and sigma by 100."
        )
    codes = np.full(num_pixels, ResultCode.SUCCESS, np.int8)
    if prior is not None:
        prior = prior.of_pixels(num_pixels, forward.vector.names)
        prior = Prior(*(np.array(x, dtype) for x in (prior.x_prior, prior.S_prior)))
        unknown = ~np.isfinite(prior.x_prior).all(axis=1)
        prior.x_prior[unknown] = 0
        codes[unknown] = ResultCode.INVALID_INPUT
    else:
        too_few = observations.num_values < forward.vector.size
        codes[too_few] = ResultCode.TOO_FEW_BANDS
    wrong = (sigma <= 0) | (np.isnan(sigma) & np.isfinite(measured)) | too_bright
    correlation = observations.correlation
    if correlation is not None:
        correlation = np.asarray(correlation, dtype)
        if correlation.shape != (*measured.shape, len(bands)):
            raise ValueError(
                f"correlation of the observations has the shape {correlation.shape}; it needs one "
                f"matrix of {len(bands)} x {len(bands)} for each of {num_pixels} pixels."
            )
        wrong[~_positive(correlation, present)] = True
    codes[wrong.any(axis=1) | ~present.any(axis=1)] = ResultCode.INVALID_INPUT
    measured = np.where((codes == ResultCode.SUCCESS)[:, None], measured, np.nan)
    saturated = observations.saturated
    if saturated is None:
        saturated = np.zeros(measured.shape, bool)
    kept = Observation(
        measured,
        np.where(sigma > 0, sigma, 1),
        np.asarray(saturated),
        observations.sun_distance,
        correlation,
    )
    return codes, kept, prior


def _positive(correlation: np.ndarray, present: np.ndarray) -> np.ndarray:
    """Whether a matrix is one of correlations, among the bands that count, pixel by pixel."""
    both = present[:, :, None] & present[:, None, :]
    among = np.where(both, correlation, np.eye(correlation.shape[-1]))
    fine = np.asarray(np.isfinite(among).all(axis=(1, 2)))
    among = np.where(fine[:, None, None], among, np.eye(correlation.shape[-1]))
    wrong = np.maximum(
        np.abs(np.diagonal(among, axis1=1, axis2=2) - 1).max(axis=1),
        np.abs(among - np.swapaxes(among, 1, 2)).max(axis=(1, 2)),
    )
    return np.asarray(fine & (wrong < 1e-6) & (np.linalg.eigvalsh(among).min(axis=1) > 0))
