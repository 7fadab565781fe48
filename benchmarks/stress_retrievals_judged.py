"""What became of pixels to which something happened, beside what is true of them."""

from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Array
from stress_retrievals_cases import CASES, Stressed
from stress_retrievals_pixels import Pixels

from retrievals import Minimiser, ResultCode, retrieve_pixels
from retrievals.inverse import DEFAULT_MINIMISER
from retrievals.pixels import Retrieved
from retrievals.product import pixel_fields


class Judged(NamedTuple):
    """What became of the pixels of a case.

    Parameters
    ----------
    codes
        Result code of each pixel.
    departures
        Of x from the truth, in posterior standard deviations (pixel, x).
    errors
        Of what the kind has `reported`, without sign.
    finite
        Whether all numbers of a product are.
    told
        Whether the retrieval was told what is true.
    """

    codes: np.ndarray
    departures: np.ndarray
    errors: np.ndarray
    finite: np.ndarray
    told: bool

    @property
    def success(self) -> np.ndarray:
        """Which say success."""
        return self.codes == ResultCode.SUCCESS

    def share(self, code: ResultCode) -> float:
        """Share of a result code. [-]"""
        return float(np.mean(self.codes == code))

    @property
    def lost(self) -> int:
        """How many successes have a number that is none."""
        return int((self.success & ~self.finite).sum())

    @property
    def coverage(self) -> np.ndarray:
        """Share of successes that hold the truth within 1.96 sigma, of each element of x. [-]"""
        return np.mean(np.abs(self.departures[self.success]) <= 1.96, axis=0)

    @property
    def bias(self) -> np.ndarray:
        """Mean departure of successes, of each element of x. [-]"""
        return np.mean(self.departures[self.success], axis=0)


def judged(pixels: Pixels, name: str, minimiser: Minimiser = DEFAULT_MINIMISER) -> Judged:
    """Retrieve pixels to which a case has happened."""
    given = CASES[pixels.name][name](pixels)
    without = given.prior is None
    # A start at the prior there can only be with one.
    how = minimiser._replace(starts="scan") if without else minimiser
    found = retrieve_pixels(
        pixels.forward, given.observations, given.states, prior=given.prior, minimiser=how
    )
    return weighed(pixels, given, found)


def weighed(pixels: Pixels, given: Stressed, found: Retrieved) -> Judged:
    """What was found of pixels, beside what is true of them."""
    kind, truth = pixels.kind, pixels.truth if given.truth is None else given.truth
    x, covariance = np.asarray(found.inversion.x), found.inversion.covariance
    with np.errstate(invalid="ignore"):  # of pixels that say so
        sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        departures = (x - truth) / sigma
    true, error = (reported(pixels, values) for values in (truth, x))
    error = np.abs(error - true) / (true / 100 if kind.relative else 1)
    fields = pixel_fields(
        kind.vector, kind.bands, found, given.states, given.observations.num_values
    )
    numbers = [
        field.values.reshape(-1, len(x))
        for variable, field in fields.items()
        if not variable.endswith("_second")  # which is NaN where there is none
    ]
    finite = np.isfinite(np.concatenate(numbers)).all(axis=0)
    return Judged(found.codes, departures, error, finite, given.told)


def reported(pixels: Pixels, x: Array | np.ndarray) -> np.ndarray:
    """What the printed errors of a kind are of."""
    kind = pixels.kind
    values = kind.vector.values(jax.numpy.asarray(x))
    for item in kind.vector.derived:
        if item.name == kind.reported:
            fire = kind.vector.state(jax.numpy.asarray(x), pixels.states).fire
            return np.asarray(item.read(fire))
    return np.asarray(values[kind.reported])
