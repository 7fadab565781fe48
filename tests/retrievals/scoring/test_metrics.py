"""Scores of numbers written down by hand."""

import numpy as np
import pytest

from retrievals.results import expected_error
from retrievals.scoring import binned_scores, score
from retrievals.scoring.metrics import standardised_spread

TRUTH = np.array([0.0, 1.0, 2.0, 3.0])
RETRIEVED = np.array([0.1, 1.0, 2.4, 4.0])


def test_score_by_hand():
    scored = score(RETRIEVED, TRUTH)
    assert scored.num_pairs == 4
    assert scored.bias == pytest.approx(1.5 / 4)
    assert scored.rmse == pytest.approx(np.sqrt((0.01 + 0.16 + 1.0) / 4))
    assert scored.max_error == pytest.approx(1.0)
    # deviations of the truth -1.5 -0.5 0.5 1.5, of the retrieved -1.775 -0.875 0.525 2.125
    assert scored.slope == pytest.approx(6.55 / 5)
    assert scored.correlation == pytest.approx(6.55 / np.sqrt(5 * 8.7075))
    # expected errors 0.05 0.20 0.35 0.50 against 0.1 0 0.4 1
    assert scored.within == 0.25


def test_the_expected_error_is_that_of_dark_target():
    np.testing.assert_allclose(expected_error(np.array([0.0, 1.0])), [0.05, 0.2])


def test_too_few_pairs_are_not_a_number():
    assert score(np.array([]), np.array([])).num_pairs == 0
    assert np.isnan(score(np.array([]), np.array([])).rmse)
    one = score(np.array([1.1]), np.array([1.0]))
    assert one.bias == pytest.approx(0.1) and np.isnan(one.slope) and np.isnan(one.correlation)


def test_bins_share_edges_with_the_one_below():
    bins = binned_scores(RETRIEVED, TRUTH, TRUTH, (0.0, 1.0, 2.5, np.inf))
    assert [b.num_pairs for b in bins] == [2, 1, 1]
    assert bins[2].max_error == pytest.approx(1.0)


def test_standardised_errors():
    square, within = standardised_spread(np.array([1.0, -2.0]), np.array([2.0, 1.0]))
    assert square == pytest.approx((0.25 + 4) / 2) and within == 0.5
