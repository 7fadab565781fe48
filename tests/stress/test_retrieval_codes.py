"""Whatever was measured, a pixel's code agrees with what is given for it."""

import jax
import numpy as np
import pytest
from drawn import REPEATABLE, all_finite, among, array, powers
from hypothesis import given, settings
from stress_retrievals_pixels import Pixels
from veil import TWO, VEIL

from retrievals import Minimiser, Observation, Prior, ResultCode, retrieve_pixels
from retrievals.observation import LARGEST_REFLECTANCE_FACTOR
from retrievals.quality import sigmas

COUNT, BANDS = 12, 3
SIZE = COUNT * BANDS
MEASURED = array(among(-0.1, 1.3, np.nan, np.inf, -np.inf, 0.0, -1e3, -1e300, 1e-300), SIZE)
SIGMA = array(powers(-6, 3, np.nan, np.inf, 1e-300, 5e-324, 1e300, -1.0, 1e-160, 0.01, 1e-3), SIZE)
SATURATED = array(among(0.0, 1.0), SIZE)
GROUND = array(among(0.0, 1.0, 0.1, 0.2, 0.3, 0.4, np.nan), SIZE)
PRIOR = array(among(-6.0, 6.0), 2 * COUNT)
ONE_START = Minimiser(starts="prior")
FEW = settings(REPEATABLE, max_examples=8)  # each is a retrieval


def of_pixels(numbers):
    return numbers.reshape(COUNT, BANDS).copy()


def observed(measured, sigma, saturated):
    """Observations, of which the first is in percent."""
    measured, sigma = of_pixels(measured), of_pixels(sigma)
    measured[0, 0], sigma[0, 0] = 30.0, 0.1
    return Observation(measured, sigma, of_pixels(saturated) > 0.7)


def refused(seen, size=0):
    """Codes of what is not attempted, given how many values are needed; SUCCESS elsewhere."""
    finite = np.isfinite(seen.measured)
    present = finite & np.isfinite(seen.sigma)
    wrong = (seen.sigma <= 0) | (np.isnan(seen.sigma) & finite)
    wrong |= present & (seen.measured > LARGEST_REFLECTANCE_FACTOR)
    codes = np.where(seen.num_values < size, ResultCode.TOO_FEW_BANDS, ResultCode.SUCCESS)
    return np.where(wrong.any(axis=1) | ~present.any(axis=1), ResultCode.INVALID_INPUT, codes)


def assert_codes_agree(vector, found, seen, not_attempted):
    """A success is finite, inside its limits and as well known as it must be."""
    attempted = not_attempted == ResultCode.SUCCESS
    np.testing.assert_array_equal(found.codes[~attempted], not_attempted[~attempted])
    assert set(found.codes) <= set(ResultCode)
    rows = np.flatnonzero(found.codes == ResultCode.SUCCESS)
    assert attempted[rows].all() and (seen.num_values[rows] > 0).all()
    best = jax.tree.map(lambda x: x[rows], found.inversion)
    errors = sigmas(vector, best)
    assert all_finite([*jax.tree.leaves(best), errors])
    assert best.converged.all() and (errors > 0).all()
    for i, (name, value) in enumerate(vector.values(best.x).items()):
        quantity = vector.quantities[i]
        if hasattr(quantity.transform, "upper"):
            low, high = quantity.transform.lower, quantity.transform.upper
            assert ((value >= low) & (value <= high)).all(), name
        if quantity.largest_error is not None:
            assert (errors[:, i] <= quantity.largest_error(np.asarray(value))).all(), name


def assert_holes_are_told(found, seen, ground, not_attempted):
    """A forward model that is NaN in a band that counts explains nothing, saturated or not."""
    present = np.isfinite(seen.measured) & np.isfinite(seen.sigma)
    holed = (present & np.isnan(ground)).any(axis=1) & (not_attempted == ResultCode.SUCCESS)
    assert (found.codes[holed] == ResultCode.NONFINITE).all()


@given(MEASURED, SIGMA, SATURATED, GROUND, PRIOR)
@FEW
def test_codes_with_a_prior(measured, sigma, saturated, ground, prior):
    seen, ground = observed(measured, sigma, saturated), of_pixels(ground)
    known = Prior(prior.reshape(COUNT, 2), np.diag([0.5, 0.01]))
    found = retrieve_pixels(TWO, seen, ground, prior=known, minimiser=ONE_START)
    not_attempted = refused(seen)
    assert_codes_agree(TWO.vector, found, seen, not_attempted)
    assert_holes_are_told(found, seen, ground, not_attempted)


@pytest.mark.slow
@pytest.mark.parametrize("forward", [VEIL, TWO])
def test_codes_without_a_prior(forward):
    @given(MEASURED, SIGMA, SATURATED, GROUND)
    @REPEATABLE
    def of(measured, sigma, saturated, ground):
        seen, ground = observed(measured, sigma, saturated), of_pixels(ground)
        found = retrieve_pixels(forward, seen, ground)
        not_attempted = refused(seen, forward.vector.size)
        assert_codes_agree(forward.vector, found, seen, not_attempted)
        assert_holes_are_told(found, seen, ground, not_attempted)

    of()


def test_a_saturated_band_hides_no_forward_model_that_is_nan():
    """The other two bands are explained, which is not enough."""
    ground = np.full((COUNT, BANDS), 0.1)
    seen = np.asarray(TWO(TWO.vector.x(np.full(COUNT, 0.5), np.zeros(COUNT)), ground))
    ground[1::2, 2] = np.nan
    bound = np.broadcast_to([False, False, True], seen.shape)
    found = retrieve_pixels(TWO, Observation(seen, np.full(seen.shape, 1e-3), bound), ground)
    told = found.codes == ResultCode.NONFINITE
    np.testing.assert_array_equal(told, np.arange(COUNT) % 2 == 1)


def test_what_is_not_determined_has_a_code_and_warns_of_nothing():
    """Measurements of hardly any weight: variances are infinite, or below 0 by rounding."""
    sigma = np.geomspace(1e-2, 1e300, COUNT)[:, None] * np.ones(BANDS)
    seen, ground = np.full((COUNT, BANDS), 0.2), np.linspace(0, 1, SIZE).reshape(COUNT, BANDS)
    found = retrieve_pixels(TWO, Observation(seen, sigma), ground)
    assert (found.codes[2:] != ResultCode.SUCCESS).all()


@pytest.mark.slow
def test_codes_of_the_operator():
    """Columns of smoke at 2 streams, as `test_retrievals` has them."""
    pixels = Pixels("smoke", COUNT, streams=2)

    @given(MEASURED, SIGMA, SATURATED, PRIOR)
    @REPEATABLE
    def of(measured, sigma, saturated, prior):
        seen = observed(measured, sigma, saturated)
        known = Prior(prior.reshape(COUNT, 2), pixels.prior.S_prior)
        found = retrieve_pixels(
            pixels.forward, seen, pixels.states, prior=known, minimiser=ONE_START
        )
        assert_codes_agree(pixels.forward.vector, found, seen, refused(seen))

    of()
