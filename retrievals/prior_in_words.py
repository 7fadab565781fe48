"""What a product says of the prior that it was made with; `images.how_made` asks."""

import numpy as np

from .prior import Prior
from .quantities import Quantity
from .state_vector import StateVector


def prior_in_words(prior: Prior | StateVector | None, names: tuple[str, ...]) -> str:
    """The attribute ``prior`` of a product: which distribution, by its numbers.

    Parameters
    ----------
    prior
        As retrievals take it.
    names
        Of the elements of x.

    Returns
    -------
    ``"none"``; or for each quantity mean and standard deviation, in its unit or of x, as they are
    declared; or the numbers of one distribution of x for all pixels. Of one for each pixel no more
    than that.
    """
    if prior is None:
        return "none"
    if isinstance(prior, StateVector):
        return "normal distribution: " + "; ".join(map(_declared, prior.quantities))
    mean, covariance = np.asarray(prior.x_prior), np.asarray(prior.S_prior)
    if mean.ndim > 1 or covariance.ndim > 2:
        return "normal distribution of x, one of each pixel"
    sigma = np.sqrt(np.diagonal(covariance))
    each = [f"{n} {m:g} +/- {s:g}" for n, m, s in zip(names, mean, sigma, strict=True)]
    correlated = np.any(covariance != np.diag(np.diagonal(covariance)))
    return f"normal distribution of x: {'; '.join(each)}" + ("; correlated" if correlated else "")


def _declared(quantity: Quantity) -> str:
    mean = "the state's own" if quantity.mean is None else f"{quantity.mean:g}"
    # A unit of 1 goes without saying.
    unit = "" if quantity.units == "1" else f" {quantity.units}"
    if quantity.sigma_in_units:
        return f"{quantity.name} {mean} +/- {quantity.sigma:g}{unit}"
    return f"{quantity.name} {mean}{unit}, x +/- {quantity.sigma:g}"
