"""The closed form against quadrature of the formulas it integrates, and against Mie theory."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.bands import BANDS
from abi_operator.optics.anomalous_diffraction import corrections, matter, mean_efficiencies
from abi_operator.optics.droplets import NU
from abi_operator.optics.water import REFRACTIVE_INDEX

CLOSED_FORM = 1e-10
FLOAT32 = 2e-6
RADII = np.array([1.0, 2.5, 4.0, 6.0, 10.0, 20.0, 30.0, 40.0, 100.0])


def efficiencies_of_band(band, nu=NU):
    """Extinction and absorption of droplets of all `RADII`. [-]"""
    index = matter(REFRACTIVE_INDEX[band])
    values = mean_efficiencies(jnp.asarray(RADII), BANDS[band].wavelength_um, index, nu)
    return [np.asarray(x) for x in values]


def sphere_efficiencies(diameter_um, wavelength_um, index):
    """Extinction and absorption efficiency of single spheres, as Mitchell writes them. [-]"""
    k = -index.imag
    size = diameter_um / wavelength_um
    a1, a2, epsilon = corrections(index)
    absorbed = -np.expm1(-8 * np.pi * k * size / 3)
    tunnelling = a2 * np.sqrt(size) * np.exp(-epsilon * size)
    t = 2j * np.pi * size * (index - 1)
    diffraction = 4 * np.real(0.5 + np.exp(-t) / t + (np.exp(-t) - 1) / t**2)
    edge = 2 * (1 - np.exp(-0.06 * np.pi * size)) * (np.pi * size) ** (-2 / 3)
    q_abs = (1 + a1 * (1 - absorbed) + tunnelling) * absorbed
    return (1 + tunnelling / 2) * diffraction + edge, q_abs


def quadrature(effective_radius_um, wavelength_um, index, nu):
    """Means over a gamma distribution, by the trapezoidal rule in the logarithm of diameter."""
    slope = (nu + 3) / (2 * effective_radius_um)
    diameter = np.geomspace(3e-4, 80.0, 40000) / slope
    area = np.exp((nu + 3) * np.log(slope * diameter) - slope * diameter)
    q_ext, q_abs = sphere_efficiencies(diameter, wavelength_um, index)
    return area @ q_ext / area.sum(), area @ q_abs / area.sum()


@pytest.mark.parametrize(
    ("band", "nu"), [*((band, NU) for band in BANDS), ("C01", 11.5), ("C06", 2.0), ("C07", 11.5)]
)
def test_closed_form_against_quadrature(band, nu):
    wavelength, index = BANDS[band].wavelength_um, REFRACTIVE_INDEX[band]
    expected = np.array([quadrature(radius, wavelength, index, nu) for radius in RADII]).T
    np.testing.assert_allclose(efficiencies_of_band(band, nu), expected, rtol=CLOSED_FORM)


def test_closed_form_of_a_strong_absorber():
    index = 1.35 - 0.1j
    values = mean_efficiencies(jnp.asarray(RADII), 3.0, matter(index), NU)
    expected = np.array([quadrature(radius, 3.0, index, NU) for radius in RADII]).T
    np.testing.assert_allclose(values, expected, rtol=CLOSED_FORM)


# Errors of the approximation itself (extinction oscillates with size in the near infrared) and, in
# C03, of the sums over droplets: the approximation alone stays within 0.7 % there, and within 10 %
# in absorption.
EXTINCTION_ERROR = {
    "C01": {4.0: 0.05, 10.0: 0.007, 20.0: 0.007},
    "green": {4.0: 0.05, 10.0: 0.007, 20.0: 0.007},
    "C02": {4.0: 0.05, 10.0: 0.007, 20.0: 0.007},
    "C03": {4.0: 0.05, 10.0: 0.0075, 20.0: 0.007},
    "C04": {4.0: 0.07, 6.0: 0.07, 10.0: 0.044, 20.0: 0.044},
    "C05": {4.0: 0.07, 6.0: 0.07, 10.0: 0.044, 20.0: 0.044},
    "C06": {4.0: 0.07, 6.0: 0.07, 10.0: 0.045, 20.0: 0.045},
    "C07": {4.0: 0.08, 6.0: 0.08, 10.0: 0.08, 20.0: 0.08},
}
# Absorption matters in these bands alone: elsewhere it is less than 1e-5 of extinction.
ABSORPTION_ERROR = {"C03": 0.11, "C04": 0.10, "C05": 0.10, "C06": 0.10, "C07": 0.10}


@pytest.mark.parametrize("band", BANDS)
def test_extinction_against_mie(droplet_mie, band):
    q_ext, _ = efficiencies_of_band(band)
    for radius, error in EXTINCTION_ERROR[band].items():
        value = q_ext[list(RADII).index(radius)]
        np.testing.assert_allclose(value, droplet_mie(band, radius)[0], rtol=error)


@pytest.mark.parametrize("band", ABSORPTION_ERROR)
def test_absorption_against_mie(droplet_mie, band):
    _, q_abs = efficiencies_of_band(band)
    for radius in (4.0, 6.0, 10.0, 20.0, 30.0):
        value, expected = q_abs[list(RADII).index(radius)], droplet_mie(band, radius)[1]
        np.testing.assert_allclose(value, expected, rtol=ABSORPTION_ERROR[band])


@pytest.mark.float32
@pytest.mark.parametrize("band", BANDS)
def test_float32_keeps_weak_absorption(band):
    wavelength, index = BANDS[band].wavelength_um, REFRACTIVE_INDEX[band]
    values = mean_efficiencies(jnp.asarray(RADII, jnp.float32), wavelength, matter(index), NU)
    assert all(value.dtype == jnp.float32 for value in values)
    expected = np.array([quadrature(radius, wavelength, index, NU) for radius in RADII]).T
    np.testing.assert_allclose(values, expected, rtol=FLOAT32)


@pytest.mark.parametrize("band", ["C06"])
def test_derivative_against_differences(band):
    def efficiencies(radius):
        wavelength, index = BANDS[band].wavelength_um, REFRACTIVE_INDEX[band]
        return jnp.stack(mean_efficiencies(radius, wavelength, matter(index), NU))

    forward = jax.jit(lambda radius: jax.jvp(efficiencies, (radius,), (jnp.ones_like(radius),)))
    radius, step = jnp.asarray(7.0), 1e-4
    differences = (forward(radius + step)[0] - forward(radius - step)[0]) / (2 * step)
    for derivative in (forward(radius)[1], jax.jit(jax.jacrev(efficiencies))(radius)):
        np.testing.assert_allclose(derivative, differences, rtol=1e-6)


def test_shape_can_be_traced():
    """An array of shapes gives what numbers give, with the derivative of differences."""
    wavelength, index = BANDS["C06"].wavelength_um, REFRACTIVE_INDEX["C06"]

    def efficiencies(nu):
        return jnp.stack(mean_efficiencies(jnp.asarray(9.0), wavelength, matter(index), nu))

    # The value comes with the derivative: one compilation.
    forward = jax.jit(lambda nu: jax.jvp(efficiencies, (nu,), (jnp.ones_like(nu),)))
    nu, step = jnp.asarray(4.5), 1e-4
    expected = mean_efficiencies(jnp.asarray(9.0), wavelength, matter(index), 4.5)
    np.testing.assert_allclose(forward(nu)[0], expected, rtol=1e-12)
    differences = (forward(nu + step)[0] - forward(nu - step)[0]) / (2 * step)
    np.testing.assert_allclose(forward(nu)[1], differences, rtol=1e-5)


def test_coefficients_of_crystals_take_the_place_of_those_of_spheres():
    wavelength, index, radius = BANDS["C04"].wavelength_um, 1.3 - 1e-5j, jnp.asarray(30.0)
    q_ext, q_abs = mean_efficiencies(
        radius, wavelength, matter(index), 0.0, internal_reflection=1.0, tunnelling_factor=0.0
    )
    # Without tunnelling, absorption that is weak is doubled by a1 = 1: Q_abs = 2 (8 pi k / 3) D,
    # where D by area is the effective diameter. What is missing is the square of Q_abs.
    weak = 2 * 8 * np.pi * 1e-5 / 3 * 60 / wavelength
    np.testing.assert_allclose(q_abs, weak, rtol=weak)
    # Large particles take twice their area from the beam; the edge adds a little.
    assert 2 < q_ext < 2.1
