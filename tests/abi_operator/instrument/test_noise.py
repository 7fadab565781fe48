"""Noise and the error of calibration."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.instrument import (
    NOISE,
    Noise,
    add_noise,
    calibration_gain,
    noise_deviation,
    radiance_from_reflectance_factor,
)
from abi_operator.planck import brightness_temperature, in_band_radiance

DRAWS = 40_000
SAMPLING = 4 / np.sqrt(2 * DRAWS)  # four standard errors of a standard deviation


@pytest.mark.parametrize("band", ["C01", "C02", "C06"])
def test_signal_to_noise_is_300_in_bright_and_57_in_dim_scenes(band):
    for rho, ratio in ((1.0, 300), (0.05, 57)):
        radiance = radiance_from_reflectance_factor(jnp.asarray(rho), band)
        signal_to_noise = radiance / noise_deviation(radiance, band)
        # a and b are given to three digits and two.
        np.testing.assert_allclose(signal_to_noise, ratio, rtol=0.01)


@pytest.mark.parametrize("rho", [0.0, 0.3])
def test_reflective_draws_have_the_variance_of_the_model(rho):
    radiance = radiance_from_reflectance_factor(jnp.full(DRAWS, rho), "C02")
    draw = jax.jit(lambda x: add_noise(x, noise_deviation(x, "C02"), jax.random.key(3)))
    noisy = draw(radiance)
    error = (noisy - radiance) * np.pi / 1631.3351
    np.testing.assert_allclose(error.std(), np.sqrt(4.8e-4**2 + 1.09e-5 * rho), rtol=SAMPLING)
    assert abs(error.mean()) < 4 * error.std() / np.sqrt(DRAWS)
    # Neighbours draw independently.
    assert abs(np.corrcoef(error[1:], error[:-1])[0, 1]) < 4 / np.sqrt(DRAWS)


def test_draws_of_c07_spread_by_a_tenth_of_a_kelvin_at_300_kelvin():
    @jax.jit
    def draw():
        radiance = in_band_radiance(jnp.full(DRAWS, 300.0), "C07")
        noisy = add_noise(radiance, noise_deviation(radiance, "C07"), jax.random.key(4))
        return brightness_temperature(noisy, "C07")

    temperature = draw()
    np.testing.assert_allclose(temperature.std(), 0.1, rtol=SAMPLING)


def test_noise_of_c07_is_one_radiance_whatever_the_scene():
    # In temperature it grows as T^2 / B, to 5 K at 220 K.
    warm, cold = in_band_radiance(jnp.array([300.0, 220.0]), "C07")
    slope = jax.jit(jax.grad(in_band_radiance), static_argnums=1)(jnp.asarray(220.0), "C07")
    expected = 0.1 * (220 / 300) ** 2 * warm / cold
    np.testing.assert_allclose(noise_deviation(cold, "C07") / slope, expected, rtol=3e-3)


def test_a_key_is_a_draw():
    radiance = jnp.ones(5)
    one, same, other = (add_noise(radiance, 0.1 * radiance, jax.random.key(i)) for i in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert (one != other).all()


def test_every_band_can_be_set():
    noise = eqx.tree_at(lambda n: (n.floor["C03"], n.slope["C03"]), NOISE, (0.01, 0.0))
    radiance = jnp.array([0.0, 100.0])
    expected = radiance_from_reflectance_factor(jnp.full(2, 0.01), "C03")
    np.testing.assert_allclose(noise_deviation(radiance, "C03", noise=noise), expected, rtol=1e-14)
    np.testing.assert_array_equal(
        noise_deviation(radiance, "C02", noise=noise), noise_deviation(radiance, "C02")
    )
    doubled = Noise(temperature_deviation=0.2)
    np.testing.assert_allclose(
        noise_deviation(radiance, "C07", noise=doubled), 2 * noise_deviation(radiance, "C07")
    )


def test_derivatives_are_finite_where_there_is_no_noise():
    silent = Noise(floor={"C01": jnp.asarray(0.0)}, slope={"C01": jnp.asarray(1e-5)})

    def function(radiance, noise):
        return noise_deviation(radiance, "C01", noise=noise)

    both = jax.jit(jax.grad(function, (0, 1)))
    assert both(jnp.asarray(0.0), silent)[0] == 0
    _, gradient = both(jnp.asarray(9.0), silent)
    step = 1e-9
    ends = [
        function(jnp.asarray(9.0), Noise({"C01": 0.0}, {"C01": 1e-5 + sign * step}))
        for sign in (1, -1)
    ]
    np.testing.assert_allclose(gradient.slope["C01"], (ends[0] - ends[1]) / (2 * step), rtol=1e-6)
    assert jnp.isfinite(gradient.floor["C01"])


def test_calibration_error_is_three_percent_of_a_band():
    draw = jax.jit(jax.vmap(lambda key: calibration_gain("C05", key)))
    gains = draw(jax.random.split(jax.random.key(5), DRAWS))
    np.testing.assert_allclose(gains.std(), 0.03, rtol=SAMPLING)
    assert abs(gains.mean() - 1) < 4 * 0.03 / np.sqrt(DRAWS)
    key = jax.random.key(6)
    bands = [float(calibration_gain(f"C0{i}", key)) for i in range(1, 7)]
    assert len(set(bands)) == 6


def test_bands_without_figures_are_named():
    with pytest.raises(ValueError, match="floor is not specified in band 'green', only in.*C01"):
        noise_deviation(jnp.ones(2), "green")
    with pytest.raises(ValueError, match="calibration is not specified in band 'C07'"):
        calibration_gain("C07", jax.random.key(0))


@pytest.mark.float32
@pytest.mark.parametrize("band", ["C02", "C07"])
def test_float32_stays(band):
    radiance = jnp.array([0.0, 0.6], jnp.float32)
    deviation = noise_deviation(radiance, band)
    assert deviation.dtype == jnp.float32 and (deviation > 0).all()
    assert add_noise(radiance, deviation, jax.random.key(1)).dtype == jnp.float32
    assert calibration_gain("C02", jax.random.key(1), dtype=jnp.float32).dtype == jnp.float32
