"""Brightness at known reflectances, NaN, floating types and derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.products import (
    cimss_stretch,
    cira_stretch,
    crefl_stretch,
    jma_true_color,
    natural_color,
)

ROUNDING = 1e-12
STRETCHES = (cira_stretch, cimss_stretch, crefl_stretch)


@pytest.mark.parametrize(
    ("stretch", "reflectance", "shown"),
    [
        (cira_stretch, 0.0223, 0.0),
        (cira_stretch, 1.0, -np.log10(0.0223) / (0.75 * (1 - np.log10(0.0223)))),
        (cira_stretch, 5.0, 1.0),
        # A quarter of the brightest has the root 1/2, the fixed point of the contrast.
        (cimss_stretch, 0.3, 0.5),
        (cimss_stretch, 0.6, 259 * 1.1 / (259 - 25.5) * (np.sqrt(0.5) - 0.5) + 0.5),
        (cimss_stretch, 0.0179, 0.0),
        (cimss_stretch, 1.2, 1.0),
        (cimss_stretch, -0.1, 0.0),
        (crefl_stretch, 0.0, 0.0),
        (crefl_stretch, 25 / 255, 90 / 255),
        (crefl_stretch, 40 / 255, 115 / 255),
        (crefl_stretch, 100 / 255, 175 / 255),
        (crefl_stretch, 1.0, 1.0),
        (crefl_stretch, 1.3, 1.0),
        (crefl_stretch, -0.1, 0.0),
    ],
)
def test_brightness_at_known_reflectances(stretch, reflectance, shown):
    np.testing.assert_allclose(stretch(np.full(2, reflectance)), shown, rtol=ROUNDING, atol=1e-15)


def test_lines_are_those_of_numpy():
    reflectance = np.linspace(-0.2, 1.2, 101)
    expected = np.interp(255 * reflectance, [0, 25, 55, 100, 255], [0, 90, 140, 175, 255]) / 255
    np.testing.assert_allclose(crefl_stretch(reflectance), expected, atol=ROUNDING)


@pytest.mark.parametrize("stretch", STRETCHES)
def test_stretches_grow_within_0_and_1_and_keep_nan(stretch):
    shown = stretch(np.linspace(-0.5, 5, 500))
    assert shown.min() == 0 and shown.max() == 1 and np.diff(shown).min() >= 0
    assert np.isnan(stretch(np.array([np.nan]))).all()


@pytest.mark.parametrize("stretch", STRETCHES)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_numpy_and_jax_agree_in_both_precisions(stretch, dtype):
    reflectance = np.linspace(-0.1, 4.1, 40).astype(dtype)
    ours, jaxs = stretch(reflectance), stretch(jnp.asarray(reflectance))
    assert ours.dtype == dtype and jaxs.dtype == dtype
    np.testing.assert_allclose(jaxs, ours, atol=4 * np.finfo(dtype).eps)


@pytest.mark.parametrize("stretch", STRETCHES)
def test_derivatives_are_those_of_differences_and_finite_where_it_clips(stretch):
    slope = jax.jit(jax.vmap(jax.grad(stretch)))
    where, step = jnp.array([0.06, 0.18, 0.3, 0.7]), 1e-6
    expected = (stretch(where + step) - stretch(where - step)) / (2 * step)
    np.testing.assert_allclose(slope(where), expected, rtol=1e-6)
    np.testing.assert_array_equal(slope(jnp.array([-1.0, 6.0])), 0)
    assert np.isfinite(slope(jnp.array([0.0, 1.2]))).all()


def test_matrix_of_goes16():
    colours = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.2, 0.2, 0.2]])
    shown = jma_true_color(colours)
    np.testing.assert_allclose(shown[0], [1.1425, -0.0951, -0.0113], rtol=ROUNDING)
    np.testing.assert_allclose(shown[1], [0.1819, 0.9363, -0.1179], rtol=ROUNDING)
    np.testing.assert_allclose(shown[2], [0.2 * 1.0994, 0.2 * 0.9772, 0.2 * 0.9329], rtol=ROUNDING)
    np.testing.assert_allclose(jma_true_color(jnp.asarray(colours)), shown, rtol=ROUNDING)
    with pytest.raises(ValueError, match=r"red, green and blue on the last axis; got \(3, 2\)"):
        jma_true_color(np.zeros((3, 2)))


def test_a_picture_takes_any_enhancement():
    brf = {"C01": np.full((1, 2), 0.2), "C02": np.full((1, 2), 0.3), "C03": np.full((1, 2), 0.4)}
    plain = natural_color(brf, enhancement=lambda x: x)
    np.testing.assert_array_equal(
        natural_color(brf, enhancement=crefl_stretch), crefl_stretch(plain)
    )
    np.testing.assert_array_equal(natural_color(brf), cira_stretch(plain))
    reproduced = natural_color(brf, enhancement=lambda x: cira_stretch(jma_true_color(x)))
    np.testing.assert_array_equal(reproduced, cira_stretch(jma_true_color(plain)))
