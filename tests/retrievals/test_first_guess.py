"""Minima of the scan."""

from functools import partial

import numpy as np

from retrievals.chunks import map_chunks
from retrievals.declarations import SCANNED_AOD_550
from retrievals.first_guess import candidates, guesses
from retrievals.pixels import _scan_chunk  # the program of all retrievals

DARK = 0  # row of a scene


def test_the_two_lowest_minima_are_candidates():
    cost = np.array(
        [
            [9.0, 4.0, 1.0, 3.0, 8.0],  # one minimum
            [2.0, 5.0, 1.0, 3.0, 8.0],  # two, one at the edge
            [3.0, 5.0, 1.0, 3.0, 2.0],  # three
            [np.nan, 5.0, 4.0, 3.0, 2.0],
        ]
    )
    pixel, guess = candidates(cost)
    np.testing.assert_array_equal(pixel, [0, 1, 2, 3, 1, 2])
    np.testing.assert_array_equal(guess, [2, 2, 2, 4, 0, 4])


def test_plateaus_and_nothing_but_nan_give_one_candidate_each():
    pixel, guess = candidates(np.array([[1.0, 1.0, 2.0], [np.nan] * 3]))
    np.testing.assert_array_equal(pixel, [0, 1])
    assert guess[0] == 0


def test_the_scan_is_lowest_beside_the_truth(columns, forward):
    observation, states, truth = columns
    dark = DARK * 4 + 1  # optical depth 0.3
    cost = map_chunks(partial(_scan_chunk, forward), observation, states)[0][dark]
    assert np.asarray(SCANNED_AOD_550)[np.argmin(cost)] == 0.35
    assert guesses(forward.vector).shape == (len(SCANNED_AOD_550), 1)
    assert truth[dark] == 0.3
