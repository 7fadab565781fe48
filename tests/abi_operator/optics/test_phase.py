"""Phase functions against their own moments."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.optics import HenyeyGreenstein, RayleighPhase

NUM_MOMENTS = 40
QUADRATURE = 5e-12  # rounding of the 400 Gauss points, amplified by the peak of g = 0.85
NODES, WEIGHTS = np.polynomial.legendre.leggauss(400)

PHASES = [
    *(HenyeyGreenstein(jnp.asarray(g, float)) for g in (0.0, 0.85, -0.4)),
    HenyeyGreenstein(jnp.array([0.0, 0.3, 0.8])),
    RayleighPhase(jnp.asarray(0.479, float)),
    RayleighPhase(jnp.array([0.5, 0.0])),
]


@pytest.mark.parametrize("phase", PHASES)
def test_moments_are_integrals_of_the_phase_function(phase):
    value = jax.jit(jax.vmap(phase))(jnp.asarray(NODES))
    polynomials = np.polynomial.legendre.legvander(NODES, NUM_MOMENTS - 1)
    integrals = np.einsum("n,nk,nl->kl", WEIGHTS / 2, value, polynomials)
    np.testing.assert_allclose(phase.moments(NUM_MOMENTS), integrals, rtol=0, atol=QUADRATURE)
    np.testing.assert_allclose(integrals[:, 0], 1, rtol=QUADRATURE)


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("num_moments", [1, 2, 8])
def test_any_number_of_moments(phase, num_moments):
    moments = phase.moments(num_moments)
    np.testing.assert_array_equal(moments, phase.moments(NUM_MOMENTS)[:, :num_moments])


def test_henyey_greenstein_is_isotropic_at_zero_and_forward_at_positive_asymmetry():
    isotropic, forward = HenyeyGreenstein(jnp.asarray(0.0)), HenyeyGreenstein(jnp.asarray(0.5))
    assert isotropic(jnp.asarray(0.3)) == 1
    # (1 - g^2) / (1 - g)^3 = 6 straight ahead, (1 - g^2) / (1 + g)^3 = 2/9 straight back.
    np.testing.assert_allclose(forward(jnp.asarray(1.0)), 6)
    np.testing.assert_allclose(forward(jnp.asarray(-1.0)), 2 / 9)


@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
def test_derivative_of_moments_is_exact_at_zero_asymmetry(mode):
    derivative = jax.jit(mode(lambda g: HenyeyGreenstein(g).moments(5)[0]))(jnp.asarray(0.0))
    np.testing.assert_array_equal(derivative, [0, 1, 0, 0, 0])


@pytest.mark.float32
@pytest.mark.parametrize("cos_scattering", [-1.0, 0.2, 1.0])
@pytest.mark.parametrize("g", [0.9, -0.9])
def test_float32_keeps_its_digits_in_a_peak(g, cos_scattering):
    exact = (1 - g**2) / (1 + g**2 - 2 * g * cos_scattering) ** 1.5
    value = HenyeyGreenstein(jnp.float32(g))(jnp.float32(cos_scattering))
    assert value.dtype == jnp.float32
    # Rounding of g itself is amplified by 3 g / (1 - g) = 27 straight into the peak.
    np.testing.assert_allclose(value, exact, rtol=3e-6)


@pytest.mark.float32
def test_the_sharpest_peak_has_its_height_and_finite_slopes():
    """Straight into it, (1 + g) / (1 - g)^2, and 2 / (1 - g)^2 of the last g below 1."""
    to_either_side = jnp.asarray([1.0, -1.0], jnp.float32)
    for distance in (1e-2, 1e-4, float(np.finfo(np.float32).epsneg)):
        g = np.float32(1 - distance)
        height, slopes = jax.vmap(
            jax.value_and_grad(lambda g, c: HenyeyGreenstein(g)(c)[0], argnums=(0, 1))
        )(to_either_side * g, to_either_side)
        exact = (1 + float(g)) / (1 - float(g)) ** 2
        np.testing.assert_allclose(height, [exact, exact], rtol=1e-6)
        slope = (3 + float(g)) / (1 - float(g)) ** 3
        np.testing.assert_allclose(slopes[0], [slope, -slope], rtol=1e-6)
        assert np.isfinite(slopes[1]).all()
