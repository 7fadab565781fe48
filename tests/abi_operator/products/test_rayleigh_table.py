"""Pure air by interpolation, against the solver off the grid and by doubling without tables."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.products import AirResponse, rayleigh_air
from abi_operator.products.rayleigh_doubling import air_layer
from abi_operator.solver import surface_coupling

SIXTEEN_STREAMS = 6e-5  # what the solver's quadrature leaves of this error at 32 streams: a tenth
INTERPOLATION = 3e-4  # of the splines, relative, which is reached in thick air near 84 degrees
MODERATE = 3e-6  # the same within 65 degrees
BETA2 = 0.4793


def directions(count, lowest, seed=0):
    rng = np.random.default_rng(seed)
    mu0, mu = rng.uniform(lowest, 1, (2, count))
    return mu0, mu, rng.uniform(-np.pi, np.pi, count)


@pytest.mark.slow
def test_response_is_the_solvers():
    mu0, mu, azimuth = directions(32, 0.4)
    tau = np.geomspace(2e-4, 0.2, 32)
    moments = np.zeros((1, 17))
    moments[0, [0, 2]] = 1, BETA2 / 5
    solved = surface_coupling(tau[:, None], np.ones(1), moments, mu0, mu, azimuth, num_modes=3)
    found = rayleigh_air(tau, mu0, mu, azimuth)
    np.testing.assert_allclose(found.path_brf, solved.brf_black, atol=SIXTEEN_STREAMS)
    np.testing.assert_allclose(found.transmittance, solved.coupling, atol=SIXTEEN_STREAMS)
    np.testing.assert_allclose(
        found.spherical_albedo, solved.spherical_albedo, atol=SIXTEEN_STREAMS
    )


def test_interpolation_between_the_sites():
    """Against doubling at the very angles, to 84 degrees and to the thickest layer."""
    cosines, depths = np.linspace(0.101, 0.999, 23), np.geomspace(1.2e-3, 0.399, 11)
    layer = air_layer(depths, cosines, BETA2)
    tau, mu0, mu = depths[:, None, None], cosines[:, None], cosines
    # In the azimuth of 90 degrees modes 0 and 2 remain.
    sines = (1 - mu0**2) * (1 - mu**2)
    phase = (1 + BETA2 / 4 * (3 * mu0**2 - 1) * (3 * mu**2 - 1), 0.75 * BETA2 * sines)
    expected = phase[0] * layer.modes[0] - phase[1] * layer.modes[2]
    sent = layer.transmission[:, :, None] * layer.transmission[:, None, :]
    found = rayleigh_air(tau, mu0, mu, np.pi / 2)
    np.testing.assert_allclose(found.path_brf, expected, rtol=INTERPOLATION)
    np.testing.assert_allclose(found.transmittance, sent, rtol=INTERPOLATION)
    steep = cosines > 0.4
    error = (found.path_brf - expected)[:, steep][:, :, steep]
    assert np.abs(error).max() < MODERATE


def test_air_keeps_all_light():
    """What is not sent back of a beam gets through: the plane albedo and T sum to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(48)
    mu = (nodes + 1) / 2
    layer = air_layer(np.array([0.05, 0.3]), mu, BETA2)
    phase = 1 + BETA2 / 4 * np.outer(3 * mu**2 - 1, 3 * mu**2 - 1)
    albedo = (weights * mu) @ (phase * layer.modes[0])
    # The quadrature of doubling itself is at its worst for a beam along the horizon.
    np.testing.assert_allclose(albedo + layer.transmission, 1, atol=1e-4)
    np.testing.assert_allclose((albedo + layer.transmission)[:, mu > 0.05], 1, atol=1e-6)
    np.testing.assert_allclose(albedo @ (weights * mu), layer.spherical_albedo, atol=1e-6)
    np.testing.assert_allclose(layer.modes, np.swapaxes(layer.modes, 2, 3), rtol=1e-9)


def test_sun_and_satellite_change_places():
    mu0, mu, azimuth = directions(20, 0.12)
    there, back = rayleigh_air(0.15, mu0, mu, azimuth), rayleigh_air(0.15, mu, mu0, azimuth)
    np.testing.assert_allclose(there.path_brf, back.path_brf, rtol=1e-9)
    np.testing.assert_allclose(there.transmittance, back.transmittance, rtol=1e-12)


def test_off_the_table_is_nan_and_the_ends_are_not():
    mu0 = np.array([0.0999, 1.0001, 0.5, 0.5, np.nan, 0.1, 1.0, 0.5])
    tau = np.array([0.1, 0.1, 0.4001, -1e-6, 0.1, 0.4, 0.4, 0.0])
    found = rayleigh_air(tau, mu0, np.array(0.7), np.array(0.3))
    for part in found:
        np.testing.assert_array_equal(np.isnan(part), [True] * 5 + [False] * 3)
    assert [part[-1] for part in found] == [0, 1, 0]


@jax.jit
def derivative(point, tangents, cotangents):
    """Forward along the tangents, and reverse."""
    forward = jax.jvp(rayleigh_air, point, tangents)[1]
    return forward, jax.vjp(rayleigh_air, *point)[1](cotangents)


def test_derivatives_are_those_of_differences():
    point, step, rng = np.array([0.12, 0.61, 0.43, 0.8]), 1e-5, np.random.default_rng(4)
    cotangents = AirResponse(*rng.normal(size=3))
    for k in range(4):
        tangent = np.eye(4)[k]
        forward, reverse = derivative(tuple(point), tuple(tangent), cotangents)
        ahead, behind = (rayleigh_air(*(point + s * step * tangent)) for s in (1, -1))
        for part in range(3):
            expected = (ahead[part] - behind[part]) / (2 * step)
            np.testing.assert_allclose(forward[part], expected, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(reverse[k], np.dot(cotangents, forward), rtol=1e-10)


@pytest.mark.parametrize(
    "point",
    [(0.0, 0.5, 0.5, 0.3), (0.1, 1.0, 1.0, 0.0), (1e-3, 0.1, 1.0, 0.3), (0.5, 0.5, 0.05, 0.3)],
)
def test_derivatives_are_finite_in_the_corners(point):
    slopes = derivative(tuple(np.array(point)), tuple(np.ones(4)), AirResponse(*np.ones(3)))
    assert all(np.isfinite(x) for x in jax.tree.leaves(slopes))


def test_numpy_jax_and_precisions_agree():
    mu0, mu, azimuth = directions(30, 0.2)
    exact = rayleigh_air(0.18, mu0, mu, azimuth)
    single = rayleigh_air(0.18, *(np.asarray(x, np.float32) for x in (mu0, mu, azimuth)))
    traced = jax.jit(rayleigh_air)(jnp.float32(0.18), *(jnp.float32(x) for x in (mu0, mu, azimuth)))
    for part, ours, jaxs in zip(exact, single, traced, strict=True):
        assert ours.dtype == jaxs.dtype == np.float32 and isinstance(jaxs, jax.Array)
        np.testing.assert_allclose(ours, part, atol=2e-6)
        np.testing.assert_allclose(jaxs, part, atol=2e-6)
