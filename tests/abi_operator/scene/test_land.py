"""Land where there is no albedo file, and its emissivity by land use."""

import numpy as np
import pytest

from abi_operator.files import InputError
from abi_operator.scene import check_emissivity, check_ground
from abi_operator.scene.albedo import surface_albedo
from abi_operator.surface import EMISSIVITY_3900NM, LAND_USE

BANDS = ("C01", "C03")
SEA, LAND = 0, 1  # columns of the model

MODIS = "MODIFIED_IGBP_MODIS_NOAH"


def test_land_without_a_file_has_the_albedo_of_last_resort(make_model):
    values, found = surface_albedo(make_model(), BANDS, None, 0.06, land_albedo=0.2)
    np.testing.assert_allclose(values, [[[0.06, 0.2]] * 3] * 2)
    assert found["surface_albedo_source"] == "water 0.06; land without any other 0.2"
    assert found["last_resort_albedo_count"] == 3


def test_water_does_not_have_it(make_model):
    values, _ = surface_albedo(make_model(), BANDS, None, None, land_albedo=0.2)
    assert np.isnan(values[..., SEA]).all() and (values[..., LAND] == 0.2).all()
    values, _ = surface_albedo(make_model(land_mask=None), BANDS, None, None, land_albedo=0.2)
    assert (values == 0.2).all()


@pytest.mark.parametrize("water", [{"ocean_albedo": 0.06}, {"ocean_wind": 5.0}])
@pytest.mark.parametrize("with_file", [True, False])
def test_land_and_water_are_told_apart_by_a_mask(make_model, make_albedo, water, with_file):
    """Without one all that the file lacks was water, and land had no albedo of last resort."""
    file = make_albedo() if with_file else None
    words = {"ocean_albedo": None} | water | {"land_albedo": 0.2}
    with pytest.raises(InputError, match="no land mask .* albedo of land or one of water, not bot"):
        check_ground(make_model(land_mask=None), BANDS, file, **words)
    check_ground(make_model(), BANDS, file, **words)
    check_ground(make_model(land_mask=None), ("C07",), file, emissivity=0.9, **words)


def test_the_file_comes_first(make_model, make_albedo):
    albedo = make_albedo()
    albedo["surface_albedo"][0, ..., 2] = np.nan  # C01, -116.9 E
    known, _ = surface_albedo(make_model(), BANDS, make_albedo(), 0.06)
    values, found = surface_albedo(make_model(), BANDS, albedo, 0.06, land_albedo=0.5)
    assert (values[0, :, LAND] == 0.5).all()
    np.testing.assert_array_equal(values[1], known[1])
    assert found["last_resort_albedo_count"] == 3


def test_land_that_the_file_does_not_reach_has_it(make_model, make_albedo):
    albedo = make_albedo(lat=(33.0, 32.8))  # to 33.1 N
    check_ground(make_model(), BANDS, albedo, 0.06, land_albedo=0.5)
    values, _ = surface_albedo(make_model(), BANDS, albedo, 0.06, land_albedo=0.5)
    np.testing.assert_allclose(values[0, :, LAND], [0.3, 0.3, 0.5])


def test_the_models_albedo_is_warned_of(make_model):
    model = make_model(broadband_albedo=[[0.08, 0.2], [0.08, 0.25], [0.08, 0.3]])
    with pytest.warns(UserWarning, match="the model's, which is one for all sunlight"):
        values, found = surface_albedo(model, BANDS, None, 0.06, land_albedo="model")
    np.testing.assert_allclose(values, [[[0.06, 0.2], [0.06, 0.25], [0.06, 0.3]]] * 2)
    assert found["surface_albedo_source"].endswith("land without any other the model's broadband")


@pytest.mark.parametrize(
    ("albedo", "message"),
    [
        (1.2, "the albedo of land is 1.2; it must be 0 to 1"),
        ("forest", "no albedo of land is known by the name of 'forest'; name a number, or 'model'"),
        ("model", "the model has no albedo of its own"),
    ],
)
def test_an_albedo_of_land_that_is_none_is_refused(make_model, albedo, message):
    with pytest.raises(InputError, match=message):
        surface_albedo(make_model(), BANDS, None, 0.06, land_albedo=albedo)


@pytest.mark.parametrize("scheme", LAND_USE)
def test_all_categories_are_types_of_surface(scheme):
    assert set(LAND_USE[scheme].values()) <= set(EMISSIVITY_3900NM)
    assert set(range(1, 21)) <= set(LAND_USE[scheme])


def test_each_column_has_the_emissivity_of_its_land_use(make_model):
    model = make_model(land_use=[[17, 10], [17, 16], [17, 1]]).assign_attrs(land_use_scheme=MODIS)
    values, found = surface_albedo(model, ("C07",), None, None, "land-use")
    water, *types = (EMISSIVITY_3900NM[x] for x in ("water", "grassland", "bare"))
    forest = EMISSIVITY_3900NM["evergreen needleleaf forest"]
    np.testing.assert_allclose(1 - values[0], [[water, x] for x in (*types, forest)])
    assert found["emissivity_source"] == f"by land use ({MODIS}) over land, 0.978 over water"


def test_the_same_number_is_another_use_in_another_scheme(make_model):
    uses = make_model(land_use=16.0, land_mask=None)
    for scheme, name in (("USGS", "water"), (MODIS, "bare")):
        model = uses.assign_attrs(land_use_scheme=scheme)
        values, _ = surface_albedo(model, ("C07",), None, None, "land-use")
        np.testing.assert_allclose(1 - values, EMISSIVITY_3900NM[name])


@pytest.mark.parametrize(
    ("use", "scheme", "message"),
    [
        (None, MODIS, "does not tell of its land use"),
        (3.0, None, "does not tell of its land use"),
        (3.0, "SiB", "land use is by 'SiB'; known are only USGS"),
        (99.0, "USGS", "land use is 99 in 6 of the 6 columns read, which is no category of USGS"),
    ],
)
def test_land_use_that_is_not_known_is_named(make_model, use, scheme, message):
    model = make_model() if use is None else make_model(land_use=use)
    if scheme is not None:
        model = model.assign_attrs(land_use_scheme=scheme)
    with pytest.raises(InputError, match=message):
        check_emissivity("land-use", model)
