"""Random fields: their mean, their variance and the detail that a coarse grid leaves out."""

import numpy as np
import pytest

from abi_operator.demo.noise import make_noise


@pytest.fixture
def noise():
    return make_noise(np.random.default_rng(1), longest=50e3, shortest=5e3)


def test_mean_is_0_and_variance_1(noise):
    east, north = np.meshgrid(*2 * [np.arange(-500e3, 500e3, 5e3)])
    values = noise(east, north)
    # 20 of the longest waves fit along each side, so that averages are good to about 1/20.
    assert values.mean() == pytest.approx(0, abs=0.05)
    assert values.var() == pytest.approx(1, abs=0.1)


def test_waves_that_a_grid_cannot_resolve_are_left_out(noise):
    east, north = np.random.default_rng(2).uniform(-1e6, 1e6, size=(2, 2000))
    fine, coarse, none = (noise(east, north, spacing) for spacing in (2.5e3, 10e3, 25.1e3))
    np.testing.assert_array_equal(fine, noise(east, north))
    assert 0.3 < coarse.var() < fine.var()
    np.testing.assert_array_equal(none, 0)
