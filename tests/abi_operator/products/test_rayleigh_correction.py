"""The albedo of a ground under air is found again, whatever the angles and the pressure."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from cdisort import cdisort_brf

from abi_operator.optics.rayleigh import BETA2, STANDARD_DEPTH
from abi_operator.products import (
    air_response,
    corrected_colors,
    derived_green,
    natural_color,
    rayleigh_corrected,
)

BANDS = ("C01", "green", "C02", "C03")
PROMISED = 2e-3  # of albedo, by this package's own air
FOUND = 1e-4  # what it really is: CDISORT, at its worst with the sun near a stream, and splines
# By crefl's formulas, which contain the polarisation of skylight.
CREFL = {"C01": 0.012, "green": 0.004, "C02": 0.0015, "C03": 0.0002}


def scene(count=60, seed=5):
    """Ground of albedo 0-0.4 at 700-1030 hPa, sun and view within 65 degrees."""
    rng = np.random.default_rng(seed)
    mu0, mu = np.cos(np.radians(rng.uniform(0, 65, (2, count))))
    # CDISORT refuses a sun in one of its own directions.
    nodes = (np.polynomial.legendre.leggauss(16)[0] + 1) / 2
    mu0 = np.where(np.abs(mu0[:, None] - nodes).min(1) < 1e-3, mu0 - 3e-3, mu0)
    azimuth, albedo = rng.uniform(0, np.pi, count), rng.uniform(0, 0.4, count)
    return (
        {"mu0": mu0, "mu": mu, "relative_azimuth": azimuth},
        rng.uniform(7e4, 1.03e5, count),
        albedo,
    )


@pytest.fixture(scope="module")
def seen():
    """Reflectance of that scene in each band, by CDISORT: three layers of pure air."""
    angles, pressure, albedo = scene()
    brf = {}
    for band in BANDS:
        tau = STANDARD_DEPTH[band] * pressure[:, None] / 101325 * np.array([0.2, 0.3, 0.5])
        moments = np.zeros((3, 33))
        moments[:, [0, 2]] = 1, BETA2[band] / 5
        columns = zip(tau, albedo, *angles.values(), strict=True)
        brf[band] = np.array(
            [cdisort_brf(t, np.ones(3), moments, a, *x, 32, False) for t, a, *x in columns]
        )
    return brf


@pytest.mark.parametrize("band", BANDS)
def test_albedo_is_found_again(seen, band):
    angles, pressure, albedo = scene()
    error = rayleigh_corrected(band, seen[band], **angles, pressure=pressure) - albedo
    assert np.abs(error).max() < FOUND < PROMISED
    error = (
        rayleigh_corrected(band, seen[band], **angles, pressure=pressure, method="crefl") - albedo
    )
    assert CREFL[band] / 3 < np.abs(error).max() < CREFL[band]
    print(f"{band}: crefl is wrong by {np.abs(error).max():.4f} at most")


def test_colours_of_a_grey_ground_are_grey(seen):
    angles, pressure, albedo = scene()
    correction = partial(rayleigh_corrected, **angles, pressure=pressure)
    colours = corrected_colors(seen, correction, "correct_first")
    np.testing.assert_allclose(colours[:, 0], albedo, atol=FOUND)
    np.testing.assert_allclose(colours[:, 1], derived_green(albedo, albedo, albedo), atol=FOUND)
    np.testing.assert_allclose(colours[:, 2], albedo, atol=FOUND)
    # Green of the hazy bands is a little off light of 0.555 um, and so is what is left of it.
    first = corrected_colors(seen, correction)
    np.testing.assert_array_equal(first[:, [0, 2]], colours[:, [0, 2]])
    assert 1e-3 < np.abs(first[:, 1] - albedo).max() < 0.1
    assert np.isfinite(natural_color(seen, correction=correction)).all()


def test_inverse_is_exact_and_gases_are_undone():
    albedo = np.array([-0.1, 0.0, 0.2, 0.9])
    for method in ("operator", "crefl"):
        response = air_response("C01", 0.6, 0.8, 0.5, pressure=9e4, method=method)
        np.testing.assert_allclose(response.albedo(response.brf(albedo)), albedo, atol=1e-14)
        absorbed = response.through_gas(0.9, 0.8).brf(albedo)
        above = 0.9 * (response.path_brf + 0.8 * (response.brf(albedo) - response.path_brf))
        np.testing.assert_allclose(absorbed, above, rtol=1e-12)
        found = rayleigh_corrected(
            "C01",
            absorbed,
            0.6,
            0.8,
            0.5,
            pressure=9e4,
            method=method,
            gas_transmittance=0.9,
            vapour_transmittance=0.8,
        )
        np.testing.assert_allclose(found, albedo, atol=1e-14)


def test_depth_is_the_bands_or_ones_own():
    brf, angles = np.array(0.2), (0.6, 0.8, 0.5)
    given = rayleigh_corrected("C02", brf, *angles, pressure=8e4)
    tau = STANDARD_DEPTH["C02"] * 8e4 / 101325
    np.testing.assert_allclose(rayleigh_corrected("C02", brf, *angles, tau=tau), given, rtol=1e-12)
    np.testing.assert_allclose(rayleigh_corrected("C02", brf, *angles, tau=0.0), brf, rtol=1e-12)
    # A band of another imager, whose phase function is that of the standard one.
    assert np.isfinite(rayleigh_corrected("0.51", brf, *angles, tau=0.13))


def test_wrong_names_are_refused():
    with pytest.raises(ValueError, match="no Rayleigh depth for band 'C13': give tau"):
        rayleigh_corrected("C13", np.array(0.2), 0.6, 0.8, 0.5)
    with pytest.raises(ValueError, match="no Rayleigh correction '6S'.*operator.*crefl"):
        rayleigh_corrected("C01", np.array(0.2), 0.6, 0.8, 0.5, method="6S")


def test_derivatives_and_float32():
    """By the reflectance, the view's zenith angle and the pressure."""

    def corrected(brf, zenith, pressure, xp=jnp):
        return rayleigh_corrected("C01", brf, 0.7, xp.cos(zenith), 0.4, pressure=pressure)

    slope = jax.jit(lambda point, tangent: jax.jvp(corrected, point, tangent)[1])
    point, steps = np.array([0.25, 0.6, 9e4]), np.array([1e-6, 1e-5, 10.0])
    for k in range(3):
        step = np.eye(3)[k] * steps
        difference = corrected(*(point + step), np) - corrected(*(point - step), np)
        found = slope(tuple(point), tuple(np.eye(3)[k]))
        np.testing.assert_allclose(found, difference / (2 * steps[k]), rtol=1e-6)
    overhead = np.array([0.25, 0.0, 9e4])
    assert np.isfinite(slope(tuple(overhead), tuple(np.ones(3))))
    brf = jnp.full(3, 0.25, jnp.float32)
    for method in ("operator", "crefl"):
        single = jax.eval_shape(
            lambda x, m=method: rayleigh_corrected("C01", x, 0.6, 0.8, 0.5, method=m), brf
        )
        assert single.dtype == jnp.float32


def test_types_may_be_mixed():
    """The reflectance decides; the angles do where it is a plain number."""
    mu0 = np.linspace(0.4, 0.9, 3)
    for method in ("operator", "crefl"):
        correct = partial(
            rayleigh_corrected,
            mu=0.8,
            relative_azimuth=0.5,
            pressure=np.full(3, 9e4),
            method=method,
        )
        exact = correct("C01", np.full(3, 0.25), mu0=mu0)
        single = correct("C01", np.full(3, 0.25, np.float32), mu0=mu0, gas_transmittance=np.ones(3))
        mixed = correct("C01", jnp.full(3, 0.25, jnp.float32), mu0=mu0)
        plain = correct("C01", 0.25, mu0=jnp.asarray(mu0))
        assert exact.dtype == plain.dtype == np.float64 and isinstance(plain, jax.Array)
        assert single.dtype == mixed.dtype == np.float32 and isinstance(single, np.ndarray)
        for other in (single, mixed, plain):
            np.testing.assert_allclose(other, exact, atol=2e-6)


@pytest.mark.parametrize("method", ["operator", "crefl"])
def test_whole_numbers_are_numbers(method):
    """A reflectance of 1 or 0, whatever its type: angles beside it keep their digits."""
    angles = 0.8, 0.7, 1.0
    found = rayleigh_corrected("C01", np.array([1, 0]), *angles, method=method)
    expected = rayleigh_corrected("C01", np.array([1.0, 0.0]), *angles, method=method)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
