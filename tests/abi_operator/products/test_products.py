"""Derived green and natural colour, for arrays of NumPy and of JAX."""

import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.products import derived_green, natural_color

ROUNDING = 1e-12


def test_green_is_the_published_sum():
    """Eq. (1) of Grasso et al. (2013), by hand."""
    red, blue, near_infrared = np.array([0.1]), np.array([0.2]), np.array([0.4])
    green = derived_green(red, blue, near_infrared)
    np.testing.assert_allclose(green, 0.0416 + 0.1046 + 0.026 - 0.005, rtol=ROUNDING)


@pytest.mark.parametrize(
    ("reflectance", "shown", "digit"),
    [
        (0.0223, 0.0, 1e-12),
        (0.80, 0.782, 5e-4),
        (1.0, 0.831, 5e-4),
        (0.0, 0.0, 0.0),
        (9.0, 1.0, 0.0),
    ],
)
def test_stretch_at_known_reflectances(reflectance, shown, digit):
    """Values of CIRA's stretch, as satpy computes it; red and blue are stretched as they are."""
    rgb = natural_color({band: np.full((2, 3), reflectance) for band in ("C01", "C02", "C03")})
    assert rgb.shape == (2, 3, 3)
    np.testing.assert_allclose(rgb[..., [0, 2]], shown, atol=digit)


def test_colours_are_in_order():
    brf = {"C01": np.array([[0.1]]), "C02": np.array([[0.3]]), "C03": np.array([[0.5]])}
    red, green, blue = natural_color(brf)[0, 0]
    expected = derived_green(brf["C02"], brf["C01"], brf["C03"])
    grey = natural_color(dict.fromkeys(brf, expected))[0, 0, 0]
    assert red > green > blue
    np.testing.assert_allclose(green, grey, rtol=ROUNDING)


def test_numpy_and_jax_agree_and_nan_stays():
    brf = {band: np.array([[0.02, 0.2, np.nan]]) for band in ("C01", "C02", "C03")}
    numpy_rgb = natural_color(brf)
    jax_rgb = natural_color({band: jnp.asarray(values) for band, values in brf.items()})
    assert isinstance(numpy_rgb, np.ndarray) and isinstance(jax_rgb, jnp.ndarray)
    np.testing.assert_allclose(jax_rgb, numpy_rgb, rtol=ROUNDING)
    assert np.isnan(numpy_rgb[0, 2]).all() and np.isfinite(numpy_rgb[0, :2]).all()
