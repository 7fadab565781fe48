"""From a model Dataset to the scenario, and the checks at that door."""

import numpy as np
import pytest

from abi_operator import ash, smoke
from abi_operator.files import InputError
from abi_operator.nomenclature import BY_BAND, OPTIONAL, PLUME, QUALITY_FLAGS, SCENARIO, variable
from abi_operator.scene import PlumeSpecification, scenario
from abi_operator.scene.checks import check_scenario

BRIGHTNESS = np.linspace(0, 1, 6).reshape(3, 2)


@pytest.fixture
def make_scenario(make_model):
    """Builder of a scenario with smoke; keywords as those of `scenario`."""

    def make(model=None, **options):
        plumes = {"smoke": PlumeSpecification(smoke(1.2), BRIGHTNESS)}
        defaults = {"ocean_albedo": 0.06, "plumes": plumes}
        model = make_model(land_mask=None) if model is None else model
        return scenario(model, **(defaults | options))

    return make


def test_a_scenario_has_the_variables_of_the_nomenclature(make_scenario):
    made = make_scenario()
    expected = SCENARIO | {f"smoke_{name}": entry for name, entry in PLUME.items()} | OPTIONAL
    del expected["surface_temperature"]
    assert set(made.variables) == {*expected, *BY_BAND, "time"}
    for name, entry in expected.items():
        assert made[name].dims == entry.dims
        assert made[name].attrs["units"] == entry.units
    assert made.sizes == {"layer": 13, "level": 14, "band": 4, "y": 3, "x": 2}
    assert made["quality_flag"].dtype == np.uint8 and (made["quality_flag"] == 0).all()
    np.testing.assert_allclose(made["smoke_extinction_550"], 1.2 / 2000.0)
    np.testing.assert_allclose(made["smoke_brightness"], BRIGHTNESS)
    assert made.attrs["num_levels_above_model"] == 8
    assert made.attrs["assumed_droplet_number_count"] == 3
    assert made.attrs["assumed_droplet_number"] == "250 cm-3"
    assert made.attrs["assumed_droplet_number_source"] == "as the microphysics morrison does"
    assert made.attrs["model_title"] == "test"


def test_optics_of_the_cloud_are_chosen_by_name(make_scenario):
    assert make_scenario().attrs["cloud_optics"] == "mie"
    assert make_scenario(cloud_optics="mitchell").attrs["cloud_optics"] == "mitchell"
    with pytest.raises(InputError, match="cloud optics 'fu' are not known; choose from mie, mit"):
        make_scenario(cloud_optics="fu")
    assert make_scenario().attrs["ice_optics"] == "fu"
    with pytest.raises(InputError, match="ice optics 'mie' are not known; choose from fu, rough"):
        make_scenario(ice_optics="mie")


def test_cloud_stays_below_the_completed_levels(make_scenario, make_model):
    made, model = make_scenario(), make_model()
    assert (made["liquid_mass_path"][:8] == 0).all()
    assert (made["liquid_mass_path"].values[-2, :, 0] > 0).all()
    np.testing.assert_array_equal(made["height"][8:], model["height"])


def test_a_block_of_rows_is_that_part_of_the_scene(make_scenario, make_model):
    model, whole = make_model(land_mask=None), make_scenario()
    rows = slice(1, 3)
    heights = tuple(whole["height"].values[:8, 0, 0])
    part = make_scenario(model.isel(y=rows), rows=rows, added_heights=heights)
    for name in whole.data_vars:
        expected = whole[name].isel(y=rows) if "y" in whole[name].dims else whole[name]
        np.testing.assert_array_equal(part[name], expected, err_msg=str(name))


def test_columns_without_albedo_are_flagged(make_scenario, make_model):
    flags = make_scenario(make_model())["quality_flag"].values
    assert (flags == QUALITY_FLAGS["no_albedo"] * np.array([[0, 1]] * 3)).all()


def test_hydrometeors_become_paths(make_scenario, make_model):
    ice = {"ice_mixing_ratio": 1e-5, "ice_number_mixing_ratio": 1e5}
    made = make_scenario(make_model(land_mask=None, **ice))
    for name in ("ice_mass_path", "ice_number_path"):
        entry = variable(name)
        assert made[name].dims == entry.dims and made[name].attrs["units"] == entry.units
        assert (made[name][:8] == 0).all() and (made[name][8:] > 0).all()
    assert made.attrs["hydrometeors"] == "cloud; ice" and made.attrs["microphysics"] == "morrison"
    assert made.attrs["unsimulated_condensate_share"] == 0.0
    assert "ice_mass_path" not in make_scenario()


def test_condensate_that_is_not_simulated_is_warned_of(make_scenario, make_model):
    model = make_model(land_mask=None, rain_mixing_ratio=1e-4)
    with pytest.warns(UserWarning, match="rain of the model is not simulated"):
        made = make_scenario(model, hydrometeors=())
    assert 0.1 < made.attrs["unsimulated_condensate_share"] < 0.95
    assert made.attrs["unsimulated_condensate"] == "rain"


def test_only_gases_and_emission_need_temperatures(make_scenario):
    paper = make_scenario(gases=())
    assert set(OPTIONAL).isdisjoint(paper.variables) and paper.attrs["gases"] == "none"
    some = make_scenario(gases=("O3", "H2O"))
    assert set(OPTIONAL) - set(some.variables) == {"surface_temperature"}
    assert some.attrs["gases"] == "O3 H2O"
    assert some.attrs["standard_atmosphere"] == "midlatitude_winter"


def test_c07_needs_the_temperature_of_the_ground(make_scenario, make_model):
    options = {"bands": ("C01", "C07"), "emissivity": 0.9, "gases": (), "plumes": None}
    model = make_model(land_mask=None, surface_temperature=301.0)
    made = make_scenario(model, **options)
    assert (made["surface_temperature"] == 301.0).all() and "vapour" not in made
    np.testing.assert_allclose(made["surface_albedo"].sel(band="C07"), 0.1)
    with pytest.warns(UserWarning, match="no temperature of the ground"):
        made = make_scenario(**options)
    np.testing.assert_array_equal(made["surface_temperature"], made["temperature"][-1])


def test_a_satellite_stands_where_it_stands(make_scenario):
    east, west = make_scenario(), make_scenario(satellite="GOES-18")
    assert (west.attrs["satellite"], west.attrs["satellite_longitude"]) == ("GOES-18", -137.0)
    assert not np.allclose(east["view_zenith_angle"], west["view_zenith_angle"], atol=1)
    moved = make_scenario(satellite="GOES-18", satellite_longitude=-75.2)
    np.testing.assert_array_equal(moved["view_zenith_angle"], east["view_zenith_angle"])


def test_absorption_that_is_not_known_is_refused(make_scenario):
    options = {"satellite": "GOES-19", "bands": ("C04",), "plumes": None}
    with pytest.raises(InputError, match="absorption by gases in C04 is not known of GOES-19"):
        make_scenario(**options)
    assert make_scenario(**options, gases=()).attrs["satellite"] == "GOES-19"


def test_plumes_of_two_species(make_scenario):
    plumes = {
        "smoke": PlumeSpecification(smoke(1.0), BRIGHTNESS),
        "ash": PlumeSpecification(ash(0.5, brightness=0.5), BRIGHTNESS),
    }
    made = make_scenario(plumes=plumes)
    np.testing.assert_allclose(made["ash_brightness"], 0.5 * BRIGHTNESS)
    assert made["ash_ssa"].sizes == {"band": 4}


def test_plumes_are_specified_by_scalars(make_scenario):
    plumes = {"smoke": PlumeSpecification(smoke(np.ones(3)), BRIGHTNESS)}
    with pytest.raises(ValueError, match="the plume 'smoke' is specified by scalars"):
        make_scenario(plumes=plumes)


def test_plumes_must_have_the_bands(make_scenario):
    plumes = {"smoke": PlumeSpecification(smoke(bands=("C01",)), BRIGHTNESS)}
    with pytest.raises(
        InputError, match=r"of the plume 'smoke' lacks bands \['C02', 'C03', 'C06'\]"
    ):
        make_scenario(plumes=plumes)


@pytest.mark.parametrize(
    ("name", "place", "value", "message"),
    [
        (
            "pressure",
            {"level": 9},
            np.nan,
            r"pressure is nan at level=9, y=6, x=1; .* 0 or more and below .* Pa",
        ),
        ("pressure", {"level": 9}, 1.0, "pressure is 1 at level=9, .* than in the level above"),
        ("height", {"level": 9}, 9.9e4, "height is 99000 at level=9, .* than in the level above"),
        ("liquid_mass_path", {"layer": 11}, -1.0, "liquid_mass_path is -1 .* 0 to 10000 kg m-2"),
        (
            "liquid_mass_path",
            {"layer": 11},
            1.0,
            "number_path is 0 .* positive where there is mass",
        ),
        (
            "liquid_number_path",
            {"layer": 11},
            np.inf,
            "liquid_number_path is inf .* 0 or more and below .* m-2",
        ),
        (
            "surface_albedo",
            {"band": 2},
            1.01,
            r"surface_albedo is 1.01 at band=2, y=6, x=1; .* 0 to 1",
        ),
        ("surface_albedo", {"band": 2}, np.nan, "surface_albedo is nan"),
        ("smoke_brightness", {}, 1.2, r"smoke_brightness is 1.2 at y=6, x=1; it must be 0 to 1"),
        (
            "temperature",
            {"level": 9},
            20.0,
            "temperature is 20 at level=9, .* must be 100 to 500 K",
        ),
        (
            "vapour",
            {"layer": 11},
            -1.0,
            "vapour is -1 at layer=11, .* 0 or more and below .* kg m-2",
        ),
        ("latitude", {}, np.nan, "latitude is nan at y=6, x=1; it must be -90 to 90"),
        ("latitude", {}, -999.0, "latitude is -999 at y=6, x=1; it must be -90 to 90 degrees"),
        ("liquid_mass_path", {"layer": 11}, 1e20, "liquid_mass_path is 1e.20 .* 0 to 10000 kg m-2"),
    ],
)
def test_values_are_checked_and_named(make_scenario, name, place, value, message):
    made = make_scenario()
    made[name][place | {"y": 1, "x": 1}] = value
    with pytest.raises(InputError, match=message):
        check_scenario(made, first_row=5)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("smoke_ssa", 1.5, "smoke_ssa is 1.5 at band=0; it must be 0 to 1"),
        ("smoke_base", -1.0, "smoke_base is -1; it must be 0 or more and below .* m"),
        ("smoke_top", 500.0, "smoke_top is 500; it must be above the plume's base"),
        ("smoke_top", 81e3, r"smoke_top is 81000 at y=0, x=0; .* column, which is 79940 m deep"),
    ],
)
def test_plumes_are_checked_and_named(make_scenario, name, value, message):
    made = make_scenario()
    made[name] = made[name] * 0 + value
    with pytest.raises(InputError, match=message):
        check_scenario(made)


def test_missing_albedo_is_no_error_where_it_is_flagged(make_scenario, make_model):
    made = make_scenario(make_model())
    assert np.isnan(made["surface_albedo"]).any()
    check_scenario(made)


def test_small_negative_numbers_of_the_model_are_told(make_scenario, make_model):
    model = make_model()
    told = {"num_negative_set_to_zero": 2, "smallest_negative": -1e-9}
    model["vapour_mixing_ratio"].attrs |= told
    made = make_scenario(model)
    assert made.attrs["negative_vapour_mixing_ratio_count"] == 2
    assert made.attrs["smallest_negative_vapour_mixing_ratio"] == -1e-9
