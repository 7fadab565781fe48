"""Temperature and gases from the ground to the top of the atmosphere."""

import numpy as np
import pytest
import xarray as xr

from abi_operator import standard_atmosphere
from abi_operator.files import InputError
from abi_operator.optics import ALL_GASES
from abi_operator.scene import gases_of, nearest_standard_atmosphere
from abi_operator.scene.column_air import dry_air_path
from abi_operator.scene.gases import (
    check_gases,
    gas_amounts,
    gases_attribute,
    level_temperature,
)
from abi_operator.scene.standard_profile import standard_profile

ROUNDING = 1e-12
TROPICAL = standard_profile("tropical")
ABOVE = np.array([80e3, 30e3, 12e3])  # heights of added levels [m]


def completed(model):
    """Heights of a model's levels under three that are added."""
    own = model["height"].values
    added = np.broadcast_to(ABOVE[:, None, None], (3, *own.shape[1:]))
    return np.concatenate([added, own])


def test_the_table_of_a_standard_atmosphere_is_that_atmosphere():
    """Amounts are exact at the published levels, and linear over 20 m elsewhere."""
    height = np.array([100e3, 20e3, 5e3, 1e3, 0.0])
    air = standard_atmosphere("tropical", height)
    np.testing.assert_allclose(TROPICAL.ozone_between(height), air.gases.ozone, rtol=1e-9)
    np.testing.assert_allclose(TROPICAL.vapour_between(height), air.gases.vapour, rtol=1e-9)
    np.testing.assert_allclose(TROPICAL.temperature_at(height), air.temperature, rtol=ROUNDING)
    between = np.array([11.234e3, 2.345e3, 0.456e3])
    air = standard_atmosphere("tropical", between)
    np.testing.assert_allclose(TROPICAL.vapour_between(between), air.gases.vapour, rtol=1e-4)
    assert TROPICAL.carbon_dioxide == pytest.approx(400e-6)


def test_temperature_that_is_linear_in_height_is_so_at_every_level(make_model):
    model = make_model()
    own = model["height"].values
    middle = (own[1:] + own[:-1]) / 2
    model["layer_temperature"][:] = 300.0 - 6.5e-3 * middle
    levels = level_temperature(model, completed(model), TROPICAL)
    np.testing.assert_allclose(levels[3:], 300.0 - 6.5e-3 * own, rtol=ROUNDING)


def test_temperature_passes_into_the_standard_atmosphere(make_model):
    model = make_model()  # isothermal, 270 K
    height = completed(model)
    levels = level_temperature(model, height, TROPICAL)
    difference = 270.0 - TROPICAL.temperature_at(model["height"].values[0])
    fading = np.exp(-(height[:3] - model["height"].values[0]) / 5e3)
    expected = TROPICAL.temperature_at(height[:3]) + difference * fading
    np.testing.assert_allclose(levels[:3], expected, rtol=ROUNDING)
    assert np.abs(difference).min() > 20
    np.testing.assert_allclose(levels[0], TROPICAL.temperature_at(80e3), atol=1e-4)


def test_gases_are_the_models_below_and_the_standards_above(make_model):
    model = make_model(vapour_mixing_ratio=2e-3)
    height = completed(model)
    amounts = gas_amounts(model, height, TROPICAL)
    own = dry_air_path(model) * 2e-3
    np.testing.assert_allclose(amounts["vapour"][3:], own, rtol=ROUNDING)
    published = TROPICAL.vapour_between(height)
    share = own[0] / published[3]
    np.testing.assert_allclose(amounts["vapour"][:3], share * published[:3], rtol=ROUNDING)
    column = amounts["ozone"].sum(axis=0)
    ground = model["height"].values[-1]
    assert (np.diff(column[:, 0]) < 0).all() and (ground[:, 0] == [0, 30, 60]).all()
    np.testing.assert_allclose(column[0], 282, atol=1)  # Dobson units, whole tropical column
    assert all(np.ndim(amounts[name]) == 0 for name in ("carbon_dioxide", "methane"))


def test_dry_air_stays_dry_above(make_model):
    amounts = gas_amounts(make_model(), completed(make_model()), TROPICAL)
    assert (amounts["vapour"] == 0).all()


@pytest.mark.parametrize(
    ("latitude", "time", "name"),
    [
        ((22.0, 26.0), "2005-08-28", "tropical"),
        ((32.0, 35.0), "2007-10-23", "midlatitude_winter"),
        ((40.0, 45.0), "2007-07-01", "midlatitude_summer"),
        ((-45.0, -40.0), "2007-07-01", "midlatitude_winter"),
        ((-45.0, -40.0), "2007-12-31", "midlatitude_summer"),
    ],
)
def test_the_nearest_standard_atmosphere_is_that_of_latitude_and_season(latitude, time, name):
    assert nearest_standard_atmosphere(np.array(latitude), np.datetime64(time, "ns")) == name


def test_gases_are_named_by_an_attribute():
    with_vapour = xr.Dataset({"vapour": 0.0})
    assert gases_of(with_vapour) == ALL_GASES and gases_of(xr.Dataset()) == ()
    for gases in ((), ("O3",), ("H2O", "CO2")):
        assert gases_of(with_vapour.assign_attrs(gases=gases_attribute(gases))) == gases
    with pytest.raises(InputError, match=r"gases \['SO2'\] are not known; choose from O3, H2O"):
        check_gases(("O3", "SO2"))
