"""Every class of hydrometeor from mass and number."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.atmosphere import Hydrometeor, LiquidCloud
from abi_operator.bands import BANDS, Band, several_bands
from abi_operator.microphysics import SCHEMES
from abi_operator.optics import (
    CLASSES,
    HABITS,
    from_effective_radius,
    hydrometeor,
    liquid_cloud,
    outside_fitted_range,
    particle_radius,
)
from abi_operator.optics.ice import ice_asymmetry, ice_coalbedo, ice_mass_extinction
from abi_operator.optics.ice_tables import FU
from abi_operator.optics.rain import rain_asymmetry

# Generalized effective size over effective radius: (2 / sqrt 3) / (3 / 4). [-]
SIZE = 8 / 3**1.5


def column(make_atmosphere, name, mass, number, dtype=float):
    mass, number = (np.atleast_1d(np.asarray(x, float)) for x in (mass, number))
    atmosphere = make_atmosphere(num_layers=max(4, mass.size), dtype=dtype)
    pad = max(4, mass.size) - mass.size
    particles = Hydrometeor(*(jnp.asarray(np.pad(x, (0, pad)), dtype) for x in (mass, number)))
    return dataclasses.replace(atmosphere, hydrometeors={name: particles})


def of_radius(make_atmosphere, name, mass, radius_um, classes=CLASSES):
    particles = from_effective_radius(
        jnp.asarray(mass, float), jnp.asarray(radius_um) * 1e-6, name, classes
    )
    return column(make_atmosphere, name, particles.mass_path, particles.number_path)


def test_every_class_of_every_scheme_has_optics():
    assert {name for classes in SCHEMES.values() for name in classes} == set(CLASSES)


@pytest.mark.parametrize("band", ["C07"])
def test_cloud_among_hydrometeors_is_the_liquid_cloud(make_atmosphere, band):
    mass, number = [0.02, 0.05, 0.01, 0.1], [1.5e10, 2e10, 3e10, 1e10]
    atmosphere = column(make_atmosphere, "cloud", mass, number)
    liquid = LiquidCloud(jnp.asarray(mass), jnp.asarray(number), "mitchell")

    @jax.jit
    def both():
        expected = liquid_cloud(dataclasses.replace(atmosphere, liquid=liquid), BANDS[band])
        optics = hydrometeor(atmosphere, "cloud", BANDS[band])
        return [(x.tau, x.ssa, x.moments(3)) for x in (optics, expected)]

    for found, expected in zip(*both(), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_rain_by_hand(make_atmosphere):
    """Exponential drops of 1000 m-3 and 1 g m-3: Lam = (pi 1000 1000 / 1e-3)^(1/3) = 1464.6 m-1."""
    depth = 1000.0

    @jax.jit
    def first_layer(atmosphere):
        optics = hydrometeor(atmosphere, "rain", BANDS["C01"])
        return optics.tau[0, 0], optics.ssa[0, 0], optics.moments(2)[0, 1]

    rain = column(make_atmosphere, "rain", 1e-3 * depth, 1e3 * depth)
    tau, ssa, asymmetry = first_layer(rain)
    radius = 1.5 / 1464.59
    # A = 3 m / (4 rho r), and large drops take twice that from the beam; the edge adds 0.4 %.
    np.testing.assert_allclose(tau, 2 * 3 * 1e-3 * depth / (4 * 1000 * radius), rtol=0.005)
    assert ssa > 0.999
    expected = rain_asymmetry(jnp.asarray(1e6 * radius), "C01")
    np.testing.assert_allclose(asymmetry, expected, rtol=1e-6)


def test_ice_against_fu(make_atmosphere):
    """Columns of 60 um by Mitchell's scheme and by Fu's.

    Extinction differs by diffraction theory's few per cent. Absorption differs by what the two
    take from within a crystal and by the absorption coefficient of ice, that of Warren (1984) over
    a wide interval in Fu: by up to 40 % in C05 and C06.
    """
    atmosphere = of_radius(make_atmosphere, "ice", [0.01], [60 / SIZE])
    size, bands = jnp.asarray(60.0), ("C01", "C03", "C04", "C05", "C06")
    by_fu = CLASSES | {"ice": CLASSES["ice"]._replace(efficiencies="fu1996")}

    @jax.jit
    @jax.vmap
    def in_every_band(band):
        both = [hydrometeor(atmosphere, "ice", band, classes) for classes in (CLASSES, by_fu)]
        return [(x.tau[0, 0], 1 - x.ssa[0, 0], x.moments(2)[0, 1]) for x in both]

    mitchell, fu = in_every_band(several_bands(bands, float))
    depth = [0.01 * ice_mass_extinction(size, FU[band]) for band in bands]
    coalbedo = np.array([ice_coalbedo(size, FU[band]) for band in bands])
    asymmetry = [ice_asymmetry(size, FU[band]) for band in bands]
    np.testing.assert_allclose(mitchell[0], depth, rtol=0.055)
    # More is diffracted of what absorbs more: 0.0046 in C05, where Fu's interval does.
    np.testing.assert_allclose(mitchell[2], asymmetry, rtol=0, atol=5e-3)
    np.testing.assert_allclose(mitchell[2][:3], asymmetry[:3], rtol=0, atol=1e-4)
    np.testing.assert_allclose(fu[2], asymmetry, rtol=1e-9)
    ratio = (np.asarray(mitchell[1]) / coalbedo)[1:]
    assert np.all(ratio > 0.6) and np.all(ratio < 1.3)
    np.testing.assert_allclose(fu[0], depth, rtol=1e-9)
    np.testing.assert_allclose(fu[1], coalbedo, rtol=1e-6)


def test_settings_of_a_class_are_used(make_atmosphere):
    atmosphere = of_radius(make_atmosphere, "snow", [0.05], [80.0])

    def optics(**settings):
        classes = CLASSES | {"snow": CLASSES["snow"]._replace(**settings)}
        return hydrometeor(atmosphere, "snow", BANDS["C05"], classes)

    visible = {"asymmetry": "roughened"}
    rough = hydrometeor(
        atmosphere, "snow", BANDS["C01"], CLASSES | {"snow": CLASSES["snow"]._replace(**visible)}
    )
    # Less lambda / (pi^2 r) of the half that is diffracted.
    lobe = BANDS["C01"].wavelength_um / (math.pi**2 * 80.0)
    np.testing.assert_allclose(rough.moments(2)[0, 1], 0.75 - lobe / 2, rtol=0, atol=1e-6)
    assert optics(asymmetry=0.77).moments(2)[0, 1] == pytest.approx(0.77)
    plain = optics()
    reflecting = optics(internal_reflection=1.0)
    assert 1 - reflecting.ssa[0, 0] > 1.1 * (1 - plain.ssa[0, 0])
    # The same mass and number in another shape is another area.
    for habit in ("columns", HABITS["plates"]):
        assert abs(optics(habit=habit).tau[0, 0] / plain.tau[0, 0] - 1) > 0.02

    def scattered(reflection, nu, asymmetry):
        varied = optics(internal_reflection=reflection, nu=nu, asymmetry=asymmetry)
        return varied.scattering[0] + varied.moments(2)[0, 1]

    point = tuple(jnp.asarray(x) for x in (0.5, 1.0, 0.8))
    slope = jax.jit(lambda *tangent: jax.jvp(scattered, point, tangent)[1])
    by_reflection, by_shape, by_asymmetry = (slope(*row) for row in np.eye(3))
    assert by_reflection < 0 and np.isfinite(by_shape) and by_shape != 0
    np.testing.assert_allclose(by_asymmetry, 1, rtol=1e-12)


def test_rimed_classes_scatter_by_a_given_asymmetry(make_atmosphere):
    for name, density in (("graupel", 400.0), ("hail", 900.0)):
        atmosphere = column(make_atmosphere, name, 1.0, 1e5)
        optics = hydrometeor(atmosphere, name, BANDS["C02"])
        np.testing.assert_allclose(optics.moments(2)[0, 1], 0.8, rtol=0, atol=2e-4)
        # Spheres of the bulk density: Lam = (pi density N / m)^(1/3), A = N (pi / 2) / Lam^2.
        slope = (math.pi * density * 1e5) ** (1 / 3)
        np.testing.assert_allclose(optics.tau[0, 0], 2 * 1e5 * math.pi / 2 / slope**2, rtol=0.005)


@pytest.mark.parametrize("name", CLASSES)
def test_number_from_radius_is_the_inverse_of_radius_from_number(name):
    optics = CLASSES[name]
    inside = np.geomspace(1.01 * optics.smallest_radius, 0.99 * optics.largest_radius, 9)
    mass, radius = np.array([0.3] * 9 + [0.0] * 2), np.array([*inside, 0.0, 3e-5])
    particles = from_effective_radius(jnp.asarray(mass), jnp.asarray(radius), name)
    found = np.asarray(particle_radius(particles, name))
    np.testing.assert_allclose(found[:9], inside, rtol=1e-12)
    np.testing.assert_array_equal(np.asarray(particles.number_path)[9:], 0)
    np.testing.assert_array_equal(found[9:], 0)


@pytest.mark.parametrize("name", CLASSES)
def test_size_bends_at_its_limits_and_mass_stays(make_atmosphere, name):
    optics = CLASSES[name]
    number = np.geomspace(1e-10, 1e25, 800)
    particles = Hydrometeor(jnp.full(800, 0.1), jnp.asarray(number))
    radius = np.asarray(particle_radius(particles, name))
    assert np.all(np.diff(radius) <= 0)
    assert radius[0] < 1.65 * optics.largest_radius and radius[0] > optics.largest_radius
    assert radius[-1] > optics.smallest_radius / 1.65 and radius[-1] < optics.smallest_radius
    slope = np.diff(np.log(radius)) / np.diff(np.log(number))
    # No corner: the slope changes by a tenth of its greatest value from one number to the next.
    assert np.abs(np.diff(slope)).max() < 0.1 * np.abs(slope).max()


@pytest.mark.float32
@pytest.mark.parametrize("name", ["rain", "ice"])  # water and ice: classes differ in constants
def test_derivatives_are_finite_at_any_mass_and_number(make_atmosphere, name):
    values = [0.0, 1e-30, 1e-18, 1e-3, 1.0, 1e10]
    mass, number = (grid.ravel() for grid in np.meshgrid(values, values))
    atmosphere = column(make_atmosphere, name, mass, number, jnp.float32)

    def outputs(particles):
        one = dataclasses.replace(atmosphere, hydrometeors={name: particles})
        optics = hydrometeor(one, name, BANDS["C06"])
        asymmetry = optics.scatterers[0].phase.moments(2)[:, 1]
        value = jnp.stack([optics.tau.sum(), optics.scattering.sum(), asymmetry.sum()])
        return value, (value, optics)

    differentiate = jax.jit(jax.jacrev(outputs, has_aux=True))
    jacobian, (value, optics) = differentiate(atmosphere.hydrometeors[name])
    assert optics.tau.dtype == jnp.float32
    assert np.all(np.isfinite(value)) and np.all(np.isfinite(optics.tau))
    empty = (mass == 0) | (number == 0)
    np.testing.assert_array_equal(optics.tau[0, empty], 0)
    np.testing.assert_array_equal(optics.scattering[empty], 0)
    for leaf in (jacobian.mass_path, jacobian.number_path):
        assert np.all(np.isfinite(leaf))
        np.testing.assert_array_equal(leaf[:, empty], 0)


def test_derivatives_against_differences(make_atmosphere):
    name = "ice"
    atmosphere = of_radius(make_atmosphere, name, [0.02, 0.1, 0.5, 1.0], [15.0, 30.0, 60.0, 120.0])

    def outputs(log_mass, log_number):
        particles = Hydrometeor(jnp.exp(log_mass), jnp.exp(log_number))
        one = dataclasses.replace(atmosphere, hydrometeors={name: particles})
        optics = hydrometeor(one, name, BANDS["C06"])
        return jnp.stack([optics.tau[0], optics.scattering, optics.moments(2)[:, 1]])

    particles, step = atmosphere.hydrometeors[name], 1e-5
    x = (jnp.log(particles.mass_path), jnp.log(particles.number_path))
    ones = (jnp.ones(4), jnp.full(4, -0.5))
    along = jax.jit(lambda *x: jax.jvp(outputs, x, ones))
    forward = along(*x)[1]
    shifted = [
        along(*(a + sign * step * b for a, b in zip(x, ones, strict=True)))[0] for sign in (1, -1)
    ]
    difference = (shifted[0] - shifted[1]) / (2 * step)
    np.testing.assert_allclose(forward, difference, rtol=1e-6, atol=1e-8)
    pulled = jax.jit(jax.grad(lambda *x: outputs(*x).sum(), (0, 1)))(*x)
    total = sum(float(jnp.sum(a * b)) for a, b in zip(pulled, ones, strict=True))
    np.testing.assert_allclose(total, jnp.sum(forward), rtol=1e-10)


def test_single_precision_agrees_with_double(make_atmosphere):
    mass, number = [0.02, 0.05, 0.01, 0.1], [1.5e4, 2e5, 3e3, 1e4]
    optics = jax.jit(lambda atmosphere: hydrometeor(atmosphere, "snow", BANDS["C05"]))
    single, double = (
        optics(column(make_atmosphere, "snow", mass, number, dtype))
        for dtype in (jnp.float32, jnp.float64)
    )
    assert single.tau.dtype == single.scattering.dtype == jnp.float32
    np.testing.assert_allclose(single.tau, double.tau, rtol=2e-5)
    np.testing.assert_allclose(single.ssa, double.ssa, rtol=2e-5)


def test_a_batch_is_as_one_column(make_atmosphere):
    mass, number = np.full((3, 4), 0.02), np.geomspace(1e3, 1e9, 12).reshape(3, 4)
    columns = [column(make_atmosphere, "ice", m, n) for m, n in zip(mass, number, strict=True)]
    batch = jax.tree.map(lambda *leaves: jnp.stack(leaves), *columns)

    @jax.jit
    def tau(atmosphere):
        return hydrometeor(atmosphere, "ice", BANDS["C02"]).tau

    looped = np.stack([tau(one) for one in columns])
    np.testing.assert_allclose(jax.jit(jax.vmap(tau))(batch), looped, rtol=1e-13)


def test_fraction_outside_the_fitted_range(make_atmosphere):
    # Generalized effective sizes of 60 and 400 um: the second is beyond the fits of Fu.
    atmosphere = of_radius(make_atmosphere, "ice", [0.02, 0.1], [60 / SIZE, 400 / SIZE])
    clear = LiquidCloud(jnp.zeros(4), jnp.zeros(4))
    atmosphere = dataclasses.replace(atmosphere, liquid=clear)
    band = BANDS["C02"]
    outside = jax.jit(lambda atmosphere: outside_fitted_range(atmosphere, band))
    tau = np.asarray(jax.jit(lambda a: hydrometeor(a, "ice", band).tau[0])(atmosphere))
    np.testing.assert_allclose(outside(atmosphere), tau[1] / tau.sum(), rtol=1e-12)
    # A given asymmetry factor is good at any size.
    rough = CLASSES | {"ice": CLASSES["ice"]._replace(asymmetry="roughened")}
    assert outside_fitted_range(atmosphere, band, rough) == 0
    # Droplets of 1 um are outside, and counted with the rest.
    small = from_effective_radius(jnp.full(4, 1e-3), jnp.full(4, 1.2e-6), "cloud")
    liquid = LiquidCloud(small.mass_path, small.number_path)
    cloudy = dataclasses.replace(atmosphere, liquid=liquid)
    cloud = np.asarray(jax.jit(lambda a: liquid_cloud(a, band).tau)(cloudy)).sum()
    np.testing.assert_allclose(outside(cloudy), (tau[1] + cloud) / (tau.sum() + cloud), rtol=1e-12)
    empty = dataclasses.replace(atmosphere, hydrometeors={})
    differentiate = jax.jit(jax.value_and_grad(lambda a: outside_fitted_range(a, band)))
    value, derivative = differentiate(empty)
    assert value == 0 and jnp.shape(value) == ()
    assert np.all(np.isfinite(derivative.liquid.mass_path))


def test_what_is_not_known_is_refused(make_atmosphere):
    atmosphere = column(make_atmosphere, "snow", 0.1, 1e4)
    with pytest.raises(ValueError, match=r"no hydrometeor 'hail'; the atmosphere has \['snow'\]"):
        hydrometeor(atmosphere, "hail", BANDS["C01"])
    with pytest.raises(ValueError, match="no index of ice and water for 'C13'"):
        hydrometeor(atmosphere, "snow", Band("C13", 10.34))
    odd = dataclasses.replace(atmosphere, hydrometeors={"sleet": atmosphere.hydrometeors["snow"]})
    with pytest.raises(ValueError, match="nothing is assumed of hydrometeor 'sleet'; have"):
        hydrometeor(odd, "sleet", BANDS["C01"])

    def varied(**settings):
        classes = CLASSES | {"snow": CLASSES["snow"]._replace(**settings)}
        return hydrometeor(atmosphere, "snow", BANDS["C01"], classes)

    with pytest.raises(ValueError, match="no habit 'stars'"):
        varied(habit="stars")
    with pytest.raises(ValueError, match="no asymmetry 'smooth'"):
        varied(asymmetry="smooth")
    with pytest.raises(ValueError, match="no efficiencies 'mie'"):
        varied(efficiencies="mie")
    with pytest.raises(ValueError, match="no efficiencies 'fu1996' for 'snow'"):
        varied(habit="drops", efficiencies="fu1996")


def test_a_radius_that_is_no_number_gives_none():
    """Told apart from no particles: the mass would go missing."""
    radius = jnp.asarray([3e-5, np.nan, 0.0])
    number = from_effective_radius(jnp.full(3, 0.1), radius, "ice").number_path
    assert number[0] > 0 and np.isnan(number[1]) and number[2] == 0
