"""Scores of numbers written down by hand."""

import numpy as np
import pytest

from retrievals.results import expected_error
from retrievals.scoring import binned_scores, detection, score

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


def test_what_does_not_vary_has_no_slope():
    """The variance of 513 times 0.1 is 2e-34, and not 0."""
    same, other = np.full(513, 0.1), np.linspace(0, 1, 513)
    of_truth, of_retrieved = score(other, same), score(same, other)
    assert np.isnan([of_truth.slope, of_truth.correlation, of_retrieved.correlation]).all()
    assert abs(of_retrieved.slope) < 1e-12


def test_bins_share_edges_with_the_one_below():
    bins = binned_scores(RETRIEVED, TRUTH, TRUTH, (0.0, 1.0, 2.5, np.inf))
    assert [b.num_pairs for b in bins] == [2, 1, 1]
    assert bins[2].max_error == pytest.approx(1.0)


def test_standardised_errors():
    scored = score(np.array([1.0, -1.8]), np.zeros(2), sigma=np.array([2.0, 1.0]))
    assert scored.chi_square == pytest.approx((0.25 + 3.24) / 2)
    assert scored.coverage_68 == 0.5 and scored.coverage_95 == 1
    assert np.isnan(score(RETRIEVED, TRUTH).chi_square)


def test_normal_errors_are_covered_as_they_should_be():
    rng = np.random.default_rng(8)
    sigma = rng.uniform(0.5, 2, 20_000)
    scored = score(sigma * rng.standard_normal(20_000), np.zeros(20_000), None, sigma)
    # 4 standard errors of 20,000 draws
    assert abs(scored.coverage_68 - 0.6827) < 4 * np.sqrt(0.6827 * 0.3173 / 20_000)
    assert abs(scored.coverage_95 - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 20_000)
    assert abs(scored.chi_square - 1) < 4 * np.sqrt(2 / 20_000)
    assert scored.percentile_5 < scored.percentile_25 < scored.percentile_75 < scored.percentile_95


def test_detection_by_hand():
    found = detection(np.array([5.0, 1.0, 3.0, -np.inf, 2.0]), np.array([1, 1, 0, 0, 0], bool), 2.5)
    assert (found.hit_rate, found.false_alarm_rate, found.false_alarm_ratio) == (0.5, 1 / 3, 0.5)
    # of 6 pairs, 5 exceeds all three and 1 the last alone
    assert found.roc_area == pytest.approx(4 / 6)
    assert detection(np.ones(4), np.array([1, 0, 1, 0], bool), 1.0).roc_area == 0.5  # all tie
    assert np.isnan(detection(np.ones(2), np.zeros(2, bool), 1.0).roc_area)
