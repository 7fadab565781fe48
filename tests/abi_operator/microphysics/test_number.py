"""Numbers of particles by the schemes, against numbers worked out by hand."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.microphysics import (
    SCHEMES,
    FixedNumber,
    IceMassPower,
    Intercept,
    Predicted,
    droplet_shape,
    number_concentration,
    number_path,
    size_distribution,
)

# Of the limits of mean mass, which are smooth: what they take from number inside them.
LIMITS = 2e-3
COLD = 253.15
CLOSED = [
    (scheme, name)
    for scheme, classes in SCHEMES.items()
    for name, distribution in classes.items()
    if not isinstance(distribution.closure, Predicted)
]


def number(scheme, name, content, temperature=COLD, **settings):
    content = jnp.asarray(content, float)
    temperature = jnp.full_like(content, temperature)
    return number_concentration(scheme, name, content, temperature, **settings)


def test_rain_of_wsm():
    """Lam = (pi 1000 8e6 / 1e-3)^(1/4) = 2239.1 m-1 and N = 8e6 / Lam = 3572.9 m-3."""
    np.testing.assert_allclose(number("wsm6", "rain", 1e-3), 3572.9, rtol=1e-4)


def test_graupel_of_wsm():
    """Lam = (pi 500 4e6 / 1e-3)^(1/4) = 1583.2 m-1 and N = 4e6 / Lam = 2526.5 m-3."""
    np.testing.assert_allclose(number("wsm6", "graupel", 1e-3), 2526.5, rtol=1e-4)


def test_rain_of_kessler():
    """Lam = (pi 1000 1e7 / 1e-3)^(1/4) = 2367.5 m-1 and N = 1e7 / Lam = 4223.9 m-3."""
    np.testing.assert_allclose(number("kessler", "rain", 1e-3), 4223.9, rtol=1e-4)


def test_snow_of_wsm_grows_with_cold():
    """20 K below freezing N0 = 2e6 exp(2.4) = 2.2046e7; Lam = (pi 100 N0 / 1e-4)^(1/4) = 2884.9."""
    np.testing.assert_allclose(number("wsm5", "snow", 1e-4), 2.2046e7 / 2884.9, rtol=LIMITS)
    # Above freezing N0 is 2e6: Lam = (pi 100 2e6 / 1e-4)^(1/4) = 1583.2.
    np.testing.assert_allclose(number("wsm5", "snow", 1e-4, 278.15), 2e6 / 1583.2, rtol=LIMITS)


def test_ice_of_wsm():
    """5.38e7 (1e-5)^0.75 = 9567 m-3; the floor of 1e3, in quadrature, makes it 9619."""
    np.testing.assert_allclose(number("wsm3", "ice", 1e-5), 9619, rtol=LIMITS)


def test_graupel_of_thompson():
    """N0 = 10^(3 + 10/7) = 26827; Lam = (pi 500 N0 / 1e-3)^(1/4) = 453.1 and N = 59.21 m-3."""
    np.testing.assert_allclose(number("thompson", "graupel", 1e-3), 59.21, rtol=0.015)
    # The upper limit of size, 6.9 mm of 1 / Lam against 2.2 mm here, is what the tolerance is for.


def test_snow_of_thompson():
    """The moments of Field et al. at -20 deg C, step by step in plain numbers."""
    content, t, n = 1e-4, -20.0, 3
    a = 5.065339 - 0.062659 * t - 3.032362 * n + 0.029469 * t * n - 0.000285 * t**2
    a += 0.31255 * n**2 + 0.000204 * t**2 * n + 0.003199 * t * n**2 - 0.015952 * n**3
    b = 0.476221 - 0.015896 * t + 0.165977 * n + 0.007468 * t * n - 0.000141 * t**2
    b += 0.060366 * n**2 + 0.000079 * t**2 * n + 0.000594 * t * n**2 - 0.003577 * n**3
    second = content / 0.069
    third = 10**a * second**b
    slope = 3 * second / third
    # Of an exponential distribution the second moment is 2 N / Lam^2.
    np.testing.assert_allclose(
        number("thompson", "snow", content), second * slope**2 / 2, rtol=0.02
    )
    # Snow of 0.1 g m-3 at this temperature is some tenths of a millimetre long.
    assert 2e-4 < 1 / slope * 2 < 2e-3


def test_droplets_are_the_number_assumed():
    np.testing.assert_allclose(number("thompson", "cloud", 3e-4), 1e8, rtol=LIMITS)
    np.testing.assert_allclose(number("morrison", "cloud", 3e-4), 2.5e8, rtol=LIMITS)
    given = number("morrison", "cloud", 3e-4, closure=FixedNumber(4e7))
    np.testing.assert_allclose(given, 4e7, rtol=LIMITS)


@pytest.mark.parametrize(("scheme", "name"), CLOSED)
def test_mean_mass_stays_between_its_limits(scheme, name):
    content = np.geomspace(1e-14, 1.0, 30)
    distribution = size_distribution(scheme, name)
    mass = content / np.asarray(number(scheme, name, content))
    assert np.all(mass < distribution.largest_mass * (1 + 1e-9))
    assert np.all(mass > distribution.smallest_mass * 0.99)
    assert number(scheme, name, 0.0) == 0
    assert np.all(np.diff(np.asarray(number(scheme, name, content))) > 0)


@pytest.mark.parametrize(
    ("scheme", "name"),
    [
        ("wsm6", "snow"),
        ("wsm6", "ice"),
        ("thompson", "snow"),
        ("thompson", "graupel"),
    ],
)
def test_derivatives_against_differences(scheme, name):
    content, temperature = jnp.geomspace(1e-8, 1e-2, 7), jnp.linspace(230.0, 275.0, 7)

    def log_number(log_content, temperature):
        return jnp.log(number_concentration(scheme, name, jnp.exp(log_content), temperature))

    x, step = jnp.log(content), 1e-5
    ones = jnp.ones_like(x)
    along = jax.jit(lambda *x: jax.jvp(log_number, x, (ones, ones)))
    forward = along(x, temperature)[1]
    ahead, behind = (along(x + s, temperature + s)[0] for s in (step, -step))
    np.testing.assert_allclose(forward, (ahead - behind) / (2 * step), rtol=1e-6, atol=1e-8)
    back = jax.jit(lambda *x: jax.vjp(log_number, *x)[1](ones))(x, temperature)
    np.testing.assert_allclose(sum(back), forward, rtol=1e-12)


@pytest.mark.float32
@pytest.mark.parametrize(("scheme", "name"), CLOSED)
def test_finite_from_nothing_to_a_downpour_in_single_precision(scheme, name):
    content = jnp.asarray([0.0, 1e-38, 1e-20, 1e-12, 1e-6, 1e-2, 1e3], jnp.float32)
    temperature = jnp.asarray([180.0, 233.0, 260.0, 273.15, 273.05, 300.0, 320.0], jnp.float32)

    def total(content, temperature):
        return number_concentration(scheme, name, content, temperature)

    value, derivative = jax.vmap(jax.value_and_grad(total, (0, 1)))(content, temperature)
    assert value.dtype == jnp.float32
    for leaf in (value, *derivative):
        assert np.all(np.isfinite(leaf))
    # The steepest slope is that of the smallest particles.
    assert np.all(derivative[0] <= 1.001 / size_distribution(scheme, name).smallest_mass)


def test_assumptions_can_be_differentiated():
    def rain(intercept):
        return number("wsm6", "rain", 1e-3, closure=Intercept(intercept))

    # N = N0 / Lam and Lam goes with N0^(1/4).
    intercept = jnp.asarray(8e6)
    slope = jax.grad(rain)(intercept) * intercept / rain(intercept)
    np.testing.assert_allclose(slope, 0.75, rtol=1e-4)

    def ice(coefficient):
        return number("wsm6", "ice", 1e-4, closure=IceMassPower(coefficient))

    coefficient = jnp.asarray(5.38e7)
    slope = jax.grad(ice)(coefficient) * coefficient / ice(coefficient)
    np.testing.assert_allclose(slope, 1.0, rtol=5e-3)


def test_number_path_is_concentration_times_depth():
    mass_path, thickness = jnp.asarray([0.1, 0.0, 0.3]), jnp.asarray([200.0, 300.0, 500.0])
    temperature = jnp.asarray([250.0, 260.0, 270.0])
    columns = (mass_path, thickness, temperature)
    path = jax.jit(lambda *x: number_path("wsm6", "snow", *x))
    value = path(*columns)
    expected = number_concentration("wsm6", "snow", mass_path / thickness, temperature) * thickness
    np.testing.assert_allclose(value, expected, rtol=1e-14)
    looped = [path(*(x[k, None] for x in columns))[0] for k in range(3)]
    np.testing.assert_allclose(value, looped, rtol=1e-14)


def test_shapes_of_droplets():
    """Thompson at 1e8, 3e8 m-3: 12 and 5.33 unrounded. Morrison at 2.5e8: eta = 0.41425, 4.827."""
    np.testing.assert_allclose(
        droplet_shape("thompson", jnp.asarray([1e8, 3e8, 1.0])), [12, 5.333, 15], rtol=0.02
    )
    np.testing.assert_allclose(
        droplet_shape("morrison", jnp.asarray([2.5e8, 1.0, 1e10])), [4.827, 10, 2], rtol=1e-3
    )
    for scheme in ("thompson", "morrison"):
        slope = jax.jit(jax.vmap(jax.grad(lambda n, scheme=scheme: droplet_shape(scheme, n))))
        values = slope(jnp.asarray([0.0, 1e6, 1e8, 1e12]))
        assert np.all(np.isfinite(values)) and np.all(values <= 0)
    with pytest.raises(ValueError, match="no droplet shape of scheme 'wsm6'"):
        droplet_shape("wsm6", jnp.asarray(1e8))


def test_what_is_not_known_is_refused():
    with pytest.raises(ValueError, match=r"nothing is known of scheme 'p3'; have \['kessler'"):
        number("p3", "rain", 1e-3)
    np.testing.assert_array_equal(
        number("p3", "rain", 1e-3, assume="wsm6"), number("wsm6", "rain", 1e-3)
    )
    with pytest.raises(ValueError, match="nothing is known of scheme 'wdm6'"):
        number("p3", "rain", 1e-3, assume="wdm6")
    with pytest.raises(ValueError, match="scheme 'wsm5' has no class 'graupel'; it has"):
        number("wsm5", "graupel", 1e-3)
    with pytest.raises(ValueError, match="scheme 'morrison' predicts the number of 'snow'"):
        number("morrison", "snow", 1e-3)
    with pytest.raises(ValueError, match="SnowIntercept needs the temperature"):
        number_concentration("wsm6", "snow", jnp.asarray(1e-3))
    assert np.isfinite(number("morrison", "snow", 1e-3, closure=Intercept(2e7)))
