"""Pressure from the ground to the top of the atmosphere."""

import numpy as np
import pytest

from abi_operator.constants import DRY_AIR_GAS_CONSTANT, GRAVITY
from abi_operator.files import InputError
from abi_operator.scene import completion_heights, highest_top
from abi_operator.scene.column_air import (
    complete_air,
    dry_air_path,
    level_pressure,
    virtual_temperature,
)
from abi_operator.scene.standard_atmosphere import standard_pressure

ROUNDING = 1e-12
# Those of the model that the builder makes. [Pa], [K]
SURFACE_PRESSURE, TEMPERATURE = 100000.0, 270.0


def test_isothermal_air_is_exponential_at_every_level(make_model):
    """Linear interpolation of log pressure, and both extrapolations, are exact there."""
    scale_height = DRY_AIR_GAS_CONSTANT * TEMPERATURE / GRAVITY
    for model in (make_model(), make_model(surface_pressure=None)):
        expected = SURFACE_PRESSURE * np.exp(-model["height"].values / scale_height)
        np.testing.assert_allclose(level_pressure(model), expected, rtol=ROUNDING)


def test_the_models_surface_pressure_is_taken(make_model):
    model = make_model(surface_pressure=100500.0)
    np.testing.assert_array_equal(level_pressure(model)[-1], 100500.0)


def test_moist_air_is_extrapolated_with_its_virtual_temperature(make_model):
    model = make_model(surface_pressure=None, vapour_mixing_ratio=0.01)
    virtual = TEMPERATURE * (1 + 0.01 * 461.6 / 287.0) / 1.01
    np.testing.assert_allclose(virtual_temperature(model), virtual, rtol=ROUNDING)
    depth = (model["height"][-2] - model["height"][-1]).values / 2
    expected = model["layer_pressure"].values[-1] * np.exp(9.81 * depth / (287.0 * virtual))
    np.testing.assert_allclose(level_pressure(model)[-1], expected, rtol=ROUNDING)


def test_completed_columns_hold_all_air_above_the_ground(make_model):
    model = make_model()
    heights = completion_heights(highest_top(model))
    pressure, height, top_pressure = complete_air(model, heights)
    assert pressure.shape == (6 + len(heights), 3, 2) == height.shape
    np.testing.assert_allclose(
        np.diff(pressure, axis=0).sum(axis=0), model["surface_pressure"], rtol=ROUNDING
    )
    assert (pressure[0] == 0).all() and (np.diff(pressure, axis=0) > 0).all()
    assert (np.diff(height, axis=0) < 0).all()
    np.testing.assert_array_equal(top_pressure, pressure[len(heights)])


def test_completion_is_continuous_at_the_models_top(make_model):
    """A level added just above the top has the pressure of the top."""
    model = make_model()
    top = highest_top(model)
    pressure, _, top_pressure = complete_air(model, (80e3, top + 1e-3))
    np.testing.assert_allclose(pressure[1, -1], top_pressure[-1], rtol=1e-6)
    ratio = standard_pressure(20e3) / standard_pressure(model["height"].values[0])
    pressure = complete_air(model, (80e3, 20e3))[0]
    np.testing.assert_allclose(pressure[1], top_pressure * ratio, rtol=ROUNDING)


def test_levels_are_added_well_above_the_highest_column():
    assert completion_heights(9060.0) == (80e3, 50e3, 30e3, 20e3, 15e3, 12e3, 11e3, 10e3)
    assert completion_heights(9499.0)[-1] == 10e3
    assert completion_heights(9501.0)[-1] == 11e3
    assert completion_heights(20.4e3) == (80e3, 50e3, 30e3)
    assert completion_heights(85e3) == ()


def test_a_model_that_reaches_space_needs_no_level(make_model):
    pressure, height, _ = complete_air(make_model(), ())
    assert len(pressure) == 6 == len(height) and (pressure[0] == 0).all()


def test_added_levels_lie_above_every_column(make_model):
    with pytest.raises(InputError, match="top is at 9060 m, above the level to be added at 9030 m"):
        complete_air(make_model(), (80e3, 9030.0))


def test_dry_air_weighs_its_hydrostatic_pressure(make_model):
    """Without vapour, in thin layers: g times the mass is the difference of pressure."""
    model = make_model()
    weight = GRAVITY * dry_air_path(model)
    trapezoid = 0.011  # of a layer 3 km thick: (dz / H)^2 / 24, H = 7.9 km
    np.testing.assert_allclose(weight, np.diff(level_pressure(model), axis=0), rtol=trapezoid)
