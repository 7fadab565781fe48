"""The same in single precision, with double precision off and on."""

import jax
import numpy as np
import pytest
from columns_of_smoke import HOW, INPUTS, colour, columns

from abi_operator.sensitivity import (
    PlumeBand,
    covariance_of,
    sampled_variance,
    sensitivity,
    ssa_for_mean,
    ssa_of_each,
)
from abi_operator.sensitivity.ssa_root import FALLS_SHORT, MEAN_TOLERANCE
from abi_operator.settings import Settings

pytestmark = pytest.mark.float32


@pytest.fixture(scope="module")
def states():
    return jax.tree.map(lambda x: np.asarray(x, np.float32), columns())


def test_sensitivities(states):
    found = sensitivity(colour, states, INPUTS, second_order=False)
    assert {x.dtype for x in found} == {np.dtype(np.float32)}
    # Steps are wide, so that rounding does not count and their third order does, to some per cent.
    steps = np.array([one.step for one in INPUTS])
    both, slope = (found.up - found.down) / 2, found.jacobian * steps
    assert np.max(np.abs(both - slope) / np.abs(slope).max(axis=-1, keepdims=True)) < 0.03
    covariance = covariance_of(INPUTS)
    drawn = sampled_variance(colour, states, INPUTS, found.jacobian, covariance, num_samples=8)
    assert (drawn.total > 0).all()


def test_roots(states):
    plume = PlumeBand(states, "smoke", "C03", Settings(**HOW))
    base = np.asarray(plume.brf(plume.ssa))
    for factor in (1.05, 0.9):
        mean = ssa_for_mean(plume, factor, np.ones(base.shape, bool))
        assert mean.ssa.dtype == mean.brf.dtype == np.float32
        assert abs(mean.brf.mean() / (factor * base.mean()) - 1) < MEAN_TOLERANCE
        each = ssa_of_each(plume, factor)
        reached = each.code != FALLS_SHORT
        assert reached.any() and np.all(np.isin(each.ssa[~reached], (0, 1)))
        np.testing.assert_allclose(each.brf[reached], factor * base[reached], rtol=MEAN_TOLERANCE)
