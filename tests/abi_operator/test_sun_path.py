"""A low sun's beam through a sphere: by hand, how it begins, what flat layers cost, its slopes."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator import BANDS, Geometry, State, brf, radiance, smoke, standard_atmosphere
from abi_operator.optics import column_optics
from abi_operator.solver import cos_scattering_angle, slant_path_secant, toa_brf
from abi_operator.sun_path import FLAT_ZENITH, SPHERICAL_ZENITH, sun_secant

NAMES = ("C01", "C03")
FEW = {"num_streams": 2, "gases": ()}
HEIGHT = np.concatenate([np.linspace(60e3, 27e3, 12), np.arange(24e3, -1, -1e3)])  # [m]
VIEW, AZIMUTH = np.radians(40.0), np.radians(70.0)


def columns(degrees, spherical, plumes=None):
    """The US standard atmosphere over a dark ground, under suns at these zenith angles."""
    zenith = jnp.radians(jnp.asarray(degrees))
    count = zenith.size
    air = standard_atmosphere("us_standard", HEIGHT, plumes=plumes or {})
    each = jax.tree.map(lambda x: jnp.broadcast_to(x, (count, *jnp.shape(x))) * 1.0, air)
    angles = zenith, jnp.full(count, VIEW), jnp.full(count, AZIMUTH)
    ground = {name: jnp.full(count, 0.05) for name in NAMES}
    return State(each, ground, Geometry(*angles, spherical=spherical))


@pytest.mark.slow
def test_what_flat_layers_lose_of_clear_air():
    """Figures of the module's docstring."""
    degrees = [50.0, 65.0, 70.0, 75.0, 80.0, 85.0]
    flat, sphere = (brf(columns(degrees, x), NAMES) for x in (False, True))
    lost = 100 * (1 - flat / sphere)
    np.testing.assert_array_equal(flat[:2], sphere[:2])
    np.testing.assert_allclose(lost[2:, 0], [0.26, 0.57, 1.7, 8.4], rtol=0.03)
    np.testing.assert_allclose(lost[2:, 1], [0.04, 0.08, 0.25, 1.4], rtol=0.15)


def test_it_is_the_solver_with_the_secants_of_a_sphere():
    """Under smoke, whose layers count more in the mean secant than air's of the same height."""
    state = columns([75.0], True, {"smoke": smoke(0.5, bands=NAMES)})
    mu0, mu = np.cos(np.radians(75.0)), np.cos(VIEW)

    @jax.jit
    def layers_and_paths(air, mu0):
        optics = column_optics(air, BANDS["C01"], ())
        cosine = cos_scattering_angle(mu0, jnp.asarray(mu), jnp.asarray(AZIMUTH))
        layers = optics.tau[0], optics.ssa[0], optics.moments(3)
        secant = slant_path_secant(jnp.asarray(HEIGHT), mu0, tau=optics.tau[0])
        return layers, {"phase_function": optics.phase_function(cosine), "secant": secant}

    one = jax.tree.map(lambda x: x[0], state)
    (tau, ssa, moments), paths = layers_and_paths(one.atmosphere, jnp.asarray(mu0))
    by_hand = toa_brf(tau, ssa, moments, 0.05, mu0, mu, AZIMUTH, **paths, num_streams=2)
    found = brf(state, NAMES, **FEW)[0, 0]
    np.testing.assert_allclose(found, by_hand, rtol=1e-10)


def test_it_begins_smoothly():
    """No step and no kink where the flat path ends and where the spherical one begins."""
    height, tau = jnp.asarray(HEIGHT), jnp.ones((1, HEIGHT.size - 1))

    def extra(zenith):
        return sun_secant(height, zenith, tau)[0, 0] - 1 / jnp.cos(zenith)

    ends = np.array([FLAT_ZENITH, SPHERICAL_ZENITH])
    both = jax.jit(jax.vmap(jax.value_and_grad(extra)))
    below, above, lowest = np.split(
        np.stack(both(np.r_[ends - 1e-9, ends + 1e-9, np.pi / 2 - 1e-6])), [2, 4], 1
    )
    np.testing.assert_allclose(below[0], above[0], atol=1e-8)
    np.testing.assert_allclose(below[1], above[1], atol=1e-6)
    assert np.isfinite(lowest[1])

    @jax.jit
    def secants(zenith):
        full = slant_path_secant(height, jnp.cos(zenith), tau=tau)
        return sun_secant(height, zenith, tau), full

    np.testing.assert_allclose(*secants(jnp.asarray(1.3)), rtol=1e-14)


def test_it_is_that_of_the_sphere_down_to_the_horizon():
    """In single precision, where 1 / mu0 is 30,000 times the sphere's secant."""
    height = jnp.asarray(HEIGHT, jnp.float32)
    tau = jnp.ones((1, HEIGHT.size - 1), jnp.float32)
    zenith = jnp.asarray(np.radians(89.9999), jnp.float32)

    @jax.jit
    @jax.value_and_grad
    def blended(zenith):
        return sun_secant(height, zenith, tau)[0, 0]

    @jax.jit
    @jax.value_and_grad
    def sphere(zenith):
        return slant_path_secant(height, jnp.cos(zenith), tau=tau)[0, 0]

    found, expected = blended(zenith), sphere(zenith)
    assert expected[1] > 0
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.slow
def test_slopes_are_those_of_differences():
    """By the sun's angle and by a plume's extinction, forwards and backwards."""
    state = columns([68.0], True, {"smoke": smoke(0.5, bands=NAMES)})

    def value(x):
        moved = dataclasses.replace(
            state, geometry=dataclasses.replace(state.geometry, solar_zenith=x[:1])
        )
        plume = state.atmosphere.plumes["smoke"]
        plume = dataclasses.replace(plume, extinction_550=x[1:])
        air = dataclasses.replace(state.atmosphere, plumes={"smoke": plume})
        found = brf(dataclasses.replace(moved, atmosphere=air), NAMES, num_doublings=1, **FEW)[0]
        return found, found

    extinction = state.atmosphere.plumes["smoke"].extinction_550
    x = np.concatenate([state.geometry.solar_zenith, extinction])
    steps = 1e-5 * np.diag(x)
    points = np.stack([x, *(x + steps), *(x - steps)])
    # Values come beside slopes: one program gives both, of all points.
    backward, values = jax.vmap(jax.jacrev(value, has_aux=True))(points)
    forward, _ = jax.vmap(jax.jacfwd(value, has_aux=True))(points)
    np.testing.assert_allclose(forward[0], backward[0], rtol=1e-9)
    for k in (0, 1):
        difference = (values[1 + k] - values[3 + k]) / (2 * steps[k, k])
        np.testing.assert_allclose(backward[0, :, k], difference, rtol=1e-6)


@pytest.mark.slow
def test_in_single_precision_and_where_the_air_shines():
    """Sunlight in C07, of which 85 degrees leave little, and the same by night."""
    state = columns([85.0, 100.0], True)
    state = dataclasses.replace(
        state, albedo={"C07": jnp.full(2, 0.05)}, surface_temperature=jnp.full(2, 290.0)
    )
    flat = dataclasses.replace(state, geometry=dataclasses.replace(state.geometry, spherical=False))
    seen, plain = (
        radiance(jax.tree.map(lambda x: x.astype(jnp.float32), x), ("C07",))[:, 0]
        for x in (state, flat)
    )
    assert seen.dtype == jnp.float32
    assert 1e-4 < seen[0] / plain[0] - 1 < 0.05 and seen[1] == plain[1]
