"""Liquid cloud from mass and number."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.atmosphere import LiquidCloud
from abi_operator.bands import BANDS, Band, several_bands
from abi_operator.constants import WATER_DENSITY
from abi_operator.optics import effective_radius, liquid_cloud

# Droplets of the size of the wavelength are the hardest for anomalous diffraction.
EXTINCTION = {"C07": 0.08}


def with_cloud(atmosphere, mass, number):
    dtype = atmosphere.pressure.dtype
    liquid = LiquidCloud(jnp.asarray(mass, dtype), jnp.asarray(number, dtype))
    return dataclasses.replace(atmosphere, liquid=liquid)


def by_mitchell(atmosphere):
    return dataclasses.replace(
        atmosphere, liquid=dataclasses.replace(atmosphere.liquid, optics="mitchell")
    )


def compared(atmosphere, droplet_mie):
    """Band; depth, co-albedo and asymmetry of a cloudy layer; the same by sums over spheres."""
    layer = 7

    @jax.jit
    @jax.vmap
    def in_every_band(band):
        optics = liquid_cloud(atmosphere, band)
        return optics.tau[0, layer], 1 - optics.ssa[0, layer], optics.moments(2)[layer, 1]

    mass = np.asarray(atmosphere.liquid.mass_path)[layer]
    radius = np.asarray(effective_radius(atmosphere.liquid))[layer]
    rows = zip(*in_every_band(several_bands(tuple(BANDS), float)), strict=True)
    for band, optics in zip(BANDS, rows, strict=True):
        q_ext, q_abs, asymmetry = droplet_mie(band, 1e6 * float(radius))
        depth = 3 * mass * q_ext / (4 * WATER_DENSITY * radius)
        yield band, optics, (depth, q_abs / q_ext, asymmetry)


def test_optics_are_those_of_mie_theory(make_atmosphere, droplet_mie):
    """The default, in every band."""
    for _, ours, theirs in compared(make_atmosphere(), droplet_mie):
        # Errors are those of the few spheres of the fixture.
        np.testing.assert_allclose(ours[0], theirs[0], rtol=1e-3)
        np.testing.assert_allclose(ours[1], theirs[1], rtol=0.02, atol=1e-6)
        np.testing.assert_allclose(ours[2], theirs[2], rtol=0, atol=5e-4)


def test_unknown_optics_are_named():
    with pytest.raises(ValueError, match="optics of LiquidCloud must be one of .* got 'fu'"):
        LiquidCloud(jnp.zeros(2), jnp.zeros(2), optics="fu")


def test_the_default_has_rainbow_and_glory(make_atmosphere):
    """The phase function of C02 rises to 141 and to 180 degrees, which Greenstein's does not."""
    angles = jnp.cos(jnp.radians(jnp.array([120.0, 141.0, 155.0, 180.0])))

    @jax.jit
    def phase(atmosphere):
        optics = liquid_cloud(atmosphere, BANDS["C02"])
        return jax.vmap(optics.phase_function)(angles)[:, 7]

    bow = phase(make_atmosphere())
    assert bow[1] > 2 * bow[0] and bow[1] > 2 * bow[2] and bow[3] > 2 * bow[2]
    assert np.all(np.diff(phase(by_mitchell(make_atmosphere()))) < 0)


def test_optics_go_on_without_a_kink_where_the_table_ends(make_atmosphere):
    """Optical depth against effective radius, at constant mass: value and slope are continuous."""
    ends, step = 1e-6 * np.array([1.6, 64.0]), np.array([-1e-5, 1e-5, -0.2, 0.2])

    def depth(log_step, table):
        radius = table * jnp.exp(log_step)
        number = 0.1 / (4 / 3 * jnp.pi * WATER_DENSITY * radius**3 * 0.72)
        cloud = with_cloud(make_atmosphere(), jnp.full(10, 0.1), jnp.broadcast_to(number, 10))
        return jnp.log(liquid_cloud(cloud, BANDS["C06"]).tau[0, 0])

    of_steps = jax.vmap(jax.value_and_grad(depth), in_axes=(0, None))
    found = jax.jit(jax.vmap(of_steps, in_axes=(None, 0)))(jnp.asarray(step), jnp.asarray(ends))
    # Beyond, the efficiency is that of the end and the depth falls as 1 / radius.
    for value, slope, beyond in zip(*map(np.asarray, found), (2, 3), strict=True):
        assert value[0] - value[1] == pytest.approx(2e-5, rel=1e-3)
        assert slope[0] == pytest.approx(slope[1], abs=1e-3)
        assert slope[beyond] == pytest.approx(-1, abs=1e-12)


def test_optical_depth_by_mitchell_against_mie(make_atmosphere, droplet_mie):
    for band, ours, theirs in compared(by_mitchell(make_atmosphere()), droplet_mie):
        # Errors of modified anomalous diffraction at the 9.4 um of this layer; see its own tests.
        np.testing.assert_allclose(ours[0], theirs[0], rtol=EXTINCTION.get(band, 0.05))
        np.testing.assert_allclose(ours[1], theirs[1], rtol=0.16)
        np.testing.assert_allclose(ours[2], theirs[2], rtol=0, atol=1e-3)


def test_clear_layers_are_empty(make_atmosphere):
    @jax.jit
    def layers(atmosphere):
        optics = liquid_cloud(atmosphere, BANDS["C02"])
        return optics.tau[0], optics.ssa[0], optics.moments(3)

    tau, ssa, moments = map(np.asarray, layers(make_atmosphere()))
    clear = [0, 1, 2, 3, 4, 5, 9]
    assert np.all(tau[6:9] > 1)
    np.testing.assert_array_equal(tau[clear], 0)
    np.testing.assert_array_equal(ssa[clear], 0)
    np.testing.assert_array_equal(moments[clear], [[1, 0, 0]] * 7)


def test_mass_without_number_is_empty(make_atmosphere):
    number = np.resize([0.0, -0.0, -1.0, -1e9], 10)
    atmosphere = with_cloud(make_atmosphere(), np.full(10, 0.1), number)
    np.testing.assert_array_equal(liquid_cloud(atmosphere, BANDS["C01"]).tau, 0)


def test_depth_is_linear_in_traces_of_mass(make_atmosphere):
    mass, number = 1e-18 * np.arange(1, 11), np.full(10, 1e10)
    tau = liquid_cloud(with_cloud(make_atmosphere(), mass, number), BANDS["C01"]).tau[0]
    # Sizes of 3e-5 of the smallest believed have bent to its end but for their square.
    np.testing.assert_allclose(tau, float(tau[0]) * np.arange(1, 11), rtol=1e-8)


@pytest.mark.float32
@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize("band", ["C06"])  # bands differ in constants alone
@pytest.mark.parametrize("kind", ["mitchell", "mie"])
def test_derivatives_are_finite_at_any_mass_and_number(make_atmosphere, mode, band, kind):
    values = [0.0, 1e-30, 1e-18, 1e-3, 1.0, 1e10]
    mass, number = (grid.ravel() for grid in np.meshgrid(values, values))
    atmosphere = make_atmosphere(num_layers=mass.size, dtype=jnp.float32)

    def outputs(liquid):
        optics = liquid_cloud(dataclasses.replace(atmosphere, liquid=liquid), BANDS[band])
        phase = optics.scatterers[0].phase
        shape = phase.moments(2)[:, 1], phase(jnp.asarray(-1.0, jnp.float32))
        # Layers are independent of each other, so the sum keeps every derivative apart.
        return jnp.stack([x.sum() for x in (optics.tau, optics.scattering, *shape)])

    liquid = with_cloud(atmosphere, mass, number).liquid
    liquid = LiquidCloud(liquid.mass_path, liquid.number_path, optics=kind)
    jacobian = jax.jit(mode(outputs))(liquid)
    assert np.all(np.isfinite(outputs(liquid)))
    assert np.all(np.isfinite(jacobian.mass_path))
    assert np.all(np.isfinite(jacobian.number_path))
    empty = (mass == 0) | (number == 0)
    np.testing.assert_array_equal(jacobian.mass_path[:, empty], 0)
    np.testing.assert_array_equal(jacobian.number_path[:, empty], 0)


def test_unknown_band_is_named(make_atmosphere):
    with pytest.raises(ValueError, match="no water index for band 'C13'"):
        liquid_cloud(make_atmosphere(), Band("C13", 10.34))
