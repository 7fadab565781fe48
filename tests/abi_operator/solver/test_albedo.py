"""Plane albedo, spherical albedo and the closed form in the ground's albedo.

Their derivatives are in `test_flux_gradient`.
"""

import numpy as np
import pytest
from columns import STANDARD, standard_columns

from abi_operator.solver import half_range, surface_coupling, toa_albedo, toa_brf

CLOSED_FORM = 1e-12  # the same solve, summed in another order


@pytest.mark.parametrize("scattering", ["tms", pytest.param(None, marks=pytest.mark.slow)])
def test_the_closed_form_is_the_solver_for_every_albedo(scattering):
    tau, ssa, moments, albedo, *angles = standard_columns()
    options = STANDARD | {"num_streams": 2, "single_scattering": scattering}
    coupling = surface_coupling(tau, ssa, moments, *angles, **options)
    for a in (np.zeros(4), np.full(4, 0.3), np.ones(4), albedo):
        expected = toa_brf(tau, ssa, moments, a, *angles, **options)
        np.testing.assert_allclose(coupling.brf(a), expected, rtol=CLOSED_FORM)
    np.testing.assert_allclose(coupling.brf(0.3), coupling.brf(np.full(4, 0.3)), rtol=CLOSED_FORM)
    np.testing.assert_allclose(coupling.albedo(expected), albedo, rtol=1e-11)


def test_the_closed_form_for_several_views_and_under_a_slanting_sun():
    tau, ssa, moments, albedo, mu0, mu, azimuth = standard_columns(16)
    views = np.stack([mu, mu0], axis=1), np.stack([azimuth, 0 * azimuth], axis=1)
    secant = 0.9 / mu0[:, None] * np.ones_like(tau)
    options = STANDARD | {"multiple_views": True, "secant": secant}
    coupling = surface_coupling(tau, ssa, moments, mu0, *views, **options)
    expected = toa_brf(tau, ssa, moments, albedo, mu0, *views, **options)
    np.testing.assert_allclose(coupling.brf(albedo), expected, rtol=CLOSED_FORM)
    np.testing.assert_allclose(
        coupling.albedo(expected), np.stack([albedo, albedo], axis=1), rtol=1e-11
    )


def test_plane_albedo_is_the_mean_reflectance():
    r""":math:`2\sum_i w_i\mu_i BRF_0(\mu_i)` over the streams, mode 0, without the correction."""
    tau, ssa, moments, albedo, mu0, *_ = (x[:, None, None] for x in standard_columns(16))
    mu, weight = half_range(4)
    # The mean over so many azimuths is the mode of order 0.
    azimuths = 2 * np.pi * np.arange(4) / 4
    every = toa_brf(
        tau, ssa, moments, albedo, mu0, mu[:, None], azimuths, single_scattering=None, **STANDARD
    )
    plane = toa_albedo(*standard_columns(16)[:5], num_streams=4)
    mean = np.mean(every, axis=-1)
    np.testing.assert_allclose(plane, 2 * np.sum(weight * mu * mean, axis=1), rtol=CLOSED_FORM)


@pytest.mark.parametrize(
    "num_streams", [4, *(pytest.param(n, marks=pytest.mark.slow) for n in (2, 8, 16))]
)
def test_nothing_is_lost_in_white_air_over_white_ground(num_streams):
    """1 to 1e-12 for layers up to 200, to 1e-10 up to 1e5: the co-albedo keeps its place."""
    tau, ssa, moments, _, mu0, *_ = standard_columns(count=50)
    rng = np.random.default_rng(2)
    white = np.ones_like(ssa)
    up_to_200 = 10 ** rng.uniform(-4, np.log10(200), tau.shape)
    up_to_200[:, 3] = 200
    plane = toa_albedo(up_to_200, white, moments, 1.0, mu0, num_streams=num_streams)
    np.testing.assert_allclose(plane, 1, rtol=1e-12)
    if num_streams in (4, 8):
        thicker = up_to_200.copy()
        thicker[:, 4] = 1e5
        plane = toa_albedo(thicker, white, moments, 1.0, mu0, num_streams=num_streams)
        np.testing.assert_allclose(plane, 1, rtol=1e-10)


def test_conservative_air_sends_light_up_or_down():
    """With ssa = 1 the spherical albedo from below and the mean transmission add up to 1."""
    tau, ssa, moments, _, mu0, mu, azimuth = standard_columns(16)
    white = np.ones_like(ssa)
    nodes, weight = half_range(4)
    shape = (16, nodes.size)
    views = np.broadcast_to(nodes, shape)
    options = STANDARD | {"multiple_views": True, "secant": 1 / mu0[:, None] * np.ones_like(tau)}
    coupling = surface_coupling(tau, white, moments, mu0, views, np.zeros(shape), **options)
    plane = toa_albedo(tau, white, moments, np.zeros(16), mu0, num_streams=4)
    # coupling = T(mu0) T(mu); black ground swallows T(mu0) of the sunlight.
    upward = 2 * np.sum(weight * nodes * coupling.coupling, axis=1) / (1 - plane)
    np.testing.assert_allclose(upward, 1 - coupling.spherical_albedo, rtol=1e-11)
