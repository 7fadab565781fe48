"""Meaning of x, and the prior."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator import smoke
from retrievals.smoke import BANDS
from retrievals.state_vector import Prior, StateVector


def shifted(ssa, shift):
    """Single-scattering albedo with `shift` added to its logit."""
    return 1 / (1 + (1 - ssa) / ssa * np.exp(-shift))


AOD_550 = np.array([1e-4, 0.05, 0.7, 3.0, 9.9])
ROUNDING = 1e-13


def test_x_stands_for_the_quantities_it_was_made_of():
    vector = StateVector(retrieve_ssa=True)
    shift = np.linspace(-2, 2, len(AOD_550))
    x = vector.x(AOD_550, shift)
    np.testing.assert_allclose(vector.aod_550(x), AOD_550, rtol=ROUNDING)
    ssa = vector.ssa(x, jnp.full(len(AOD_550), 0.9))
    np.testing.assert_allclose(ssa, shifted(0.9, shift), rtol=ROUNDING)


def test_without_ssa_x_is_optical_depth_alone():
    vector = StateVector()
    assert vector.x(0.3).shape == (1,)
    assert vector.ssa(vector.x(0.3), 0.9) == 0.9


def test_x0_is_the_logarithm_of_thin_smoke():
    vector = StateVector()
    np.testing.assert_allclose(vector.x(2e-4) - vector.x(1e-4), np.log(2), rtol=2e-5)


def test_any_real_x_is_a_possible_plume():
    vector = StateVector(retrieve_ssa=True, aod_limit=6.0)
    x = jnp.array([[-500.0, -500.0], [500.0, 500.0], [0.0, 0.0]])
    reference = jnp.array([0.0, 1.0, 0.9])
    for quantity in (vector.aod_550, lambda x: vector.ssa(x, reference)):
        value, slope = jax.jvp(quantity, (x,), (jnp.ones_like(x),))
        assert np.isfinite(value).all() and np.isfinite(slope).all()
    assert (vector.aod_550(x) <= 6.0).all()
    np.testing.assert_array_equal(vector.ssa(x, reference), reference)


def test_slopes_are_derivatives():
    vector = StateVector(retrieve_ssa=True)
    x = vector.x(AOD_550, 0.3)
    reference = jnp.full(len(AOD_550), 0.9)
    _, aod_slope = jax.jvp(vector.aod_550, (x,), (jnp.ones_like(x),))
    np.testing.assert_allclose(vector.aod_550_slope(x), aod_slope, rtol=ROUNDING)
    _, ssa_slope = jax.jvp(lambda x: vector.ssa(x, reference), (x,), (jnp.ones_like(x),))
    np.testing.assert_allclose(vector.ssa_slope(x, reference), ssa_slope, rtol=1e-12)


def test_a_plume_gets_optical_depth_and_albedo_and_keeps_the_rest():
    vector, before = StateVector(retrieve_ssa=True), smoke(0.2, brightness=0.3, bands=BANDS)
    after = vector.plume(vector.x(1.7, -0.6), before)
    np.testing.assert_allclose(after.aod_550, 1.7, rtol=ROUNDING)
    for band in BANDS:
        np.testing.assert_allclose(after.ssa[band], shifted(before.ssa[band], -0.6), rtol=ROUNDING)
    assert (after.base, after.top) == (before.base, before.top)
    assert after.relative_extinction is before.relative_extinction or (
        after.relative_extinction == before.relative_extinction
    )


def test_the_limit_is_positive():
    with pytest.raises(ValueError, match="aod_limit must be positive; got 0"):
        StateVector(aod_limit=0.0)


def test_the_whitened_prior_measures_departures_by_their_covariance():
    covariance = np.array([[0.5, 0.2], [0.2, 0.3]])
    x_prior, x = np.array([-2.0, 0.1]), np.array([-1.0, 0.4])
    residual = Prior(jnp.asarray(x_prior), jnp.asarray(covariance)).residual(jnp.asarray(x))
    expected = (x - x_prior) @ np.linalg.solve(covariance, x - x_prior)
    np.testing.assert_allclose(np.sum(residual**2), expected, rtol=ROUNDING)
