"""The waist: what adds, what is derived, and empty layers."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

from abi_operator.optical_properties import OpticalProperties, PhaseFunction, Scatterer

ROUNDING = 1e-14


class Linear(PhaseFunction):
    """P = 1 + 3 chi_1 cos: one moment beyond the mean."""

    chi_1: Float[Array, " #layer"]

    def moments(self, num_moments):
        rest = jnp.zeros((self.chi_1.shape[0], max(num_moments - 2, 0)), self.chi_1.dtype)
        columns = [jnp.ones_like(self.chi_1)[:, None], self.chi_1[:, None], rest]
        return jnp.concatenate(columns, axis=1)[:, :num_moments]

    def __call__(self, cos_scattering):
        return 1 + 3 * self.chi_1 * cos_scattering


def optics(extinction, scattering, chi_1, weight=(1.0,)):
    scatterer = Scatterer(jnp.array(scattering), Linear(jnp.array(chi_1)))
    return OpticalProperties(jnp.array(extinction), jnp.array(weight), (scatterer,))


AIR = optics([[0.1, 0.2, 0.0]], [0.1, 0.2, 0.0], [0.0])
SMOKE = optics([[0.0, 0.5, 0.0]], [0.0, 0.4, 0.0], [0.3, 0.3, 0.3])
GAS = OpticalProperties(jnp.array([[0.0, 0.1, 0.2], [0.3, 1.0, 2.0]]), jnp.array([0.75, 0.25]), ())


def test_addition_mixes():
    mixed = AIR + SMOKE
    np.testing.assert_allclose(mixed.tau, [[0.1, 0.7, 0]], rtol=ROUNDING)
    np.testing.assert_allclose(mixed.scattering, [0.1, 0.6, 0], rtol=ROUNDING)
    np.testing.assert_allclose(mixed.ssa, [[1, 0.6 / 0.7, 0]], rtol=ROUNDING)
    # Weighted by scattering: (0.2 * 0 + 0.4 * 0.3) / 0.6 = 0.2.
    np.testing.assert_allclose(mixed.moments(3), [[1, 0, 0], [1, 0.2, 0], [1, 0, 0]], rtol=ROUNDING)
    value = mixed.phase_function(jnp.asarray(0.5))
    np.testing.assert_allclose(value, [1, 1 + 3 * 0.2 * 0.5, 0], rtol=ROUNDING)


def test_addition_commutes_and_associates():
    one, other = (AIR + SMOKE) + GAS, GAS + (SMOKE + AIR)
    for name in ("tau", "ssa", "scattering", "weight"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=ROUNDING)
    np.testing.assert_allclose(one.moments(4), other.moments(4), rtol=ROUNDING)


def test_grey_matter_joins_every_term_of_a_gas():
    for mixed in (GAS + SMOKE, SMOKE + GAS):
        np.testing.assert_array_equal(mixed.weight, GAS.weight)
        np.testing.assert_allclose(mixed.tau, GAS.tau + SMOKE.tau, rtol=ROUNDING)
        np.testing.assert_allclose(mixed.ssa[:, 1], [0.4 / 0.6, 0.4 / 1.5], rtol=ROUNDING)
        assert mixed.moments(3).shape == (3, 3)


def test_two_sums_of_terms_do_not_add():
    with pytest.raises(ValueError, match="several exponential terms; got 2 and 2"):
        _ = GAS + GAS


@pytest.mark.parametrize("num_moments", [1, 2, 5])
def test_matter_that_only_absorbs(num_moments):
    np.testing.assert_array_equal(GAS.ssa, 0)
    np.testing.assert_array_equal(GAS.moments(num_moments), np.eye(1, num_moments).repeat(3, 0))
    np.testing.assert_array_equal(GAS.phase_function(jnp.asarray(0.5)), 0)


@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
def test_derivatives_are_finite_in_empty_layers(mode):
    def derived(air, plume):
        mixed = air + plume
        value = mixed.phase_function(jnp.asarray(0.2))
        return jnp.concatenate([mixed.ssa[0], mixed.moments(3).ravel(), value])

    jacobian = jax.jit(mode(derived, argnums=(0, 1)))(AIR, SMOKE)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(jacobian))
    assert np.any(jax.tree.leaves(jacobian)[0])


def test_shares_of_hardly_anything_have_slopes_of_their_size():
    """Of a number of particles of 1e-36 the scattering rises by 1e18 a particle, in float32."""
    scattering, rise = (jnp.asarray([x], jnp.float32) for x in (1e-18, 1e18))

    def mixed(amount):
        scatterers = tuple(
            Scatterer(x, Linear(jnp.asarray([chi], jnp.float32)))
            for x, chi in ((amount, 0.3), (jnp.asarray([1e-18], jnp.float32), 0.1))
        )
        return OpticalProperties(amount[None], jnp.ones(1, jnp.float32), scatterers).moments(2)

    found, slope = jax.jvp(mixed, (scattering,), (rise,))
    np.testing.assert_allclose(found, [[1, 0.2]], rtol=1e-6)
    np.testing.assert_allclose(slope[:, 1], [1e36 * 0.05], rtol=1e-5)
