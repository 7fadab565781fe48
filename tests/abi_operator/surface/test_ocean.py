"""The sea against NumPy, its energy, its modes at any wind, corners and derivatives."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import erfc

from abi_operator.bands import BANDS
from abi_operator.optics.water import REFRACTIVE_INDEX
from abi_operator.solver import half_range
from abi_operator.surface import Ocean, directional_albedo, ocean
from abi_operator.surface.ocean import PURE_WATER, foam_fraction, fresnel_reflectance

WINDS = (1.0, 5.0, 10.0, 15.0)
BRDF = jax.jit(Ocean.brdf)
ALBEDO = jax.jit(directional_albedo)


def numpy_fresnel(cosine, index):
    """Both polarisations by Snell's law with a complex angle."""
    inside = np.sqrt(1 - (1 - cosine**2) / index**2 + 0j)
    across = (cosine - index * inside) / (cosine + index * inside)
    along = (index * cosine - inside) / (index * cosine + inside)
    return 0.5 * (np.abs(across) ** 2 + np.abs(along) ** 2)


def numpy_glint(mu_out, mu_in, azimuth, variance, index):
    """From vectors: the facet's normal, the density of its slopes, what hides it."""
    out = np.array([np.sqrt(1 - mu_out**2), 0, mu_out])
    into = np.sqrt(1 - mu_in**2)
    into = np.array([into * np.cos(azimuth), into * np.sin(azimuth), mu_in])
    normal = (out + into) / np.linalg.norm(out + into)
    tilt = normal[2]
    slopes = np.exp(-(1 / tilt**2 - 1) / variance) / (np.pi * variance)

    def hidden(mu):
        cot = mu / np.sqrt(1 - mu**2)
        first = np.sqrt(variance / np.pi) / cot * np.exp(-(cot**2) / variance)
        return 0.5 * (first - erfc(cot / np.sqrt(variance)))

    shadowing = 1 / (1 + hidden(mu_out) + hidden(mu_in))
    fresnel = numpy_fresnel(normal @ out, index)
    return np.pi * fresnel * slopes * shadowing / (4 * mu_in * mu_out * tilt**4)


def test_fresnel_against_complex_angles():
    cosine = np.linspace(0, 1, 31)
    for index in (1.34 - 0j, 1.29 - 4e-4j, 1.35 - 0.004j, 1.5 - 2j):
        found = jax.jit(fresnel_reflectance)(
            *(jnp.asarray(x) for x in (cosine, index.real, -index.imag))
        )
        np.testing.assert_allclose(found, numpy_fresnel(cosine, index), rtol=1e-12)


def test_reflectance_against_vectors():
    rng = np.random.default_rng(4)
    for wind in (0.5, 7.0):
        sea = ocean(jnp.asarray(wind), "C05")
        index = float(sea.refractive_index) - 1j * float(sea.absorption_index)
        for mu_out, mu_in, turn in rng.uniform(0.05, 1, (20, 3)):
            azimuth = np.pi * turn
            found = BRDF(sea, *(jnp.asarray(x) for x in (mu_out, mu_in, azimuth)))
            foam = 2.95e-6 * wind**3.52
            glint = numpy_glint(mu_out, mu_in, azimuth, 0.003 + 0.00512 * wind, index)
            expected = (1 - foam) * glint + foam * 0.100
            np.testing.assert_allclose(found, expected, rtol=1e-10)


def test_foam_by_hand():
    """About 1 % of the sea at 10 m/s (Monahan and O'Muircheartaigh, 1980)."""
    np.testing.assert_allclose(foam_fraction(jnp.asarray(10.0)), 2.95e-6 * 10**3.52)
    assert 0.009 < foam_fraction(jnp.asarray(10.0)) < 0.011
    storm = dataclasses.replace(ocean(jnp.asarray(20.0), "C01"), foam_reflectance=jnp.asarray(1.0))
    away = [jnp.asarray(x) for x in (0.9, 0.4, 0.0)]
    foam = 2.95e-6 * 20**3.52
    # Far from the glint a sea of white foam is foam and water, with a little skylight's glint.
    np.testing.assert_allclose(BRDF(storm, *away), foam + (1 - foam) * 0.02, rtol=0.1)


def test_no_more_light_leaves_than_falls_in():
    zenith = jnp.deg2rad(jnp.asarray([0, 20, 40, 60, 70, 80, 85, 88, 89.0]))
    winds = jnp.asarray([0.0, *WINDS])[:, None]
    albedo = ALBEDO(ocean(winds, "C01"), jnp.cos(zenith))
    assert np.all(albedo > 0.04) and np.all(albedo < 0.7)
    # A perfect mirror loses only what would meet the sea twice, and what waves turn downwards.
    mirror = dataclasses.replace(ocean(winds, "C03"), refractive_index=jnp.asarray(1e9))
    perfect = ALBEDO(mirror, jnp.cos(zenith))
    assert np.all(perfect <= 1) and np.all(perfect > 0.85)
    # Under a high sun nothing is lost; the foam of 0.212 is left out.
    foam = foam_fraction(winds)[:, 0]
    np.testing.assert_allclose(perfect[:2, 0], (1 - foam[:2]) + 0.212 * foam[:2], rtol=1e-6)


def test_calm_water_reflects_as_fresnel_says():
    """Albedo of a slightly rough sea, under a high sun that of a flat one."""
    sea = dataclasses.replace(ocean(jnp.asarray(0.0), "C02"), water_reflectance=jnp.asarray(0.0))
    flat = fresnel_reflectance(jnp.asarray(0.8), sea.refractive_index, sea.absorption_index)
    # The tilts of a variance of 0.003 change it by as much.
    np.testing.assert_allclose(ALBEDO(sea, jnp.asarray(0.8)), flat, rtol=0.02)


def test_reciprocal(make_ground):
    rng = np.random.default_rng(5)
    mu_out, mu_in = (jnp.asarray(x) for x in rng.uniform(0.01, 1, (2, 300)))
    azimuth = jnp.asarray(rng.uniform(0, np.pi, 300))
    sea = make_ground("ocean", (300,))

    @jax.jit
    def one_way(mu_out, mu_in):
        return sea.brdf(mu_out, mu_in, azimuth), sea.modes(2, mu_out, mu_in)

    for there, back in zip(one_way(mu_out, mu_in), one_way(mu_in, mu_out), strict=True):
        np.testing.assert_allclose(there, back, rtol=1e-12, atol=1e-14)


def dense_modes(sea, orders, mu_out, mu_in, count=10000, chunk=500):
    """Midpoint rule, fine enough for a calm sea seen and lit at 89 degrees."""

    @jax.jit
    def part(sea, azimuth):
        values = sea.brdf(mu_out[None], mu_in[None], azimuth[:, None, None])
        return jnp.einsum("mk,kij->mij", jnp.cos(orders[:, None] * azimuth), values) / count

    azimuth = np.pi * (np.arange(count) + 0.5) / count
    return sum(np.asarray(part(sea, jnp.asarray(x))) for x in azimuth.reshape(-1, chunk))


def test_modes_against_dense_quadrature():
    """Streams of a 16-stream solver and views: modes to 1e-10 of the mean, at any wind alike."""
    nodes = np.concatenate([half_range(16)[0][::2], [0.02, 0.5, 0.9, 1.0]])
    # One axis of the directions' pairs and one of winds.
    mu_out, mu_in = (jnp.asarray(x.reshape(-1, 1)) for x in np.meshgrid(nodes, nodes))
    sea = ocean(jnp.asarray(WINDS), "C03")
    orders = jnp.asarray([0, 1, 2, 7, 15, 31, 63])
    dense = dense_modes(sea, orders.astype(float), mu_out, mu_in)
    for count, num_modes in ((48, 7), (24, 5)):
        few = dataclasses.replace(sea, num_azimuths=count)
        found = jax.jit(jax.vmap(lambda m, few=few: few.modes(m, mu_out, mu_in)))(orders)
        error = np.abs(found - dense)[:num_modes] / dense[0]
        np.testing.assert_array_less(error, 1e-10)


def test_derivatives_in_the_sea():
    sea = dataclasses.replace(ocean(jnp.asarray(6.0), "C06"), water_reflectance=jnp.asarray(0.01))
    mu_out, mu_in, azimuth = (jnp.asarray(x) for x in (0.8, 0.6, 2.5))

    def outputs(sea):
        return jnp.stack([sea.brdf(mu_out, mu_in, azimuth), sea.modes(3, mu_out, mu_in)])

    @jax.jit
    def slopes(sea, direction):
        _, pull_back = jax.vjp(outputs, sea)
        rows = [pull_back(row)[0] for row in jnp.eye(2)]
        return rows, *jax.jvp(outputs, (sea,), (direction,))

    ones = jax.tree.map(jnp.ones_like, sea)
    rows, _, along = slopes(sea, ones)
    totals = [sum(jax.tree.leaves(row)) for row in rows]
    np.testing.assert_allclose(along, totals, rtol=1e-11)
    step = 1e-6
    for name in ("wind_speed", "refractive_index", "water_reflectance", "foam_reflectance"):
        value = getattr(sea, name)
        moved = (dataclasses.replace(sea, **{name: value + d}) for d in (step, -step))
        ends = [slopes(one, ones)[1] for one in moved]
        difference = (ends[0] - ends[1]) / (2 * step)
        found = [getattr(row, name) for row in rows]
        np.testing.assert_allclose(found, difference, rtol=1e-6, atol=1e-9)


def test_derivatives_in_angles():
    sea = ocean(jnp.asarray(3.0), "C01")
    rng = np.random.default_rng(6)
    inputs = tuple(
        jnp.asarray(x) for x in (*rng.uniform(0.2, 0.95, (2, 40)), rng.uniform(2, 3, 40))
    )
    step = 1e-6
    slope_along = jax.jit(lambda *x: jax.jvp(sea.brdf, x[:3], x[3:])[1])
    for i in range(3):
        direction = [np.full(40, float(i == j)) for j in range(3)]
        ends = [
            BRDF(sea, *(x + sign * step * d for x, d in zip(inputs, direction, strict=True)))
            for sign in (1, -1)
        ]
        slope = slope_along(*inputs, *direction)
        np.testing.assert_allclose(slope, (ends[0] - ends[1]) / (2 * step), rtol=1e-6, atol=1e-8)


def test_derivatives_are_finite_in_the_corners(corners):
    dtype = jnp.float32  # which leaves its range first
    inputs = tuple(jnp.asarray(x, dtype) for x in corners)
    sea = ocean(jnp.asarray([0.0, 1.0, 12.0], dtype)[:, None], "C03")

    def total(sea, mu_out, mu_in, azimuth):
        brdf = jnp.sum(sea.brdf(mu_out, mu_in, azimuth))
        # Modes are sums of it over azimuths that have derivatives of their own.
        return brdf + jnp.sum(sea.modes(1, mu_out, mu_in))

    value, slopes = jax.jit(jax.value_and_grad(total, argnums=(0, 1, 2, 3)))(sea, *inputs)
    assert np.isfinite(value)
    for slope in jax.tree.leaves(slopes):
        assert slope.dtype == dtype and np.all(np.isfinite(slope))


def test_float32_stays_and_is_near():
    mu = jnp.asarray([[0.1, 0.5, 0.9]])
    azimuth = jnp.asarray(2.9)
    double, single = (ocean(jnp.asarray(4.0, dtype), "C02") for dtype in (float, jnp.float32))

    @jax.jit
    def both(sea, mu, azimuth):
        return sea.brdf(mu, mu.T, azimuth), sea.modes(jnp.asarray(1), mu, mu.T)

    expected = both(double, mu, azimuth)
    found = both(single, mu.astype(jnp.float32), azimuth.astype(jnp.float32))
    for a, b in zip(found, expected, strict=True):
        assert a.dtype == jnp.float32
        # exp of a number of order 100, which has lost as many units of the last digit.
        np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-6)


def test_pure_water_is_that_of_the_droplets():
    """Two rooms, neither of which imports the other, hold this table: they must agree."""
    assert {band: complex(n, -k) for band, (n, k) in PURE_WATER.items()} == REFRACTIVE_INDEX


def test_every_band_has_its_sea_and_others_are_named():
    for name in BANDS:
        sea = ocean(jnp.asarray(5.0), name)
        assert isinstance(sea, Ocean) and sea.refractive_index > 1.25
    given = ocean(jnp.asarray(5.0), "C01", jnp.asarray(0.05), jnp.asarray(0.3))
    assert given.water_reflectance == 0.05 and given.foam_reflectance == 0.3
    with pytest.raises(ValueError, match="no sea water for band 'C13'"):
        ocean(jnp.asarray(5.0), "C13")
