"""Aerosol beside the plumes: how much there is where, and how light hangs on it."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from states import column

from abi_operator import BANDS, background_aerosol, brf
from abi_operator.optics import background


def air(aod_550=0.1, scale_height=2000.0, levels=(24e3, 8e3, 4e3, 2e3, 1e3, 300.0)):
    """Air over ground at 300 m with a background aerosol."""
    height = jnp.asarray(levels)
    aerosol = background_aerosol(aod_550, scale_height=scale_height, bands=("C01", "C03"))
    return replace(column().atmosphere, height=height, background=aerosol)


def test_the_column_has_its_optical_depth_on_any_levels():
    for levels in ((24e3, 300.0), (24e3, 8e3, 4e3, 2e3, 1e3, 300.0), (5e3, 1e3, 300.0)):
        tau = background(air(levels=levels), BANDS["C03"]).tau
        expected = 0.1 * air().background.relative_extinction["C03"]
        np.testing.assert_allclose(tau.sum(), expected, rtol=1e-12)


def test_it_thins_upwards_by_its_scale_height_above_the_ground():
    """Layers as thick as each other hold the less of it the higher, by one ratio."""
    tau = background(air(levels=tuple(300 + 1000.0 * np.arange(6)[::-1])), BANDS["C01"]).tau[0]
    np.testing.assert_allclose(tau[:-1] / tau[1:], np.exp(-0.5), rtol=1e-12)


def test_levels_at_one_height_hold_none():
    """Nor has that slopes that are no numbers, as 0 / 0 has."""

    def in_layers(height):
        some = replace(air(levels=(300.0, 300.0, 300.0)), height=height)
        return background(some, BANDS["C01"]).tau[0]

    flat = jnp.full(3, 300.0)
    np.testing.assert_array_equal(in_layers(flat), 0)
    assert np.isfinite(jax.jacrev(in_layers)(flat)).all()


def test_its_derivatives_are_finite_and_those_of_the_formula():
    @jax.jit
    def in_layers(aod, scale_height):
        return background(air(aod, scale_height), BANDS["C01"]).tau[0]

    by_aod, by_height = jax.jit(jax.jacfwd(in_layers, (0, 1)))(0.0, 2000.0)
    np.testing.assert_allclose(by_aod, in_layers(1.0, 2000.0), rtol=1e-12)
    np.testing.assert_array_equal(by_height, 0)  # of nothing
    by_height = jax.jit(jax.jacrev(in_layers, 1))(0.1, 2000.0)
    step = 1.0
    central = (in_layers(0.1, 2000.0 + step) - in_layers(0.1, 2000.0 - step)) / (2 * step)
    np.testing.assert_allclose(by_height, central, rtol=1e-5)
    np.testing.assert_allclose(by_height.sum(), 0, atol=1e-15)  # as the column keeps its depth


def test_over_dark_ground_it_brightens_the_blue():
    """0.1 over an albedo of 0.03 adds about 0.01 in C01; as much as the slope says, both ways."""
    clear = column(liquid=0.0, albedo=0.03)
    clear = replace(clear, atmosphere=replace(clear.atmosphere, plumes={}))

    def light(state):
        return brf(state, ("C01", "C03"), num_streams=2, num_doublings=4)  # enough for so little

    def seen(aod):
        aerosol = background_aerosol(aod)
        hazy = replace(clear, atmosphere=replace(clear.atmosphere, background=aerosol))
        return light(hazy)

    none, some = seen(0.0), seen(0.1)
    np.testing.assert_allclose(none, light(clear), rtol=1e-6)
    assert 0.005 < some[0] - none[0] < 0.02
    slope = jax.jacfwd(seen)(0.1)
    np.testing.assert_allclose(slope, (seen(0.101) - seen(0.099)) / 2e-3, rtol=1e-4)
    np.testing.assert_allclose(jax.jacrev(seen)(0.1), slope, rtol=1e-8)


def test_what_cannot_be_is_refused():
    with pytest.raises(ValueError, match="scale_height"):
        background_aerosol(0.1, scale_height=0.0)
    with pytest.raises(ValueError, match="background aerosol"):
        background_aerosol(-0.1)
    with pytest.raises(ValueError, match="not specified in band 'C06'"):
        background(air(), BANDS["C06"])
    with pytest.raises(ValueError, match="has no background aerosol"):
        background(column().atmosphere, BANDS["C01"])
