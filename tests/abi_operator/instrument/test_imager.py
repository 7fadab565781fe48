"""The whole instrument: its order, and at which temperature a fire saturates it."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator import BANDS, Fire, Geometry, State, radiance, standard_atmosphere
from abi_operator.instrument import (
    Imager,
    Observation,
    calibration_gain,
    footprint_mean,
    hard_ceiling,
    image_mean,
    observe,
    observe_mean,
    overlap_lengths,
    range_ceiling,
)
from abi_operator.optics import gas_absorption, rayleigh, transmittance
from abi_operator.planck import brightness_temperature, in_band_radiance

CELLS = 25  # cells of 400 m in a pixel of 2 km
WEIGHTS = jnp.full(CELLS, 0.16)  # their area [km2]
GROUND = 300.0
seen_by = jax.jit(observe, static_argnums=2)


def burning(temperature, band="C07", satellite="GOES-16"):
    """One black cell at `temperature` among 24 at 300 K, without air and sun."""
    cells = jnp.full(CELLS, GROUND).at[0].set(temperature)
    return in_band_radiance(cells, band, satellite)


def saturation_temperature(band, imager):
    """Temperature at which one burning cell saturates the pixel, by bisection. [K]"""
    saturated = jax.jit(lambda t: observe(burning(t, band), WEIGHTS, band, imager).saturated)
    low, high = 400.0, 1500.0
    while high - low > 0.01:
        middle = (low + high) / 2
        low, high = (low, middle) if saturated(middle) else (middle, high)
    return high


def test_radiance_is_averaged_before_it_is_limited():
    cells = burning(750.0)
    right = seen_by(cells, WEIGHTS, "C07")
    assert right.saturated
    np.testing.assert_allclose(right.brightness_temperature, 411.86, atol=0.01)
    # Limiting the cells first would hide the fire: one cell of 412 K among 24 of 300 K.
    wrong = footprint_mean(hard_ceiling(cells, range_ceiling("C07")), WEIGHTS)
    np.testing.assert_allclose(brightness_temperature(wrong, "C07"), 319, atol=1)


@pytest.mark.parametrize(
    ("band", "imager", "expected", "tolerance"),
    [
        ("C07", Imager(), 638, 3),
        ("C07", Imager(fire_saturation_temperature=400.0), 609, 3),
        ("C06", Imager(), 808, 5),
    ],
)
def test_fire_that_saturates_one_pixel(band, imager, expected, tolerance):
    assert saturation_temperature(band, imager) == pytest.approx(expected, abs=tolerance)


def test_air_sun_and_emissivity_move_the_limits_of_a_fire():
    """The same fire by the operator: nothing between, then air, then sun on a ground that reflects.

    By Beer's law a fire saturates where p (1 - a) t [B(T) - B(300 K)] fills what the pixel without
    it leaves below the ceiling.
    """
    bands = ("C06", "C07")
    day = Geometry(jnp.asarray(0.6), jnp.asarray(0.9), jnp.asarray(1.0))
    night = replace(day, solar_zenith=jnp.asarray(2.0))
    air = standard_atmosphere("midlatitude_summer", np.linspace(30e3, 0.0, 9))
    nothing = replace(air, pressure=0 * air.pressure, gases=jax.tree.map(jnp.zeros_like, air.gases))
    cases = [(nothing, night, 0.0), (air, night, 0.0), (air, night, 0.2), (air, day, 0.2)]
    columns = [
        State(a, dict.fromkeys(bands, jnp.asarray(x)), g, jnp.asarray(GROUND)) for a, g, x in cases
    ]
    states = jax.tree.map(lambda *x: jnp.asarray(np.stack(x)), *columns)

    @jax.jit
    def pixel(temperature):
        """Radiance of the burning cell and of the 24 others, (case, cell, band)."""
        cells = [
            replace(states, fire=Fire(jnp.full(4, share), temperature)) for share in (1.0, 0.0)
        ]
        both = jax.tree.map(lambda *x: jnp.stack(x, axis=1), *cells)
        return radiance(both, bands, num_streams=2, num_modes=1, num_doublings=0)

    saturated = jax.jit(
        jax.vmap(lambda x, band: observe(x, jnp.array([1.0, 24.0]), band).saturated, (0, None)),
        static_argnums=1,
    )

    @partial(jax.jit, static_argnums=1)
    def through(atmosphere, band):
        """Share of radiance that comes through the air on its way to the satellite."""
        absorbing = gas_absorption(atmosphere, BANDS[band]) + rayleigh(atmosphere, BANDS[band])
        return transmittance(absorbing, 1 / day.mu)

    limits = {}
    for k, band in enumerate(bands):
        low, high = np.full(4, 400.0), np.full(4, 1500.0)
        while np.max(high - low) > 0.01:
            middle = (low + high) / 2
            full = saturated(pixel(jnp.asarray(middle))[:, :, k], band)
            low, high = np.where(full, low, middle), np.where(full, middle, high)
        limits[band] = high
        clear = np.array([through(a, band) for a, *_ in cases])
        emissivity = np.array([1 - albedo for *_, albedo in cases])
        room = 25 * (range_ceiling(band) - pixel(jnp.asarray(high))[:, 1, k])
        needed = in_band_radiance(jnp.asarray(GROUND), band) + room / (clear * emissivity)
        # What air scatters is not in the transmittance; a tenth of a per cent of a radiance that
        # goes as the seventh power of temperature or a higher one.
        np.testing.assert_allclose(high, brightness_temperature(needed, band), atol=0.3)
    assert limits["C07"][0] == pytest.approx(638, abs=3)
    assert limits["C06"][0] == pytest.approx(808, abs=5)
    for found in limits.values():
        clear, hazy, grey, sunny = found
        assert clear < hazy < grey and sunny < grey
    # Sun takes a fifth of the range of C06, and a few hundredths of that of C07.
    assert limits["C06"][2] - limits["C06"][3] > 4 * (limits["C07"][2] - limits["C07"][3]) > 0


def test_a_whole_pixel_saturates_at_the_ceiling():
    cells = in_band_radiance(jnp.full(CELLS, 405.0), "C07")
    open_, paper = (
        seen_by(cells, WEIGHTS, "C07", Imager(fire_saturation_temperature=t)) for t in (None, 400.0)
    )
    assert not open_.saturated and paper.saturated
    np.testing.assert_allclose(open_.brightness_temperature, 405, rtol=1e-12)
    np.testing.assert_allclose(paper.brightness_temperature, 400, rtol=1e-12)


@pytest.mark.parametrize("band", ["C01", "green", "C06"])
def test_reflective_bands_report_the_reflectance_factor(band):
    value = seen_by(jnp.array([10.0, 20.0]), jnp.array([3.0, 1.0]), band, sun_distance=1.01)
    assert isinstance(value, Observation) and value.brightness_temperature is None
    np.testing.assert_allclose(value.radiance, 12.5, rtol=1e-15)
    irradiance = {"C01": 2017.1648, "green": 1871.5, "C06": 76.8999}[band]
    np.testing.assert_allclose(
        value.reflectance_factor, np.pi * 1.01**2 * 12.5 / irradiance, rtol=1e-14
    )
    assert not value.saturated


def test_noise_comes_before_the_ceiling_and_the_ceiling_before_the_counts():
    imager = Imager(quantised=True)
    keys = jax.random.split(jax.random.key(7), 200)
    bright = jnp.full(3, range_ceiling("C06"))
    pixel = jax.jit(jax.vmap(lambda key: observe(bright, jnp.ones(3), "C06", imager, key=key)))
    noisy = pixel(keys)
    # Half of the draws lie above the range; none is reported so.
    assert 60 < noisy.saturated.sum() < 140
    ceiling = range_ceiling("C06")
    assert noisy.radiance.max() <= ceiling * (1 + 1e-14)
    counts = (noisy.radiance + 0.9609507) / 0.030088475
    np.testing.assert_allclose(counts, jnp.round(counts), atol=1e-9)


def test_pixels_share_the_calibration_error_and_not_the_noise():
    cells = jnp.broadcast_to(jnp.linspace(10.0, 20.0, 4), (6, 4))
    keys = jax.random.split(jax.random.key(1), 6)
    weights, common = jnp.ones(4), jax.random.key(2)
    gained = jax.vmap(lambda x: observe(x, weights, "C05", calibration_key=common))
    clean = jax.jit(gained)(cells)
    np.testing.assert_allclose(clean.radiance, 15 * calibration_gain("C05", common), rtol=1e-14)
    noisy = jax.jit(jax.vmap(lambda x, key: observe(x, weights, "C05", key=key)))(cells, keys)
    assert len(np.unique(noisy.radiance)) == 6


def test_no_noise_unless_asked():
    cells = burning(500.0)
    a, b = (seen_by(cells, WEIGHTS, "C07") for _ in range(2))
    np.testing.assert_array_equal(a.radiance, b.radiance)
    np.testing.assert_allclose(a.radiance, footprint_mean(cells, WEIGHTS), rtol=1e-15)


def test_an_image_is_its_pixels():
    cells = in_band_radiance(jnp.linspace(280.0, 700.0, 100).reshape(10, 10), "C07")
    lengths = overlap_lengths(jnp.arange(11.0) * 400, jnp.arange(3.0) * 2000)
    imager = Imager(quantised=True)
    whole = jax.jit(lambda x: observe_mean(image_mean(x, lengths, lengths), "C07", imager))
    image = whole(cells)
    blocks = cells.reshape(2, 5, 2, 5).swapaxes(1, 2).reshape(4, CELLS)
    pixels = jax.jit(jax.vmap(lambda x: observe(x, WEIGHTS, "C07", imager)))(blocks)
    assert 0 < pixels.saturated.sum() < 4
    np.testing.assert_array_equal(image.saturated.ravel(), pixels.saturated)
    np.testing.assert_allclose(image.radiance.ravel(), pixels.radiance, rtol=1e-12)
    np.testing.assert_allclose(
        image.brightness_temperature.ravel(), pixels.brightness_temperature, rtol=1e-12
    )


def test_vmap_is_a_loop():
    temperatures = jnp.array([300.0, 500.0, 700.0, 900.0])
    imager = Imager("GOES-18", ceiling_width=0.1)

    @jax.jit
    def pixel(temperature):
        return observe(burning(temperature, satellite="GOES-18"), WEIGHTS, "C07", imager)

    batch = jax.vmap(pixel)(temperatures)
    for i, temperature in enumerate(temperatures):
        jax.tree.map(
            lambda one, all_, i=i: np.testing.assert_allclose(one, all_[i], rtol=1e-14),
            pixel(temperature),
            batch,
        )


@pytest.mark.parametrize(
    ("temperature", "imager", "seen"),
    [
        (500.0, Imager(), True),
        (700.0, Imager(), False),
        (700.0, Imager(ceiling_width=0.2), True),
        (500.0, Imager(quantised=True), False),
    ],
)
def test_derivative_with_respect_to_the_fire(temperature, imager, seen):
    key = jax.random.key(9)

    def function(t):
        return observe(burning(t), WEIGHTS, "C07", imager, key=key).brightness_temperature

    @jax.jit
    def derivatives(point):
        _, forward = jax.jvp(function, (point,), (jnp.ones_like(point),))
        central = (function(point + 1e-3) - function(point - 1e-3)) / 2e-3
        return forward, jax.grad(function)(point), central

    forward, back, central = derivatives(jnp.asarray(temperature))
    np.testing.assert_allclose(back, forward, rtol=1e-12)
    assert (forward > 1e-3) == seen
    if not imager.quantised:
        np.testing.assert_allclose(forward, central, rtol=1e-6, atol=1e-12)


def test_derivative_with_respect_to_settings():
    cells = burning(700.0)

    @jax.jit
    def function(width, temperature):
        imager = Imager(fire_saturation_temperature=temperature, ceiling_width=width)
        return observe(cells, WEIGHTS, "C07", imager).radiance

    width, temperature = jnp.asarray(0.1), jnp.asarray(400.0)
    gradient = jax.jit(jax.grad(function, (0, 1)))(width, temperature)
    for i, step in enumerate((1e-5, 1e-3)):
        ends = [
            function(width + sign * step * (i == 0), temperature + sign * step * (i == 1))
            for sign in (1, -1)
        ]
        np.testing.assert_allclose(gradient[i], (ends[0] - ends[1]) / (2 * step), rtol=1e-6)


@pytest.mark.float32
@pytest.mark.parametrize(("band", "width"), [("C06", None), ("C07", 0.1)])
def test_float32_stays(band, width):
    imager = Imager(fire_saturation_temperature=400.0, ceiling_width=width, quantised=True)
    cells = in_band_radiance(jnp.full(CELLS, 350.0, jnp.float32), band)
    weights, key = jnp.ones(CELLS, jnp.float32), jax.random.key(1)
    pixel = jax.jit(lambda x: observe(x, weights, band, imager, sun_distance=1.01, key=key))
    value = pixel(cells)
    leaves = [x for x in jax.tree.leaves(value) if x.dtype != bool]
    assert len(leaves) == 2 and all(x.dtype == jnp.float32 for x in leaves)


def test_errors_name_what_came():
    with pytest.raises(ValueError, match="'C13'"):
        observe(jnp.ones(2), jnp.ones(2), "C13")
    with pytest.raises(ValueError, match="satellite 'GOES-15' is not known"):
        Imager("GOES-15")
    with pytest.raises(ValueError, match=r"radiance.shape=\(3,\) and weights.shape=\(2,\)"):
        observe(jnp.ones(3), jnp.ones(2), "C01")
    with pytest.raises(ValueError, match="floor is not specified in band 'green'"):
        observe(jnp.ones(2), jnp.ones(2), "green", key=jax.random.key(0))


@pytest.mark.parametrize("quantised", [False, True])
def test_counts_end_below_a_hotter_ceiling(quantised):
    """At 411.9 K: a pixel of 430 K is above them, though not above a detector's 450 K."""
    imager = Imager(fire_saturation_temperature=450.0, quantised=quantised)
    seen = observe_mean(in_band_radiance(jnp.asarray([300.0, 430.0, 460.0]), "C07"), "C07", imager)
    assert seen.saturated.tolist() == [False, quantised, True]
    hottest = 411.86 if quantised else 450.0
    np.testing.assert_allclose(seen.brightness_temperature[2], hottest, atol=0.05)


@pytest.mark.parametrize("temperature", [np.nan, 0.0, -300.0])
def test_a_ceiling_that_is_none_is_refused(temperature):
    with pytest.raises(ValueError, match="fire_saturation_temperature is .*; allowed is above 0 K"):
        Imager(fire_saturation_temperature=temperature)
