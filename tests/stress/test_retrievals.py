"""Result codes of retrievals say what happened to the measurements."""

from functools import cache

import numpy as np
from stress_retrievals import CASES, Pixels, judged

from retrievals import Minimiser, ResultCode

COUNT = 32
ONE_START = Minimiser(starts="prior")  # and one program less to compile


@cache
def pixels():
    return Pixels(COUNT, streams=2)


@cache
def codes_of(beginning):
    (name,) = (name for name in CASES if name.startswith(beginning))
    return judged(pixels(), name, ONE_START)


def test_success_holds_the_truth_where_the_retrieval_is_told_all():
    """Of 64 numbers 95 % in the mean, at least 84 % in all but one of 1,000 draws."""
    for name in ("as the imager", "noise ten", "C03 sat", "cloud of 5, known"):
        found = codes_of(name)
        assert set(found.codes) <= {ResultCode.SUCCESS, ResultCode.NOT_OBSERVABLE}
        # Pixels that say nothing do so by their errors, which are as true.
        held = found.departures <= 1.96
        assert held.mean() > 0.84, name


def test_noise_takes_what_is_told_and_says_so():
    quiet, loud = (codes_of(name) for name in ("as the imager", "noise ten"))
    assert quiet.share(ResultCode.SUCCESS) > 0.8
    assert loud.share(ResultCode.NOT_OBSERVABLE) > 0.5


def test_what_no_solution_explains_is_a_poor_fit():
    """Of three bands two are used up by the unknowns, so that some wrong ones are explained."""
    for name, share in (
        ("the same, not told", 0.6),
        ("C01 too bright", 0.8),
        ("prior ten times too large and sure", 0.95),
        ("cloud of 5, not known", 0.9),
        ("cloud of 5 known where there is none", 0.9),
    ):
        assert codes_of(name).share(ResultCode.POOR_FIT) > share, name


def test_bands_that_are_missing_make_less_observable_and_none_invalid():
    one, two = (codes_of(name) for name in ("C02 missing", "C01 and C02 missing"))
    lost = [found.share(ResultCode.NOT_OBSERVABLE) for found in (one, two)]
    assert 0 < lost[0] < lost[1]
    assert codes_of("all bands missing").share(ResultCode.INVALID_INPUT) == 1


def test_bounds_alone_are_no_poor_fit_and_no_success():
    """What saturates in all bands is explained by anything that is bright enough."""
    assert codes_of("all bands saturated").share(ResultCode.NOT_OBSERVABLE) == 1


def test_a_pixel_that_is_no_number_moves_no_other():
    clean, holed = (codes_of(name) for name in ("as the imager", "albedo NaN"))
    assert set(holed.codes[::2]) == {ResultCode.NONFINITE}
    np.testing.assert_array_equal(holed.codes[1::2], clean.codes[1::2])
    # In chunks of other pixels sums are made in another order.
    np.testing.assert_allclose(holed.departures[1::2], clean.departures[1::2], rtol=1e-9)
