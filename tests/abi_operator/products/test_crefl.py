"""Crefl's formulas at the figures of another implementation, and in their limits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.products import crefl_air

ROUNDING = 1e-12
# mu0, mu, relative azimuth [degrees] and path reflectance at tau = 0.18472, by `_chand` of satpy
# 0.60.
SATPY = [
    (0.9, 0.8, 30.0, 0.09219906189062034),
    (0.5, 0.6, 150.0, 0.12474476409618791),
    (0.7, 1.0, 0.0, 0.07513561340353808),
    (0.35, 0.45, -75.0, 0.22847062177759553),
]


def test_spherical_albedo_by_quadrature():
    """E_3 by its integral, int_1^inf e^(-tx) / x^3 dx = int_0^1 u e^(-t/u) du."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    u, w = (nodes + 1) / 2, weights / 2
    for tau in (0.001, 0.05, 0.18472, 0.9):
        third = w @ (u * np.exp(-tau / u))
        expected = (3 * tau - (4 + 2 * tau) * third + 2 * np.exp(-tau)) / (4 + 3 * tau)
        found = crefl_air(tau, np.array(0.5), np.array(0.5), np.array(0.0)).spherical_albedo
        np.testing.assert_allclose(found, expected, atol=1e-6)  # of the series for E_1, 2e-7


def test_transmittance_by_hand():
    """Overhead, tau = 2/3: both factors are (5/3 - e^(-2/3) / 3) / 2."""
    found = crefl_air(2 / 3, np.array(1.0), np.array(1.0), np.array(0.0)).transmittance
    np.testing.assert_allclose(found, ((5 / 3 - np.exp(-2 / 3) / 3) / 2) ** 2, rtol=ROUNDING)


def test_path_reflectance_at_published_code():
    mu0, mu, azimuth, expected = np.array(SATPY).T
    found = crefl_air(0.18472, mu0, mu, np.radians(azimuth)).path_brf
    np.testing.assert_allclose(found, expected, rtol=1e-10)


def test_limit_of_thin_air_is_single_scattering():
    """tau P / (4 mu0 mu), with P of 6S's depolarisation."""
    mu0, mu, azimuth, tau = 0.6, 0.8, 0.7, 1e-7
    angle = -mu0 * mu - 0.8 * 0.6 * np.cos(azimuth)
    phase = 1 + 0.958725775 / 2 * (1.5 * angle**2 - 0.5)
    found = crefl_air(tau, np.array(mu0), np.array(mu), np.array(azimuth)).path_brf
    np.testing.assert_allclose(found, tau * phase / (4 * mu0 * mu), rtol=1e-5)


slopes_of_all_parts = jax.jit(jax.jacrev(lambda *x: crefl_air(*x, 0.3), (0, 1, 2)))


@pytest.mark.parametrize("point", [(0.0, 0.5, 0.7), (0.2, 1.0, 1.0), (0.2, 1.0, 0.3)])
def test_derivatives_are_finite_in_the_corners(point):
    tau, mu0, mu = (jnp.array(x) for x in point)
    slopes = slopes_of_all_parts(tau, mu0, mu)
    assert all(np.isfinite(x).all() for x in jax.tree.leaves(slopes))


def test_float32_stays():
    angle = np.full(3, 0.5, np.float32)
    assert all(x.dtype == np.float32 for x in crefl_air(0.1, angle, angle, angle))
    traced = jax.eval_shape(lambda x: crefl_air(0.1, x, x, x), jnp.asarray(angle))
    assert all(x.dtype == np.float32 for x in traced)
