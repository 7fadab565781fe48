"""Result codes of retrievals say what happened to the measurements."""

from functools import cache

import numpy as np
import pytest
from stress_retrievals_cases import CASES
from stress_retrievals_image import IMAGES, Image, judged_image
from stress_retrievals_judged import judged
from stress_retrievals_pixels import KINDS, Pixels

from retrievals import Minimiser, ResultCode

COUNT = 32
ONE_START = Minimiser(starts="prior")  # and one program less to compile
RESULTS_TOLD = {ResultCode.SUCCESS, ResultCode.NOT_OBSERVABLE}
# Share of pixels that end; from the prior alone some fires do not, of which the shares are unknown
# to a factor of 1,000.
FROM_ONE_START = {"smoke": 1.0, "fire": 0.9, "cloud": 1.0}
SLOW = pytest.mark.slow


@cache
def pixels(kind):
    return Pixels(kind, COUNT, streams=2)


@cache
def codes_of(beginning, kind="smoke"):
    (name,) = (name for name in CASES[kind] if name.startswith(beginning))
    return judged(pixels(kind), name, ONE_START)


def test_success_holds_the_truth_where_the_retrieval_is_told_all():
    """Of 64 numbers 95 % in the mean, at least 84 % in all but one of 1,000 draws."""
    for name in ("as the imager", "noise ten", "C03 sat", "cloud of 5, known"):
        found = codes_of(name)
        assert set(found.codes) <= RESULTS_TOLD
        # Pixels that say nothing do so by their errors, which are as true.
        held = np.abs(found.departures) <= 1.96
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
    lost = [
        codes_of(f"{name} missing").share(ResultCode.NOT_OBSERVABLE)
        for name in ("C02", "C01 and C02")
    ]
    assert 0 < lost[0] < lost[1]


@pytest.mark.parametrize(
    "kind", ["smoke", *(pytest.param(kind, marks=SLOW) for kind in ("fire", "cloud"))]
)
def test_nothing_measured_is_no_input(kind):
    assert codes_of("all bands missing", kind).share(ResultCode.INVALID_INPUT) == 1


@pytest.mark.parametrize(
    "kind", ["smoke", *(pytest.param(kind, marks=SLOW) for kind in ("fire", "cloud"))]
)
def test_bounds_alone_are_no_poor_fit_and_no_success(kind):
    """What saturates in all bands is explained by anything that is bright enough."""
    found = codes_of("all bands saturated", kind)
    assert set(found.codes) <= {ResultCode.NOT_OBSERVABLE, ResultCode.NOT_CONVERGED}
    assert found.share(ResultCode.NOT_OBSERVABLE) >= FROM_ONE_START[kind]


def test_a_pixel_that_is_no_number_moves_no_other():
    clean, holed = (codes_of(name) for name in ("as the imager", "albedo NaN"))
    assert set(holed.codes[::2]) == {ResultCode.NONFINITE}
    np.testing.assert_array_equal(holed.codes[1::2], clean.codes[1::2])
    # In chunks of other pixels sums are made in another order.
    np.testing.assert_allclose(holed.departures[1::2], clean.departures[1::2], rtol=1e-9)


@pytest.mark.slow
def test_codes_of_ash_are_true():
    """Its optics by radius: no success of what is not told, and none that is no number."""
    seen, wrong, empty = (
        codes_of(name, "ash") for name in ("as the imager", "C01 too bright", "all bands missing")
    )
    assert set(seen.codes) <= RESULTS_TOLD and seen.share(ResultCode.SUCCESS) > 0.8
    assert (np.abs(seen.departures) <= 1.96).mean() > 0.84
    assert wrong.share(ResultCode.POOR_FIT) > 0.8
    assert empty.share(ResultCode.INVALID_INPUT) == 1
    for found in (seen, wrong):
        assert found.finite[found.success].all()


@pytest.mark.slow
def test_a_fire_is_held_by_its_errors():
    """Also where some of the drawn fires saturate all bands: what is no number must show behind a
    bound as well."""
    quiet, loud, low = (codes_of(x, "fire") for x in ("as the imager", "noise ten", "C07 ends"))
    for found in (quiet, loud, low):
        assert np.isin(found.codes, [*RESULTS_TOLD]).mean() >= FROM_ONE_START["fire"]
        assert (np.abs(found.departures) <= 1.96).mean() > 0.84
        assert found.finite[found.success].all()
    holed = codes_of("ground's temperature NaN", "fire")
    assert set(holed.codes[::2]) == {ResultCode.NONFINITE}
    np.testing.assert_array_equal(holed.codes[1::2], quiet.codes[1::2])


@pytest.mark.slow
def test_what_was_wrong_about_a_fires_pixel_is_a_poor_fit():
    for name, share in (
        ("the same, not told", 0.5),
        ("C06 too bright", 0.5),
        ("ground darker", 0.5),
        ("cloud of 5, not known", 0.8),
    ):
        assert codes_of(name, "fire").share(ResultCode.POOR_FIT) > share, name


@pytest.mark.slow
def test_codes_of_cloud_are_true():
    """Two unknowns of two bands: noise and other droplets are explained by other cloud."""
    quiet, loud, thick = (
        codes_of(name, "cloud")
        for name in ("as the imager", "noise ten", "ten times thicker, known")
    )
    for found in (quiet, loud, thick):
        assert set(found.codes) <= {ResultCode.SUCCESS, ResultCode.MULTIPLE_SOLUTIONS}
        assert (np.abs(found.departures) <= 1.96).mean() > 0.8
        assert found.finite.all()
    # Sought among thin clouds, too: a success of 0.003 was 4, 134 sigma from there.
    thin = judged(pixels("cloud"), "a hundred times thinner, known")
    assert np.abs(thin.departures[thin.success]).max() < 10
    assert codes_of("prior ten times too large and sure", "cloud").share(ResultCode.POOR_FIT) > 0.9
    for name in ("albedo NaN", "no cloud water"):
        holed = codes_of(name, "cloud")
        assert set(holed.codes[::2]) == {ResultCode.NONFINITE}
        np.testing.assert_array_equal(holed.codes[1::2], quiet.codes[1::2])


@pytest.mark.slow
def test_bad_pixels_of_an_image_spoil_none_beside_them():
    image = Image(streams=2, side=12)
    found = {name: judged_image(image, name, ONE_START) for name in IMAGES}
    for name, one in found.items():
        assert not one.judged.lost, name
        others = ~IMAGES[name](image).bad & ~one.beside
        assert ResultCode.NOT_CONVERGED not in one.judged.codes[others], name
    clean = found["as the imager sees it"].judged
    assert clean.share(ResultCode.SUCCESS) > 0.9 and (clean.coverage > 0.84).all()
    for name, code in (
        ("5 x 5 pixels missing", ResultCode.INVALID_INPUT),
        ("5 x 5 pixels saturated", ResultCode.NOT_OBSERVABLE),
        ("albedo NaN in two columns", ResultCode.NONFINITE),
        ("one pixel's sigma 1e-160", ResultCode.NONFINITE),
    ):
        bad = IMAGES[name](image).bad
        assert set(found[name].judged.codes[bad]) == {code}, name
        assert found[name].success_beside > 0.9 and found[name].held_beside > 0.84, name
    # What sticks out of a smooth image is not explained, and nor is what is drawn to it.
    bright = found["one pixel as bright as a cloud, 0.9"]
    assert bright.success_beside < 0.5
    assert bright.judged.share(ResultCode.SUCCESS) > 0.8
    for name in ("the same, not told", "length ten times too large"):
        assert found[name].judged.share(ResultCode.POOR_FIT) > 0.5, name


def test_every_kind_has_cases():
    assert set(CASES) == set(KINDS)
