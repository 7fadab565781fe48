"""Closed forms of photon path against quadrature over the size distribution."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.bands import BANDS
from abi_operator.microphysics.gamma import inverse_slope, mean_mass
from abi_operator.optics.anomalous_diffraction import corrections, matter, mean_efficiencies
from abi_operator.optics.gamma import (
    equivalent_shape,
    mean_mass_of_path,
    mitchell,
    photon_path,
    sphere_habit,
)
from abi_operator.optics.hydrometeor_classes import HABITS
from abi_operator.optics.ice_tables import CRYSTALS, ICE_INDEX

CLOSED_FORM = 1e-10


def population(habit, nu, slope_inverse):
    """Diameters of a wide trapezoid in their logarithm, and number, mass and area of each."""
    diameter = np.geomspace(1e-13, 100.0, 40000) * slope_inverse
    number = np.exp((nu + 1) * np.log(diameter / slope_inverse) - diameter / slope_inverse)
    number /= number.sum()
    mass = habit.mass.coefficient * diameter**habit.mass.power
    return number, mass, habit.area_coefficient * diameter**habit.area_power


@pytest.mark.parametrize("name", HABITS)
@pytest.mark.parametrize("nu", [0.0, 1.0, 7.0])
def test_moments_against_quadrature(name, nu):
    habit, slope_inverse = HABITS[name], 80e-6
    number, mass, area = population(habit, nu, slope_inverse)
    mean = mean_mass(jnp.asarray(slope_inverse), habit.mass, nu)
    np.testing.assert_allclose(mean, number @ mass, rtol=CLOSED_FORM)
    np.testing.assert_allclose(
        inverse_slope(jnp.log(mean), habit.mass, nu), slope_inverse, rtol=1e-13
    )
    path = jnp.exp(photon_path(jnp.log(mean), habit, nu))
    expected = (number @ mass) / (habit.density * (number @ area))
    np.testing.assert_allclose(path, expected, rtol=CLOSED_FORM)
    back = mean_mass_of_path(jnp.log(path), habit, nu)
    np.testing.assert_allclose(back, jnp.log(mean), rtol=1e-13)


@pytest.mark.parametrize("name", HABITS)
@pytest.mark.parametrize("nu", [0.0, 2.0])
def test_equivalent_shape_has_the_variance_of_photon_path(name, nu):
    habit = HABITS[name]
    number, mass, area = population(habit, nu, 1.0)
    path = mass / (habit.density * area)
    weight = number * area / (number @ area)
    mean = weight @ path
    variance = weight @ (path - mean) ** 2 / mean**2
    # Weighted by area, diameters of spheres have the relative variance 1 / (nu + 3).
    np.testing.assert_allclose(1 / (equivalent_shape(habit, nu) + 3), variance, rtol=1e-8)
    np.testing.assert_allclose(
        equivalent_shape(habit, jnp.asarray(nu)), equivalent_shape(habit, nu), rtol=1e-8, atol=1e-8
    )


def test_spheres_keep_their_shape():
    for nu in (0.0, 1.0, 7.0):
        assert equivalent_shape(sphere_habit(1000.0, 1000.0), nu) == pytest.approx(nu, abs=1e-12)


@pytest.mark.parametrize("name", CRYSTALS)
@pytest.mark.parametrize("band", ["C01", "C07"])
def test_crystals_as_spheres_of_the_same_photon_path(name, band):
    """Two moments of photon path stand for its distribution: what that costs."""
    habit, nu, wavelength_um = CRYSTALS[name], 0.0, BANDS[band].wavelength_um
    index = ICE_INDEX[band]
    for radius_um, error in ((5.0, 0.018), (20.0, 0.005), (80.0, 0.002)):
        log_mass = mean_mass_of_path(jnp.log(4e-6 / 3 * radius_um), habit, nu)
        slope_inverse = float(inverse_slope(log_mass, habit.mass, nu))
        number, mass, area = population(habit, nu, slope_inverse)
        u = 1.5e6 * mass / (habit.density * area) / wavelength_um
        a1, a2, epsilon = corrections(index)
        absorbed = -np.expm1(8 * np.pi * index.imag * u / 3)
        tunnelling = a2 * np.sqrt(u) * np.exp(-epsilon * u)
        t = 2j * np.pi * u * (index - 1)
        seen = np.abs(t) > 1e-2  # smaller particles have no area, and their K is all rounding
        t = np.where(seen, t, 1)
        diffraction = 4 * np.real(0.5 + np.exp(-t) / t + (np.exp(-t) - 1) / t**2) * seen
        edge = 2 * (1 - np.exp(-0.06 * np.pi * u)) * (np.pi * u) ** (-2 / 3)
        weight = number * area / (number @ area)
        q_ext = weight @ ((1 + tunnelling / 2) * diffraction + edge)
        q_abs = weight @ ((1 + a1 * (1 - absorbed) + tunnelling) * absorbed)
        shape = equivalent_shape(habit, nu)
        values = mean_efficiencies(jnp.asarray(radius_um), wavelength_um, matter(index), shape)
        np.testing.assert_allclose(values[0], q_ext, rtol=error)
        np.testing.assert_allclose(values[1], q_abs, rtol=0.003)


def test_power_laws_in_centimetres_become_those_in_metres():
    habit = mitchell(0.00166, 1.91, 0.0459, 1.415, 917.0)
    # A column of 0.3 mm: 0.03 cm.
    np.testing.assert_allclose(
        habit.mass.coefficient * 3e-4**habit.mass.power, 1e-3 * 0.00166 * 0.03**1.91, rtol=1e-13
    )
    np.testing.assert_allclose(
        habit.area_coefficient * 3e-4**habit.area_power, 1e-4 * 0.0459 * 0.03**1.415, rtol=1e-13
    )


def test_derivatives_with_respect_to_shape():
    habit = CRYSTALS["rosettes"]

    @jax.jit
    def values(nu):
        return jnp.stack([photon_path(jnp.asarray(-20.0), habit, nu), equivalent_shape(habit, nu)])

    step = 1e-5
    differences = (values(jnp.asarray(1 + step)) - values(jnp.asarray(1 - step))) / (2 * step)
    for mode in (jax.jacfwd, jax.jacrev):
        np.testing.assert_allclose(jax.jit(mode(values))(jnp.asarray(1.0)), differences, rtol=1e-6)


@pytest.mark.float32
def test_float32_stays():
    path = photon_path(jnp.asarray([-25.0, -10.0], jnp.float32), CRYSTALS["plates"], 0.0)
    assert path.dtype == jnp.float32
    expected = photon_path(jnp.asarray([-25.0, -10.0]), CRYSTALS["plates"], 0.0)
    np.testing.assert_allclose(path, expected, rtol=1e-6)
    assert math.isfinite(float(path[0]))
