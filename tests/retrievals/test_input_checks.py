"""Doors: what cannot be retrieved is said, and spoils nothing else."""

import jax
import numpy as np
import pytest
from veil import VEIL, veiled_pixels

from retrievals import Observation, Prior, ResultCode, retrieve_pixels

CLEAN = 1e-8


@pytest.fixture(scope="module")
def veiled():
    """Observations, grounds and true optical depths."""
    return veiled_pixels()


def optical_depth(retrieved):
    return np.asarray(VEIL.vector.values(retrieved.inversion.x)["aod_550"])


def test_missing_bands_are_left_out(veiled):
    observation, ground, truth = veiled
    measured, sigma = observation.measured.copy(), observation.sigma.copy()
    measured[0, 0] = np.nan
    sigma[1, 1] = np.inf
    measured[2, 2], sigma[2, 2] = np.nan, np.nan
    measured[3] = np.nan
    sigma[4] = np.inf
    found = retrieve_pixels(VEIL, Observation(measured, sigma), ground, exact=True)
    expected = np.full(len(truth), ResultCode.SUCCESS)
    expected[[3, 4]] = ResultCode.INVALID_INPUT
    np.testing.assert_array_equal(found.codes, expected)
    fine = expected == ResultCode.SUCCESS
    np.testing.assert_allclose(optical_depth(found)[fine], truth[fine], atol=CLEAN)


def test_what_a_pixel_cannot_be_is_its_own_code(veiled):
    observation, ground, truth = veiled
    measured, sigma = observation.measured.copy(), observation.sigma.copy()
    sigma[0, 0] = -1e-3
    sigma[1, 0] = 0.0
    sigma[2, 0] = np.nan
    measured[3], sigma[3] = 100 * measured[3], 100 * sigma[3]  # in percent
    x_prior = np.asarray(VEIL.vector.x(truth)) + 0.01
    x_prior[4] = np.nan
    S_prior = np.ones((len(truth), 1, 1))
    S_prior[5] = np.nan
    prior = Prior(x_prior, S_prior)
    found = retrieve_pixels(VEIL, Observation(measured, sigma), ground, prior=prior)
    assert set(found.codes[:6]) == {ResultCode.INVALID_INPUT}
    assert set(found.codes[6:]) == {ResultCode.SUCCESS}
    assert "percent" in ResultCode.INVALID_INPUT.message


def test_a_prior_may_be_of_each_pixel(veiled):
    observation, ground, truth = veiled
    x_true = np.asarray(VEIL.vector.x(truth))
    tight = np.where(np.arange(12) < 6, 1e-8, 1.0)[:, None, None]
    found = retrieve_pixels(VEIL, observation, ground, prior=Prior(x_true + 1e-2, tight))
    moved = np.asarray(found.inversion.x - x_true)[:, 0]
    np.testing.assert_allclose(moved[:6], 1e-2, rtol=2e-2)
    assert (np.abs(moved[6:]) < 1e-3).all()
    assert (found.inversion.prior_cost[:6] < found.inversion.measurement_cost[:6]).all()


def test_trouble_with_all_pixels_is_one_sentence(veiled):
    observation, ground, _ = veiled
    none = jax.tree.map(lambda x: x[:0], (observation, ground))
    with pytest.raises(ValueError, match="no pixels to retrieve"):
        retrieve_pixels(VEIL, *none)
    percent = Observation(100 * observation.measured, 100 * observation.sigma)
    with pytest.raises(ValueError, match="in percent, so divide"):
        retrieve_pixels(VEIL, percent, ground)
    with pytest.raises(ValueError, match=r"measured.*\(12, 2\).*C01, C02, C03"):
        retrieve_pixels(VEIL, jax.tree.map(lambda x: x[:, :2], observation), ground)
    with pytest.raises(ValueError, match="a state vector of 1 element"):
        retrieve_pixels(VEIL, observation, ground, prior=Prior(np.zeros(2), np.eye(2)))


def test_fewer_bands_than_unknowns_need_a_prior(veiled):
    observation, ground, _ = veiled
    sigma = observation.sigma.copy()
    sigma[0] = np.inf
    sigma[0, 0] = observation.sigma[0, 0]
    found = retrieve_pixels(VEIL, Observation(observation.measured, sigma), ground, exact=True)
    assert found.codes[0] == ResultCode.SUCCESS  # one unknown, one band


@pytest.mark.float32
def test_single_precision_converges_as_double_does(veiled):
    observation, ground, truth = veiled
    with jax.enable_x64(False):
        prior = Prior(np.full(1, -3.0), np.eye(1))
        found = retrieve_pixels(VEIL, observation, ground, prior=prior)
        alone = retrieve_pixels(VEIL, observation, ground)
    assert found.inversion.x.dtype == np.float32
    assert found.inversion.converged.all() and alone.inversion.converged.all()
    assert set(alone.codes) == {ResultCode.SUCCESS}
    np.testing.assert_allclose(optical_depth(alone), truth, rtol=2e-4)


def test_correlations_are_correlations():
    observation, ground, _ = veiled_pixels()
    correlation = np.broadcast_to(np.eye(3), (12, 3, 3)).copy()
    correlation[0, 0, 1] = 0.5  # not symmetric
    correlation[1] = 1.5 - 0.5 * np.eye(3)  # not positive
    correlation[2, 1, 1] = 2.0
    correlation[3, 0, 0] = np.nan
    wrong = Observation(observation.measured, observation.sigma, correlation=correlation)
    found = retrieve_pixels(VEIL, wrong, ground, exact=True)
    assert set(found.codes[:4]) == {ResultCode.INVALID_INPUT}
    assert set(found.codes[4:]) == {ResultCode.SUCCESS}
    short = Observation(observation.measured, observation.sigma, correlation=correlation[0])
    with pytest.raises(ValueError, match="correlation of the observations has the shape"):
        retrieve_pixels(VEIL, short, ground, exact=True)
