"""Minima of the scan."""

from functools import partial

import jax
import numpy as np
import pytest

from retrievals import StateVector
from retrievals.chunks import map_chunks
from retrievals.declarations import SCANNED_AOD_550, albedo, plume
from retrievals.first_guess import candidates, guesses
from retrievals.pixels import _scan_chunk  # the program of all retrievals
from retrievals.quantities import with_part

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
    guess, several = candidates(cost, (5,), 2)
    np.testing.assert_array_equal(several, [False, True, True, False])
    np.testing.assert_array_equal(guess[:, 0], [2, 2, 2, 4])
    np.testing.assert_array_equal(guess[several, 1], [0, 4])


def test_plateaus_and_nothing_but_nan_give_one_candidate_each():
    guess, several = candidates(np.array([[1.0, 1.0, 2.0], [np.nan] * 3]), (3,), 2)
    assert guess[0, 0] == 0 and not several.any()


def test_further_starts_are_no_neighbours_while_there_are_others():
    """Two quantities of 3 and 2 guesses: the lowest of the second counts along the first."""
    cost = np.array([[3.0, 1.0, 2.0, 4.0, 6.0, 5.0]])
    guess, several = candidates(cost, (3, 2), 6)
    np.testing.assert_array_equal(guess[0, :2], [1, 5])
    assert sorted(guess[0]) == list(range(6)) and not several.any()
    assert candidates(cost, (6, 1), 1)[0].shape == (1, 1)


@pytest.mark.parametrize("limit", [0.0, 1.0])
def test_what_a_state_holds_at_its_limit_begins_inside(columns, limit):
    """As black water, or snow: x of a limit is infinite."""
    _, states, _ = columns
    one = jax.tree.map(lambda leaf: np.asarray(leaf)[0], states)
    one = with_part(one, "albedo.C02", np.asarray(limit))
    vector = StateVector((*plume("smoke").quantities, albedo("C02")))
    found = np.asarray(guesses(vector, one))
    assert np.isfinite(found).all()
    batch = jax.tree.map(lambda leaf: np.asarray(leaf)[None], one)
    np.testing.assert_array_equal(found[:, 1], vector.prior(batch).x_prior[0, 1])


def test_the_scan_is_lowest_beside_the_truth(columns, forward):
    observation, states, truth = columns
    dark = DARK * 4 + 1  # optical depth 0.3
    cost = map_chunks(partial(_scan_chunk, forward), observation, states)[0][dark]
    assert np.asarray(SCANNED_AOD_550)[np.argmin(cost)] == 0.35
    assert guesses(forward.vector).shape == (len(SCANNED_AOD_550), 1)
    assert truth[dark] == 0.3
