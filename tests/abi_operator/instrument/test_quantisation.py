"""The counts of L1b files."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.instrument import quantise, range_ceiling
from abi_operator.planck import in_band_radiance, wavenumber_radiance_factor
from abi_operator.satellites import packing

BANDS = ["C02", "C06", "C07"]  # 12, 10 and 14 bits; the last in another unit


def unit(band):
    return wavenumber_radiance_factor(band) if band == "C07" else 1.0


@pytest.mark.parametrize("band", BANDS)
def test_radiance_moves_by_half_a_step_at_most_and_then_no_more(band):
    radiance = jnp.linspace(0, range_ceiling(band), 1001)
    packed = quantise(radiance, band)
    step = packing(band).scale * unit(band)
    assert jnp.abs(packed - radiance).max() <= 0.5001 * step
    np.testing.assert_allclose(quantise(packed, band), packed, rtol=0, atol=1e-12)
    counts = (packed / unit(band) - packing(band).offset) / packing(band).scale
    np.testing.assert_allclose(counts, jnp.round(counts), atol=1e-9)


@pytest.mark.parametrize("band", BANDS)
def test_ends_of_the_range(band):
    ends = quantise(jnp.array([-1e6, 1e6]), band)
    np.testing.assert_allclose(ends[0], packing(band).offset * unit(band), rtol=1e-14)
    np.testing.assert_allclose(ends[1], range_ceiling(band), rtol=1e-14)


def test_step_of_c07_is_a_few_hundredths_of_a_kelvin_at_300_kelvin():
    # 0.001564351 mW m-2 sr-1 (cm-1)-1 over dB/dT, where dB/dT = fk2 B / T^2, B = 0.905.
    slope = jax.grad(in_band_radiance)(jnp.asarray(300.0), "C07")
    step = packing("C07").scale * unit("C07") / slope
    np.testing.assert_allclose(step, 0.001564351 / 0.0371, rtol=2e-3)


def test_derivative_is_zero():
    derivative = jax.vmap(jax.grad(lambda x: quantise(x, "C06")))(jnp.linspace(-3.0, 40.0, 50))
    np.testing.assert_array_equal(derivative, 0)


@pytest.mark.float32
@pytest.mark.parametrize("band", BANDS)
def test_float32_finds_the_same_counts(band):
    counts = np.arange(0, packing(band).highest_count, 7)
    radiance = (counts * packing(band).scale + packing(band).offset) * unit(band)
    packed = quantise(jnp.asarray(radiance, jnp.float32), band)
    assert packed.dtype == jnp.float32
    found = (np.asarray(packed, float) / unit(band) - packing(band).offset) / packing(band).scale
    np.testing.assert_array_equal(np.round(found), counts)


def test_there_is_no_green_band():
    with pytest.raises(ValueError, match="no band 'green'"):
        quantise(jnp.ones(2), "green")
