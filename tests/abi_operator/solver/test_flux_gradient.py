"""The derivatives of fluxes, written out, against reverse mode and differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from tiles import (
    AGREE,
    DIFFERENCES_AGREE,
    STEP,
    arguments,
    assert_slopes_agree,
    differences,
    direction,
    options,
    tile,
    value_and_slopes_of,
)

from abi_operator.solver import surface_coupling, toa_albedo, toa_brf
from abi_operator.solver.albedo import response_and_slopes
from abi_operator.solver.column import Column
from abi_operator.solver.program import emerging, ground_response, plane_albedo

OPTIONS = {"num_streams": 2, "num_doublings": 2}


@pytest.mark.slow
@pytest.mark.parametrize("num_streams", [2, 4])
def test_response_of_the_ground_equals_reverse_mode(num_streams):
    column = tile(num_streams)
    # Through opaque layers there would be little to compare.
    column = column._replace(tau=0.05 * column.tau, albedo=jnp.zeros(4))
    how = options(num_streams, 2, True)
    found, slopes = jax.jit(lambda x: response_and_slopes(x, how))(column)
    expected, pull_back = jax.vjp(jax.jit(lambda x: ground_response(x, how)), column)
    nothing = jax.tree.map(jnp.zeros_like, expected)
    for row, name in enumerate(("brf_black", "coupling", "spherical_albedo")):
        value = getattr(expected, name)
        np.testing.assert_allclose(getattr(found, name), value, rtol=AGREE)
        (right,) = pull_back(nothing._replace(**{name: jnp.ones_like(value)}))
        assert_slopes_agree(jax.tree.map(lambda x, row=row: x[row], slopes), right)


@pytest.mark.slow
@pytest.mark.parametrize("num_streams", [2, 4])
def test_plane_albedo_equals_reverse_mode(num_streams):
    """By reciprocity it is what isotropic light from above looks like from where the sun stands."""
    given, how = tile(num_streams), options(num_streams, 2, False)
    unseen = given.mu[:0]
    column = Column(*given[:5], mu=unseen, relative_azimuth=unseen)

    def plain(column, how):
        one, zero = jnp.ones_like(column.mu0), jnp.zeros_like(column.mu0)
        seen = column._replace(mu=column.mu0[None], relative_azimuth=zero[None], isotropic_top=one)
        return emerging(seen, how).emitted[0]

    expected, slopes = value_and_slopes_of(plain, how)(column)
    value, ours = value_and_slopes_of(plane_albedo, how)(column)
    np.testing.assert_allclose(value, expected, rtol=AGREE)
    assert_slopes_agree(ours, slopes)


def albedo_of(tau, ssa, moments, albedo, mu0, *_):
    return toa_albedo(tau, ssa, moments, albedo, mu0, **OPTIONS)


def response_of(tau, ssa, moments, _, mu0, mu, azimuth):
    return surface_coupling(tau, ssa, moments, mu0, mu, azimuth, **OPTIONS)


def fluxes(*inputs):
    """Of all that doors give, weighted."""
    response = response_of(*inputs)
    others = response.brf_black, 3 * response.coupling, 7 * response.spherical_albedo
    return jnp.sum(albedo_of(*inputs)) + sum(map(jnp.sum, others))


ALL = tuple(range(7))
# Differences are of the values that come with slopes, by the programs of these.
BOTH = jax.value_and_grad(fluxes, argnums=ALL)


def test_slopes_of_fluxes_agree_with_differences():
    """Along a direction in all inputs."""
    inputs = arguments()[:7]
    tangents = direction(inputs)
    forward = jax.jvp(fluxes, tuple(inputs), tuple(tangents))[1]
    slopes = BOTH(*inputs)[1]
    reverse = sum(np.sum(np.asarray(x) * t) for x, t in zip(slopes, tangents, strict=True))
    np.testing.assert_allclose(forward, reverse, rtol=1e-12)
    (difference,) = differences(lambda *x: [BOTH(*x)[0]], inputs, tangents)
    np.testing.assert_allclose(forward, difference, rtol=DIFFERENCES_AGREE)


def test_derivatives_of_the_closed_form():
    inputs = arguments()[:7]

    def by_coupling(*inputs):
        return jnp.sum(response_of(*inputs).brf(inputs[3]))

    def directly(*inputs):
        return jnp.sum(toa_brf(*inputs, **OPTIONS))

    for found, expected in zip(
        jax.grad(by_coupling, argnums=ALL)(*inputs),
        jax.grad(directly, argnums=ALL)(*inputs),
        strict=True,
    ):
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-13)


def test_derivative_of_the_plane_albedo():
    """Of each column, in the thickness of one layer."""
    tau, *others = arguments()[:7]

    def slope(tau):
        """As part of all slopes, for the program that there is."""
        value, pull_back = jax.vjp(albedo_of, tau, *others)
        return np.asarray(value), np.asarray(pull_back(jnp.ones_like(value))[0])

    step = np.zeros(tau.shape)
    step[:, 0] = STEP
    (ahead, _), (behind, _) = slope(tau + step), slope(tau - step)
    difference = (ahead - behind) / (2 * STEP)
    np.testing.assert_allclose(slope(tau)[1][:, 0], difference, rtol=DIFFERENCES_AGREE)
