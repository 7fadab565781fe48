"""Ice on the sea and snow on the ground: their albedo, and what is said where it is not known."""

import numpy as np
import pytest

from abi_operator.files import InputError
from abi_operator.nomenclature import QUALITY_FLAGS
from abi_operator.scene import check_ground, scenario
from abi_operator.scene.albedo import surface_albedo
from abi_operator.scene.snow_and_ice import snow_cover

BANDS = ("C01", "C06")
SEA, LAND = 0, 1  # columns of the model

# Shares of ice in the three rows; all columns of the second and third are called land.
ICE = [[0.0, 0.0], [0.25, 0.0], [1.0, 0.0]]
FROZEN_LAND = [[0.0, 1.0], [1.0, 1.0], [1.0, 1.0]]


@pytest.fixture
def frozen(make_model):
    """A model whose sea is open, a quarter frozen and frozen, and called land where it is."""
    return make_model(sea_ice=ICE, land_mask=FROZEN_LAND)


def test_sea_ice_has_not_the_albedo_of_the_sea(frozen, make_albedo):
    with pytest.warns(UserWarning, match="has sea ice .* no albedo of it was named: its columns"):
        values, found = surface_albedo(frozen, BANDS, make_albedo(), 0.06)
    np.testing.assert_array_equal(np.isnan(values[:, :, SEA]), [[False, True, True]] * 2)
    assert (values[:, 0, SEA] == 0.06).all() and np.isfinite(values[:, :, LAND]).all()
    assert found["sea_ice_count"] == 2 and "sea ice" not in found["surface_albedo_source"]


def test_named_sea_ice_is_mixed_by_its_share(frozen, make_albedo):
    ice = {"sea_ice_albedo": "bare sea ice"}
    values, found = surface_albedo(frozen, BANDS, make_albedo(), 0.06, **ice)
    expected = [[0.06, 0.75 * 0.06 + 0.25 * x, x] for x in (0.778, 0.055)]
    np.testing.assert_allclose(values[:, :, SEA], expected)
    assert found["surface_albedo_source"].endswith("water 0.06; sea ice (bare sea ice)")
    values, _ = surface_albedo(frozen, BANDS, make_albedo(), 0.06, sea_ice_albedo=0.5)
    np.testing.assert_allclose(values[:, :, SEA], [[0.06, 0.17, 0.5]] * 2)


def test_frozen_sea_needs_no_albedo_file(frozen, make_albedo):
    """The model calls it land, but MODIS gives no albedo there."""
    check_ground(frozen, BANDS, make_albedo(lon=(-116.9, -116.8)), 0.06)


def test_without_an_albedo_of_water_only_full_ice_is_known(make_model):
    model = make_model(sea_ice=ICE, land_mask=None)
    values, _ = surface_albedo(model, BANDS, None, 0.06, sea_ice_albedo=0.5)
    np.testing.assert_allclose(values[0], [[0.06, 0.06], [0.17, 0.06], [0.5, 0.06]])


def test_snow_on_the_ground_is_warned_of(make_model, make_albedo):
    model = make_model(snow_cover=[[0.0, 0.0], [0.0, 0.4], [0.0, 1.0]])
    bare, _ = surface_albedo(make_model(), BANDS, make_albedo(), 0.06)
    with pytest.warns(UserWarning, match="regressions from MODIS's bands .* do not hold for snow"):
        values, found = surface_albedo(model, BANDS, make_albedo(), 0.06)
    np.testing.assert_array_equal(values, bare)
    assert found["snow_count"] == 2


def test_named_snow_is_mixed_by_its_cover(make_model, make_albedo):
    model = make_model(snow_cover=[[0.0, 0.0], [0.0, 0.4], [1.0, 1.0]])
    bare, _ = surface_albedo(make_model(), BANDS, make_albedo(), 0.06)
    with pytest.warns(UserWarning, match="as if nothing stood in it"):
        values, found = surface_albedo(model, BANDS, make_albedo(), 0.06, snow_albedo="new snow")
    for band, of_snow in enumerate((0.995, 0.135)):
        land = bare[band, :, LAND]
        expected = [land[0], 0.6 * land[1] + 0.4 * of_snow, of_snow]
        np.testing.assert_allclose(values[band, :, LAND], expected)
    assert (values[..., SEA] == 0.06).all()  # none lies on open water
    assert found["surface_albedo_source"].endswith("water 0.06; snow (new snow)")


def test_snow_lies_on_ice_and_covers_land_without_albedo(make_model, make_albedo):
    model = make_model(sea_ice=ICE, land_mask=FROZEN_LAND, snow_cover=[[0, 1], [0.5, 1], [0.5, 1]])
    albedo = make_albedo()
    albedo["surface_albedo"][..., 2] = np.nan
    options = {"sea_ice_albedo": 0.5, "snow_albedo": 0.9}
    with pytest.warns(UserWarning, match="as if nothing"):
        values, _ = surface_albedo(model, BANDS, albedo, 0.06, **options)
    np.testing.assert_allclose(values[0, :, SEA], [0.06, 0.75 * 0.06 + 0.25 * 0.7, 0.7])
    np.testing.assert_allclose(values[0, :, LAND], 0.9)


def test_ice_under_snow_alone_needs_no_albedo_of_its_own(make_model):
    """Nor is it warned of: all warnings are errors here, but the one that is expected."""
    model = make_model(sea_ice=ICE, land_mask=FROZEN_LAND, snow_cover=[[0, 1], [1, 1], [1, 1]])
    with pytest.warns(UserWarning, match="as if nothing") as told:
        values, _ = surface_albedo(model, BANDS, None, 0.06, snow_albedo=0.9)
    assert not any("sea ice" in str(one.message) for one in told)
    np.testing.assert_allclose(values[0, :, SEA], [0.06, 0.75 * 0.06 + 0.25 * 0.9, 0.9])


def test_cover_follows_from_mass_where_the_model_does_not_tell(make_model):
    mass = [[0.0, 0.05], [0.0, 5.0], [30.0, 30.0]]
    np.testing.assert_allclose(
        snow_cover(make_model(snow_mass=mass, land_mask=None)), [[0, 0], [0, 0.5], [1, 1]]
    )
    model = make_model(snow_mass=mass, snow_cover=[[0, 0], [0, 0.2], [0, 0]], land_mask=None)
    np.testing.assert_allclose(snow_cover(model), [[0, 0], [0, 0.2], [1, 1]])


def test_snow_and_ice_emit_as_snow(make_model):
    model = make_model(sea_ice=ICE, land_mask=FROZEN_LAND, snow_cover=[[0, 0], [0, 0.5], [0, 1]])
    values, found = surface_albedo(model, ("C07",), None, None, 0.9)
    expected = [[0.022, 0.1], [0.75 * 0.022 + 0.25 * 0.016, 0.058], [0.016, 0.016]]
    np.testing.assert_allclose(values[0], expected)
    assert found["emissivity_source"] == "0.9 over land, 0.978 over water; 0.984 over snow and ice"


def test_a_scenario_flags_and_counts(frozen):
    with pytest.warns(UserWarning, match="sea ice"):
        made = scenario(frozen.isel(x=[SEA]), ocean_albedo=0.06)
    flags = made["quality_flag"].values[:, 0]
    assert (flags == QUALITY_FLAGS["no_albedo"] * np.array([0, 1, 1])).all()
    assert made.attrs["sea_ice_count"] == 2
    made = scenario(frozen.isel(x=[SEA]), ocean_albedo=0.06, sea_ice_albedo="old snow")
    assert (made["quality_flag"] == 0).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"sea_ice_albedo": "slush"}, "no albedo of sea ice is known by the name of 'slush'"),
        ({"snow_albedo": 1.5}, "the albedo of snow is 1.5; it must be 0 to 1"),
    ],
)
def test_an_albedo_that_is_none_is_refused(make_model, options, message):
    with pytest.raises(InputError, match=message):
        surface_albedo(make_model(), BANDS, None, 0.06, **options)


def test_a_share_that_is_none_is_refused(make_model):
    with pytest.raises(InputError, match=r"sea_ice of the model is 80 in 6 of the 6 columns"):
        surface_albedo(make_model(sea_ice=80.0), BANDS, None, 0.06)
