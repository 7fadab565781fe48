"""The test of Grasso et al. (2013): the near infrared 10 % brighter and darker."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.products import derived_green, green_change, nir_test

ROUNDING = 1e-12
HALF_A_DIGIT = 5e-5  # of the figures below, in per cent with two decimals


@pytest.mark.parametrize(
    ("colours", "increase", "decrease"),
    [
        # Grey, opaque ash: all bands alike.
        ((0.30, 0.30, 0.30), 0.0065, -0.0066),
        # Thin ash over vegetation, NIR / G = 3.94, and over dry plains, 1.95.
        ((0.0845, 0.0845, 0.3942), 0.0250, -0.0263),
        ((0.1500, 0.1250, 0.2739), 0.0125, -0.0128),
    ],
)
def test_figures_of_typical_pixels(colours, increase, decrease):
    found = nir_test(*(np.array(x) for x in colours))
    np.testing.assert_allclose(found.increase, increase, atol=HALF_A_DIGIT)
    np.testing.assert_allclose(found.decrease, decrease, atol=HALF_A_DIGIT)


def test_closed_form_and_the_decrease_is_larger():
    """Equal steps cannot give +2.5 % and -1.5 % at one pixel, whatever its colours."""
    red, blue, near_infrared = np.random.default_rng(1).uniform(0.02, 0.8, (3, 200))
    found = nir_test(red, blue, near_infrared)
    x = 0.1 * 0.065 * near_infrared / derived_green(red, blue, near_infrared)
    np.testing.assert_allclose(found.increase, x / (1 + x), rtol=1e-10)
    np.testing.assert_allclose(found.decrease, -x / (1 - x), rtol=1e-10)
    assert (-found.decrease > found.increase).all()


def test_no_change_and_other_recipes():
    red, blue, near_infrared = np.array(0.1), np.array(0.2), np.array(0.4)
    assert green_change(red, blue, near_infrared, 1.0) == 0
    changed = green_change(red, blue, near_infrared, 1.5, recipe="bah2018")
    np.testing.assert_allclose(changed, 0.02 / (0.045 + 0.09 + 0.06), rtol=ROUNDING)


def test_derivative_and_float32():
    slope = jax.grad(lambda f: green_change(0.1, 0.2, 0.4, f))(1.0)
    np.testing.assert_allclose(slope, 0.026 / 0.1672, rtol=ROUNDING)
    assert nir_test(*jnp.full((3, 2), 0.2, jnp.float32)).increase.dtype == jnp.float32
