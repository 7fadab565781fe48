"""Which minima are trusted."""

import equinox as eqx
import numpy as np
import pytest

from retrievals.declarations import fire, liquid_cloud, plume
from retrievals.diagnostics import probability_of_cost
from retrievals.inverse import Inversion
from retrievals.quality import EXACT_COST, result_codes, sigmas
from retrievals.results import ResultCode, flag_attributes

VECTOR = plume("smoke")


def inversion(aod_550=0.5, sigma=0.01, cost=0.0, converged=True):
    """One pixel's inversion, as if it had been found."""
    x = np.asarray(VECTOR.x(np.array([aod_550])))
    variance = (sigma / np.asarray(VECTOR.slopes(x))[:, 0]) ** 2
    return Inversion(
        x=x,
        covariance=variance[:, None, None],
        averaging_kernel=np.ones((1, 1, 1)),
        measurement_cost=np.array([cost]),
        prior_cost=np.zeros(1),
        num_steps=np.array([5]),
        converged=np.array([converged]),
    )


def code(best, rival=None, exact=True, num_bands=3):
    rival = best if rival is None else rival
    return ResultCode(result_codes(VECTOR, best, rival, np.array([num_bands]), exact=exact)[0])


def test_the_error_of_optical_depth_is_propagated():
    np.testing.assert_allclose(sigmas(VECTOR, inversion(sigma=0.03)), [[0.03]], rtol=1e-13)


@pytest.mark.parametrize(
    ("best", "expected"),
    [
        (inversion(), ResultCode.SUCCESS),
        (inversion(converged=False), ResultCode.NOT_CONVERGED),
        (inversion(cost=np.nan), ResultCode.NONFINITE),
        (inversion(cost=2 * EXACT_COST), ResultCode.POOR_FIT),
        (inversion(aod_550=1.0, sigma=0.21), ResultCode.NOT_OBSERVABLE),
        (inversion(aod_550=1.0, sigma=0.19), ResultCode.SUCCESS),
        (inversion(sigma=np.nan), ResultCode.NOT_OBSERVABLE),
    ],
)
def test_a_minimum_without_rival(best, expected):
    assert code(best) == expected


def test_of_errors_only_that_of_optical_depth_has_a_limit():
    """Which the message says; another quantity may have any error that is finite."""
    vectors = (plume("ash", effective_radius=True), fire(), liquid_cloud())
    limited = {q.name for v in vectors for q in v.quantities if q.largest_error is not None}
    assert limited == {"aod_550"}
    message = ResultCode.NOT_OBSERVABLE.message
    assert "of optical depth exceeds" in message and "something else is infinite" in message
    x = np.asarray(fire().x(np.array([800.0]), np.array([1e-3])))
    ones = np.ones(1)
    for variance, expected in (
        (1e4, ResultCode.SUCCESS),
        (np.inf, ResultCode.NOT_OBSERVABLE),
    ):
        found = Inversion(
            x=x,
            covariance=np.diag([variance, 1.0])[None],
            averaging_kernel=np.eye(2)[None],
            measurement_cost=0 * ones,
            prior_cost=0 * ones,
            num_steps=ones,
            converged=ones == 1,
        )
        codes = result_codes(fire(), found, found, np.array([3]), exact=False)
        assert codes[0] == expected


def test_slopes_that_are_no_number_are_no_lack_of_steps():
    """Beside a prior only they leave the covariance none; without, x may be undetermined."""
    best = inversion(sigma=np.nan, converged=False)
    assert code(best) == ResultCode.NOT_CONVERGED
    best = eqx.tree_at(lambda i: i.prior_cost, best, np.array([0.1]))
    assert code(best) == ResultCode.NONFINITE


def test_noise_excuses_what_it_explains():
    # chi-square with 2 degrees of freedom: exceeded by chance with probability exp(-cost / 2)
    assert code(inversion(cost=13.0), exact=False) == ResultCode.SUCCESS
    assert code(inversion(cost=14.0), exact=False) == ResultCode.POOR_FIT
    np.testing.assert_allclose(probability_of_cost(np.array([5.0]), 2), np.exp(-2.5), rtol=1e-12)


def test_a_rival_is_a_second_solution():
    best = inversion(aod_550=0.5, cost=1.0)
    assert (
        code(best, inversion(aod_550=2.0, cost=4.0), exact=False) == ResultCode.MULTIPLE_SOLUTIONS
    )
    assert code(best, inversion(aod_550=2.0, cost=6.0), exact=False) == ResultCode.SUCCESS
    assert code(best, inversion(aod_550=0.505, cost=1.0), exact=False) == ResultCode.SUCCESS
    unfinished = inversion(aod_550=2.0, cost=4.0, converged=False)
    assert code(best, unfinished, exact=False) == ResultCode.SUCCESS
    exact = inversion(aod_550=0.5)
    assert code(exact, inversion(aod_550=0.6)) == ResultCode.MULTIPLE_SOLUTIONS
    assert code(exact, inversion(aod_550=0.6, cost=1e-5)) == ResultCode.SUCCESS


def test_without_spare_measurements_only_an_exact_fit_will_do():
    assert code(inversion(cost=1.0), exact=False, num_bands=1) == ResultCode.POOR_FIT
    assert code(inversion(), exact=False, num_bands=1) == ResultCode.SUCCESS


def test_bounds_are_met_in_their_measure():
    """At the ceiling itself the likelihood of a bound costs 2 ln 2, though nothing is wrong."""
    alone = {"num_values": np.array([1]), "bounded": np.array([True])}
    for exact in (False, True):
        for cost, expected in ((2 * np.log(2), ResultCode.SUCCESS), (11.0, ResultCode.POOR_FIT)):
            best = inversion(cost=cost)
            assert result_codes(VECTOR, best, best, exact=exact, **alone)[0] == expected


def test_every_code_has_a_message_and_a_flag():
    assert all(code.message.endswith(".") for code in ResultCode)
    attributes = flag_attributes()
    assert len(attributes["flag_values"]) == len(attributes["flag_meanings"].split())
