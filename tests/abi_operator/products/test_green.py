"""Recipes of the derived green, and the order of green and correction."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.products import (
    GREEN_RECIPES,
    corrected_colors,
    derived_green,
    hybrid_green,
    natural_color,
)

ROUNDING = 1e-12
RED, BLUE, NIR = 0.1, 0.2, 0.4


@pytest.mark.parametrize(
    ("recipe", "expected"),
    [
        ("grasso2013", 0.0416 + 0.1046 + 0.026 - 0.005),
        ("satpy", 0.0465 + 0.093 + 0.028),
        ("bah2018", 0.045 + 0.09 + 0.04),
        ("edc", 0.048358168 + 0.091413892 + 0.024152548),
    ],
)
def test_recipes_by_hand(recipe, expected):
    green = derived_green(np.array(RED), np.array(BLUE), np.array(NIR), recipe=recipe)
    np.testing.assert_allclose(green, expected, rtol=ROUNDING)


def test_weights_sum_to_one_or_nearly():
    for name, recipe in GREEN_RECIPES.items():
        total = recipe.red + recipe.blue + recipe.near_infrared
        assert total == pytest.approx(
            {"grasso2013": 1.004, "edc": 1.00103251}.get(name, 1.0), abs=1e-9
        )
        assert (recipe.constant != 0) == (name == "grasso2013")


def test_unknown_names_are_refused():
    brf = dict.fromkeys(("C01", "C02", "C03"), np.zeros((1, 1)))
    with pytest.raises(ValueError, match="no green recipe 'lime'.*grasso2013.*bah2018"):
        derived_green(np.zeros(1), np.zeros(1), np.zeros(1), recipe="lime")
    with pytest.raises(ValueError, match="no green recipe 'lime'"):
        natural_color(brf, recipe="lime")
    with pytest.raises(ValueError, match="no order 'both'.*green_first"):
        corrected_colors(brf, None, "both")


def test_hybrid_green_mixes_two_bands():
    green = hybrid_green(np.array(0.2), np.array(0.6))
    np.testing.assert_allclose(green, 0.85 * 0.2 + 0.15 * 0.6, rtol=ROUNDING)
    np.testing.assert_allclose(hybrid_green(np.array(0.2), np.array(0.6), fraction=0.0), 0.2)


def haze(band, brf):
    """A correction that is one straight line a band."""
    path, slope = {"C01": (0.1, 1.2), "green": (0.05, 1.1), "C02": (0.03, 1.05), "C03": (0, 1)}[
        band
    ]
    return (brf - path) * slope


def test_orders_by_hand():
    brf = {"C01": np.array([BLUE]), "C02": np.array([RED]), "C03": np.array([NIR])}
    red, blue = 0.07 * 1.05, 0.1 * 1.2
    top = 0.416 * RED + 0.523 * BLUE + 0.065 * NIR - 0.005
    expected = {
        "green_first": (top - 0.05) * 1.1,
        "correct_first": 0.416 * red + 0.523 * blue + 0.065 * NIR - 0.005,
    }
    for order, green in expected.items():
        colours = corrected_colors(brf, haze, order)
        np.testing.assert_allclose(colours, [[red, green, blue]], rtol=ROUNDING)
    np.testing.assert_array_equal(
        corrected_colors(brf, haze), corrected_colors(brf, haze, "green_first")
    )


def test_each_band_is_corrected_once():
    brf = dict.fromkeys(("C01", "C02", "C03"), np.full((2, 2), 0.3))
    asked = []
    for order in ("green_first", "correct_first"):
        corrected_colors(brf, lambda band, x: (asked.append(band), x)[1], order)
    assert sorted(asked[:3]) == ["C01", "C02", "green"]
    assert sorted(asked[3:]) == ["C01", "C02", "C03"]


def test_without_correction_the_orders_agree():
    brf = {"C01": np.array([BLUE]), "C02": np.array([RED]), "C03": np.array([NIR])}
    first, last = (corrected_colors(brf, None, x) for x in ("green_first", "correct_first"))
    np.testing.assert_array_equal(first, last)


def test_derivative_of_the_picture_before_enhancement():
    """By C03 it is the weight, times the slope of the correction where green is first."""

    def green(near_infrared, order):
        brf = {"C01": jnp.array(BLUE), "C02": jnp.array(RED), "C03": near_infrared}
        return corrected_colors(brf, haze, order)[1]

    for order, slope in (("green_first", 1.1), ("correct_first", 1.0)):
        found = jax.grad(green)(jnp.array(NIR), order)
        np.testing.assert_allclose(found, 0.065 * slope, rtol=ROUNDING)


def test_float32_stays():
    brf = {band: jnp.full((2, 2), 0.3, jnp.float32) for band in ("C01", "C02", "C03")}
    assert corrected_colors(brf, haze).dtype == jnp.float32
    assert natural_color(brf, correction=haze, recipe="satpy").dtype == jnp.float32
