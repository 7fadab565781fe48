"""Roots of the operator in a plume's single-scattering albedo, against bisection."""

import jax
import numpy as np
import pytest

from abi_operator.files import InputError
from abi_operator.scene import column_states
from abi_operator.sensitivity import PlumeBand, ssa_for_mean, ssa_of_each
from abi_operator.sensitivity.ssa_root import FALLS_SHORT, MEAN_TOLERANCE, REACHED
from abi_operator.settings import Settings

HOW = Settings(gases=(), num_streams=2)
# Of roots, beside which a step of Newton's method ends at 1e-10.
AGREE = 1e-8


@pytest.fixture(scope="module")
def plume(image):
    inside = (image["ash_brightness"] > 0).values
    states = jax.tree.map(lambda x: x[inside.ravel()], column_states(image, ("C03",)))
    return PlumeBand(states, "ash", "C03", HOW)


def bisected(function, target, low, high):
    """Of a rising function, the root of each column."""
    for _ in range(40):
        middle = (low + high) / 2
        above = function(middle) > target
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return (low + high) / 2


@pytest.mark.parametrize("factor", [1.1, 0.9])
def test_one_shift_changes_the_mean_as_asked(plume, factor):
    ssa = np.asarray(plume.ssa)
    counted = np.arange(ssa.size) % 3 > 0
    root = ssa_for_mean(plume, factor, counted)
    shift = root.ssa - ssa
    np.testing.assert_allclose(shift, shift[0], rtol=1e-12)
    means = np.mean(root.brf[counted]), np.mean(np.asarray(plume.brf(ssa))[counted])
    assert abs(means[0] / (factor * means[1]) - 1) < 1e-9 < MEAN_TOLERANCE
    found = bisected(
        lambda x: np.mean(np.asarray(plume.brf(ssa + x))[counted]), factor * means[1], -0.5, 0.05
    )
    assert abs(found - shift[0]) < AGREE and (root.code == REACHED).all()


@pytest.mark.parametrize("factor", [1.1, 0.9])
def test_every_pixel_changes_as_asked_or_keeps_the_end(plume, factor):
    ssa = np.asarray(plume.ssa)
    end = 1.0 if factor > 1 else 0.0
    base, farthest = np.asarray(plume.brf(ssa)), np.asarray(plume.brf(np.full_like(ssa, end)))
    reachable = (farthest >= factor * base) == (factor > 1)
    root = ssa_of_each(plume, factor)
    assert (root.code == np.where(reachable, REACHED, FALLS_SHORT)).all()
    assert reachable.any() and (factor < 1 or not reachable.all())
    assert (root.ssa[~reachable] == end).all()
    np.testing.assert_allclose(root.brf[reachable], factor * base[reachable], rtol=1e-9)
    found = bisected(lambda x: np.asarray(plume.brf(x)), factor * base, 0 * ssa, 0 * ssa + 1)
    np.testing.assert_allclose(root.ssa[reachable], found[reachable], atol=AGREE)


def test_a_mean_that_falls_short_keeps_the_end(plume):
    root = ssa_for_mean(plume, 3.0, np.ones(plume.ssa.shape, bool))
    assert (root.ssa == 1).all() and (root.code == FALLS_SHORT).all()


def test_the_slope_is_that_of_the_operator(plume):
    ssa, step = np.asarray(plume.ssa), 1e-5
    central = (np.asarray(plume.brf(ssa + step)) - np.asarray(plume.brf(ssa - step))) / (2 * step)
    np.testing.assert_allclose(plume.slope(), central, rtol=1e-7)


def test_what_cannot_be_asked_is_told(plume):
    with pytest.raises(ValueError, match="no column is counted"):
        ssa_for_mean(plume, 1.1, np.zeros(plume.ssa.shape, bool))
    with pytest.raises(InputError, match="no plume 'smoke'.*there are \\['ash'\\]"):
        PlumeBand(plume.states, "smoke", "C03", HOW)
