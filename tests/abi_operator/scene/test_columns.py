"""States of columns, from scenarios of either layout."""

import jax
import numpy as np
import pytest
import xarray as xr

from abi_operator import smoke
from abi_operator.files import InputError
from abi_operator.scene import PlumeSpecification, column_states, scenario, states_of_result

BRIGHTNESS = np.linspace(0, 1, 6).reshape(3, 2)


@pytest.fixture
def made(make_model):
    plumes = {"smoke": PlumeSpecification(smoke(1.2), BRIGHTNESS)}
    return scenario(make_model(), ocean_albedo=0.06, plumes=plumes)


def test_a_state_holds_what_the_scenario_says_of_its_column(made):
    states = column_states(made, ("C01", "C06"))
    state = jax.tree.map(lambda leaf: leaf[3], states)  # y = 1, x = 1
    column = made.isel(y=1, x=1)
    np.testing.assert_array_equal(state.atmosphere.pressure, column["pressure"])
    np.testing.assert_array_equal(state.atmosphere.height, column["height"])
    np.testing.assert_array_equal(state.atmosphere.liquid.mass_path, column["liquid_mass_path"])
    np.testing.assert_array_equal(state.atmosphere.liquid.number_path, column["liquid_number_path"])
    assert list(state.albedo) == ["C01", "C06"]
    np.testing.assert_array_equal(state.albedo["C06"], column["surface_albedo"].sel(band="C06"))
    geometry = state.geometry
    np.testing.assert_allclose(np.degrees(geometry.solar_zenith), column["solar_zenith_angle"])
    np.testing.assert_allclose(np.degrees(geometry.view_zenith), column["view_zenith_angle"])
    relative = np.degrees(geometry.relative_azimuth)
    np.testing.assert_allclose(relative, column["relative_azimuth_angle"])
    plume = state.atmosphere.plumes["smoke"]
    np.testing.assert_allclose(plume.aod_550, 1.2 * BRIGHTNESS[1, 1])
    assert plume.ssa["C06"] == made["smoke_ssa"].sel(band="C06")


def test_a_cloud_scatters_as_the_scenario_or_its_result_says(made):
    def optics(dataset):
        return column_states(dataset, ("C01",)).atmosphere.liquid.optics

    assert optics(made) == "mie"
    assert optics(made.assign_attrs(cloud_optics="mitchell")) == "mitchell"
    assert optics(made.drop_attrs(deep=False)) == "mie"
    with pytest.raises(InputError, match="cloud optics 'fu' are not known"):
        optics(made.assign_attrs(cloud_optics="fu"))


def test_a_state_has_the_gases_temperatures_and_particles_of_the_scenario(make_model):
    ice = {"ice_mixing_ratio": 1e-5, "ice_number_mixing_ratio": 1e5, "surface_temperature": 300.0}
    options = {"ocean_albedo": 0.06, "emissivity": 0.9, "bands": ("C01", "C07")}
    made = scenario(make_model(vapour_mixing_ratio=2e-3, **ice), **options)
    states, column = column_states(made, ("C07",)), made.isel(y=1, x=1)
    state = jax.tree.map(lambda leaf: leaf[3], states)
    gases = state.atmosphere.gases
    for name in ("vapour", "ozone", "carbon_dioxide", "methane", "nitrous_oxide"):
        np.testing.assert_array_equal(getattr(gases, name), column[name])
    np.testing.assert_array_equal(state.atmosphere.temperature, column["temperature"])
    np.testing.assert_array_equal(state.surface_temperature, 300.0)
    np.testing.assert_allclose(state.albedo["C07"], 0.1)
    rough = column_states(made.assign_attrs(ice_optics="rough"), ("C07",))
    assert rough.atmosphere.hydrometeors["ice"].optics == "rough"
    particles = state.atmosphere.hydrometeors
    assert particles["ice"].optics == "fu"
    assert list(particles) == ["ice"]
    np.testing.assert_array_equal(particles["ice"].mass_path, column["ice_mass_path"])
    np.testing.assert_array_equal(particles["ice"].number_path, column["ice_number_path"])
    for leaf in jax.tree.leaves(states):
        assert isinstance(leaf, np.ndarray) and leaf.shape[0] == 6


def test_every_leaf_has_a_leading_column_axis(made):
    for leaf in jax.tree.leaves(column_states(made)):
        assert isinstance(leaf, np.ndarray) and leaf.shape[0] == 6


def test_one_column_dimension_serves_as_well_as_two(made):
    stacked = made.drop_vars("time").stack(column=("y", "x")).reset_index("column")
    one, two = column_states(stacked), column_states(made)
    jax.tree.map(np.testing.assert_array_equal, one, two)


def test_plumes_may_differ_from_column_to_column(made):
    top = xr.DataArray([[3000.0, 3100.0]] * 3, dims=("y", "x"))
    states = column_states(made.assign(smoke_top=top))
    np.testing.assert_array_equal(states.atmosphere.plumes["smoke"].top, top.values.ravel())


def test_unknown_bands_are_refused(made):
    with pytest.raises(ValueError, match="'C04'"):
        column_states(made, ("C04",))


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("relative_azimuth_angle", 1e30, "-360 to 360 degrees"),
        ("solar_zenith_angle", np.nan, "0 to 180 degrees"),
        ("smoke_ssa", 1.5, "0 to 1"),
        ("liquid_mass_path", -1.0, "0 to 10000 kg m-2"),
        ("smoke_top", 1e8, "within the column"),
    ],
)
def test_a_result_with_numbers_of_another_program_is_refused(made, name, value, allowed):
    """In columns as retrievals choose them."""
    y, x = (xr.DataArray(index, dims="column") for index in ([0, 1], [1, 1]))
    wrong = made.assign({name: made[name].astype(float).copy()})
    wrong[name] = xr.where(made["latitude"] == made["latitude"][1, 1], value, wrong[name])
    wrong[name] = wrong[name].transpose(*made[name].dims, ...)
    states_of_result(made.isel(y=y, x=x))
    with pytest.raises(InputError, match=rf"{name} is .*; it must be {allowed}"):
        states_of_result(wrong.isel(y=y, x=x))
