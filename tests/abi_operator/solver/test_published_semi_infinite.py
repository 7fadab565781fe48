"""The solver against the semi-infinite isotropic medium, solved by Chandrasekhar's H-function."""

import numpy as np
import pytest
from published import H_MU, H_OMEGA, H_TAU, plane_albedos, radiances

# What the streams leave, relative: it falls faster than their fourth power and is largest in
# grazing directions (mu = 0.1); albedos are worst where they are smallest (omega = 0.2).
LEFT_BY_STREAMS = {16: 5e-6, 32: 2.5e-7, 64: 4e-9}
LEFT_IN_ALBEDO = {16: 2e-5, 32: 1e-7}
# Extrapolation length of the conservative half-space (Hopf's constant).
HOPF = 0.7104460895
NODES, WEIGHTS = np.polynomial.legendre.leggauss(200)


def h_function(mu, omega):
    """H = exp[-mu/pi int_0^(pi/2) ln(1 - omega theta cot theta) / (cos^2 + mu^2 sin^2) dtheta].

    With tan phi = mu tan theta the denominator becomes 1 / mu dphi.

    References
    ----------
    .. [1] K. Kawabata and S. S. Limaye, "Rational approximation formula for Chandrasekhar's
       H-function for isotropic scattering", Astrophys. Space Sci., 332, 365-371, 2011,
       doi:10.1007/s10509-010-0512-x
    """
    mu, omega = np.asarray(mu)[..., None], np.asarray(omega)[..., None]
    # phi = pi/2 s^6 takes the logarithm's singularity (omega = 1) out of the rule's way.
    s = (NODES + 1) / 2
    phi, weight = np.pi / 2 * s**6, np.pi / 2 * 6 * s**5 * WEIGHTS / 2
    theta = np.arctan2(np.sin(phi), mu * np.cos(phi))
    square = theta**2
    series = square / 3 + square**2 / 45 + 2 * square**3 / 945 + square**4 / 4725
    series += 2 * square**5 / 93555
    bend = np.where(theta < 0.1, series, 1 - theta / np.tan(theta))
    return np.exp(-np.sum(np.log(1 - omega + omega * bend) * weight, axis=-1) / np.pi)


def test_h_function_has_its_known_moment_and_value():
    # H behaves as 1 + mu ln mu at 0, which the cube takes out of the rule's way.
    mu, weight = ((NODES + 1) / 2) ** 3, 3 * ((NODES + 1) / 2) ** 2 * WEIGHTS / 2
    for omega in H_OMEGA:
        exact = 2 * (1 - np.sqrt(1 - omega)) / omega
        np.testing.assert_allclose(weight @ h_function(mu, omega), exact, rtol=1e-12)
    # Chandrasekhar (1960), Radiative Transfer, table XI: H(1) = 2.9078 for omega = 1.
    np.testing.assert_allclose(h_function(1.0, 1.0), 2.9078, atol=5e-5)


def both():
    """H at the suns and at the views, axes omega sun view, and the axes themselves."""
    omega = np.array(H_OMEGA)[:, None, None]
    mu0, mu = np.array(H_MU)[:, None], np.array(H_MU)
    return omega, mu0, mu, h_function(mu0, omega), h_function(mu, omega)


def reflected():
    """Radiance for a sun of irradiance pi / mu0, that is the reflectance factor."""
    omega, mu0, mu, h0, h = both()
    half_space = omega * h * h0 / (4 * (mu + mu0))
    # At omega = 1 a layer of finite tau over black ground lacks exactly this, but for exp(-tau).
    lacking = np.where(omega == 1, h * h0 / (4 * (np.array(H_TAU)[:, None, None] + 2 * HOPF)), 0)
    return half_space - lacking


def errors(num_streams):
    shape = (len(H_OMEGA), len(H_MU), len(H_MU))
    brf = radiances(num_streams)["semi_infinite"].reshape(shape)
    return abs(brf / reflected() - 1)


@pytest.mark.parametrize("num_streams", [16, 32, pytest.param(64, marks=pytest.mark.slow)])
def test_reflectance_is_the_h_functions(num_streams):
    error = errors(num_streams)
    print(f"{num_streams} streams, largest error by omega:", error.max(axis=(1, 2)))
    assert error.max() <= LEFT_BY_STREAMS[num_streams]


def test_error_falls_as_a_power_of_the_streams():
    slope = np.log2(errors(16).max() / errors(32).max())
    assert slope > 4, slope


@pytest.mark.parametrize("num_streams", [16, pytest.param(32, marks=pytest.mark.slow)])
def test_plane_albedo_is_that_of_the_half_space(num_streams):
    """1 - sqrt(1 - omega) H(mu0); at omega = 1 what a finite layer lets through is missing."""
    omega, mu0 = np.array(H_OMEGA)[:, None], np.array(H_MU)
    h0 = h_function(mu0, omega)
    through = np.where(omega == 1, h0 / np.sqrt(3) / (np.array(H_TAU)[:, None] + 2 * HOPF), 0)
    expected = 1 - np.sqrt(1 - omega) * h0 - through
    albedo = plane_albedos(num_streams)["semi_infinite"].reshape(expected.shape)
    print(abs(albedo / expected - 1).max(axis=1))
    np.testing.assert_allclose(albedo, expected, rtol=LEFT_IN_ALBEDO[num_streams])


@pytest.mark.parametrize("num_streams", [16, 32])
def test_emission_of_a_half_space_with_linear_planck_function(num_streams):
    """B = 1 + 0.3 tau gives sqrt(1 - omega) H (1 + 0.3 mu) + 0.15 omega alpha_1 H, exactly.

    alpha_1 is the first moment of H (Chandrasekhar 1960, section 84, by reciprocity: light of
    B falls from everywhere on a cold half-space what a warm one does not send out).
    """
    omega = np.array(H_OMEGA[:-1])[:, None]
    points, weights = ((NODES + 1) / 2) ** 3, 3 * ((NODES + 1) / 2) ** 2 * WEIGHTS / 2
    alpha = (weights * points * h_function(points, omega[..., None])[:, 0]).sum(-1, keepdims=True)
    h = h_function(np.array(H_MU), omega)
    expected = h * (np.sqrt(1 - omega) * (1 + 0.3 * np.array(H_MU)) + 0.15 * omega * alpha)
    emitted = radiances(num_streams)["emitting"].reshape(expected.shape)
    print(abs(emitted / expected - 1).max(axis=1))
    np.testing.assert_allclose(emitted, expected, rtol=LEFT_BY_STREAMS[num_streams])
