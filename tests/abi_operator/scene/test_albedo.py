"""Which albedo the ground of a column gets."""

import numpy as np
import pytest

from abi_operator.files import InputError
from abi_operator.files.cell_bounds import cell_bounds
from abi_operator.scene import check_ground
from abi_operator.scene.albedo import surface_albedo
from abi_operator.scene.albedo_file import albedo_of_file

BANDS = ("C01", "C03")


def test_the_nearest_cell_is_taken(make_model, make_albedo):
    values, source = surface_albedo(make_model(), BANDS, make_albedo(), None)
    np.testing.assert_allclose(values[0], [[0.2, 0.3]] * 3)
    np.testing.assert_allclose(values[1], [[0.22, 0.32]] * 3)
    assert source["surface_albedo_source"] == "nearest cell of the albedo file's 2007-10-24"
    assert (source["mean_albedo_count"], source["nearest_albedo_count"]) == (0, 6)


def fine_albedo(make_albedo, step=0.02):
    """Random albedo in cells of a fiftieth of a degree, a fifth of the model's."""
    made = make_albedo(
        lat=np.arange(33.4, 32.8, -step), lon=np.arange(-117.2, -116.8, step), dates=("2007-10-23",)
    )
    values = np.random.default_rng(2).uniform(0.05, 0.5, made["surface_albedo"].shape)
    return made.assign(surface_albedo=(made["surface_albedo"].dims, values))


def test_larger_cells_have_the_mean_over_their_area(make_model, make_albedo):
    model, albedo = make_model(), fine_albedo(make_albedo)
    values, source = surface_albedo(model, BANDS, albedo, None)
    field = albedo["surface_albedo"].isel(time=0)
    for y, x in np.ndindex(3, 2):
        place = model["latitude"].values[y, x], model["longitude"].values[y, x]
        within = field.where(
            (abs(field.lat - place[0]) < 0.05) & (abs(field.lon - place[1]) < 0.05), drop=True
        )
        assert within.sizes["lat"] == within.sizes["lon"] == 5
        np.testing.assert_allclose(values[:, y, x], within.mean(("lat", "lon"))[[0, 2]], rtol=1e-12)
    expected = "mean of the albedo file's 2007-10-23 over each column's cell"
    assert source["surface_albedo_source"] == expected
    assert source["mean_albedo_count"] == 6 and source["incomplete_mean_albedo_count"] == 0


def test_the_count_of_longitudes_does_not_matter_to_means(make_model, make_albedo):
    model, albedo = make_model(), fine_albedo(make_albedo)
    expected, _ = surface_albedo(model, BANDS, albedo, None)
    turned = albedo.assign_coords(lon=albedo.lon + 360)
    np.testing.assert_allclose(surface_albedo(model, BANDS, turned, None)[0], expected, rtol=1e-12)


def test_blocks_of_rows_have_the_means_of_the_whole(make_model, make_albedo):
    """Even rows by themselves, as corners come with the model; rows farther apart northwards."""
    model, albedo = make_model(), fine_albedo(make_albedo)
    model["latitude"] += 0.02 * np.arange(3)[:, None] ** 2
    bounds = cell_bounds(model["latitude"].values, model["longitude"].values)
    names = "latitude_bounds", "longitude_bounds"
    corners = {name: (("y", "x", "corner"), x) for name, x in zip(names, bounds, strict=True)}
    model = model.assign_coords(corners)
    whole, _ = surface_albedo(model, BANDS, albedo, None)
    for row in range(3):
        block, source = surface_albedo(model.isel(y=[row]), BANDS, albedo, None)
        np.testing.assert_allclose(block, whole[:, [row]], rtol=1e-12)
        assert source["mean_albedo_count"] == 2


def test_means_with_holes_are_counted_and_those_mostly_of_holes_are_none(make_model, make_albedo):
    model, albedo = make_model(), fine_albedo(make_albedo)
    field = albedo["surface_albedo"]
    field[0, 0] = field[0, 0].where(field.lat < 33.17)  # two fifths of the last row's cells
    values, source = surface_albedo(model, BANDS, albedo, None)
    assert np.isnan(values[0, 2]).all() and np.isfinite(values[0, :2]).all()
    assert np.isfinite(values[1]).all()
    assert source["incomplete_mean_albedo_count"] == 2
    _, of_land = surface_albedo(model, BANDS, albedo, 0.06)
    assert of_land["incomplete_mean_albedo_count"] == 1 and of_land["mean_albedo_count"] == 3


def test_a_single_row_of_columns_or_of_cells_has_no_size(make_model, make_albedo):
    model, albedo = make_model().isel(y=[1]), fine_albedo(make_albedo)
    _, source = surface_albedo(model, BANDS, albedo, None)
    assert source["surface_albedo_source"].startswith("nearest cell")
    for axis in ("lat", "lon"):
        one = make_albedo().isel({axis: [1]})
        _, sources, _ = albedo_of_file(make_model(), BANDS, one, np.full((3, 2), True))
        assert sources == ["nearest cell of the albedo file's 2007-10-24"]


def test_the_order_of_latitudes_and_the_count_of_longitudes_do_not_matter(make_model, make_albedo):
    model, albedo = make_model(), make_albedo()
    albedo["surface_albedo"][..., 0, :] = 0.7  # the northernmost row, 33.4 N
    model["latitude"] += 0.15
    expected, _ = surface_albedo(model, BANDS, albedo, None)
    assert (expected[0, -1] == 0.7).all() and (expected[0, 0] < 0.5).all()
    for same in (
        albedo.isel(lat=slice(None, None, -1)),
        albedo.assign_coords(lon=albedo.lon + 360),
    ):
        np.testing.assert_array_equal(surface_albedo(model, BANDS, same, None)[0], expected)


def test_the_nearest_date_is_taken(make_model, make_albedo):
    albedo = make_albedo(dates=("2007-10-24", "2007-10-08"))
    albedo["surface_albedo"][:, 1] = 0.9
    values, _ = surface_albedo(make_model(), BANDS, albedo, None)
    assert (values < 0.5).all()


@pytest.mark.parametrize("hour", ["00:00", "11:59", "12:01", "18:00", "23:59"])
def test_the_days_own_value_comes_first(make_model, make_albedo, hour):
    albedo = make_albedo(dates=("2007-10-22", "2007-10-24", "2007-10-23"))
    albedo["surface_albedo"][:, 2] = 0.9
    model = make_model().assign_coords(time=np.datetime64(f"2007-10-23T{hour}", "ns"))
    values, source = surface_albedo(model, BANDS, albedo, None)
    assert (values == 0.9).all()
    assert source["surface_albedo_source"].endswith("2007-10-23")


@pytest.mark.parametrize(("hour", "expected"), [("06:00", "2007-10-22"), ("18:00", "2007-10-24")])
def test_of_two_days_equally_far_the_nearer_in_hours_is_taken(
    make_model, make_albedo, hour, expected
):
    model = make_model().assign_coords(time=np.datetime64(f"2007-10-23T{hour}", "ns"))
    albedo = make_albedo(dates=("2007-10-24", "2007-10-22"))
    _, source = surface_albedo(model, BANDS, albedo, None)
    assert source["surface_albedo_source"].endswith(expected)


def test_a_date_far_away_is_warned_of(make_model, make_albedo):
    with pytest.warns(UserWarning, match="2007-10-01, is 22 days away from the scene"):
        surface_albedo(make_model(), BANDS, make_albedo(dates=("2007-10-01",)), None)


def test_water_of_the_land_mask_is_ocean(make_model, make_albedo):
    values, source = surface_albedo(make_model(), BANDS, make_albedo(), 0.06)
    np.testing.assert_allclose(values[0], [[0.06, 0.3]] * 3)
    assert source["surface_albedo_source"].endswith("water 0.06")


def test_land_without_inversion_stays_without_albedo(make_model, make_albedo):
    albedo = make_albedo()
    albedo["surface_albedo"][..., 2] = np.nan
    values, _ = surface_albedo(make_model(), BANDS, albedo, 0.06)
    assert (values[:, :, 0] == 0.06).all() and np.isnan(values[:, :, 1]).all()


def test_without_a_mask_ocean_fills_what_the_file_lacks(make_model, make_albedo):
    albedo = make_albedo()
    albedo["surface_albedo"][..., 2] = np.nan
    values, _ = surface_albedo(make_model(land_mask=None), BANDS, albedo, 0.06)
    np.testing.assert_allclose(values[0], [[0.2, 0.06]] * 3)


def test_a_column_with_some_bands_is_not_made_ocean(make_model, make_albedo):
    albedo = make_albedo()
    albedo["surface_albedo"][0, ..., 2] = np.nan
    values, _ = surface_albedo(make_model(land_mask=None), BANDS, albedo, 0.06)
    assert np.isnan(values[0, :, 1]).all() and (values[1, :, 1] > 0.3).all()


def test_without_file_or_mask_all_is_ocean(make_model):
    values, _ = surface_albedo(make_model(land_mask=None), BANDS, None, 0.06)
    assert (values == 0.06).all()


def test_without_file_land_of_the_mask_has_no_albedo(make_model):
    values, _ = surface_albedo(make_model(), BANDS, None, 0.06)
    assert (values[..., 0] == 0.06).all() and np.isnan(values[..., 1]).all()


@pytest.mark.parametrize("wrong", [-0.1, 1.1, np.nan])
def test_an_albedo_of_water_is_one(make_model, wrong):
    with pytest.raises(InputError, match=f"the albedo of water is {wrong:g}; it must be 0 to 1"):
        surface_albedo(make_model(), BANDS, None, wrong)


def test_some_albedo_must_be_named(make_model):
    with pytest.raises(InputError, match="name an albedo file, an albedo of the ocean, or both"):
        surface_albedo(make_model(), BANDS, None, None)


def test_a_file_that_ends_within_the_scene_is_refused(make_model, make_albedo):
    message = (
        r"from 33.00 to 33.20 N and -117.00 to -116.90 E, but the albedo file only from 32.70 to "
        r"33.10 N and -117.15 to -116.85 E"
    )
    with pytest.raises(InputError, match=message):
        check_ground(make_model(), BANDS, make_albedo(lat=(33.0, 32.8)), None)


def test_water_with_its_own_albedo_needs_no_file(make_model, make_albedo):
    albedo = make_albedo(lon=(-116.9, -116.8))
    check_ground(make_model(), BANDS, albedo, 0.06)
    with pytest.raises(InputError, match="request albedo for the whole scene"):
        check_ground(make_model(), BANDS, albedo, None)


def test_c07_has_the_albedo_that_its_emissivity_leaves(make_model, make_albedo):
    bands = ("C01", "C07", "C03")
    values, sources = surface_albedo(make_model(), bands, make_albedo(), None, 0.9)
    np.testing.assert_allclose(values[1], [[0.022, 0.1]] * 3)  # water, land
    np.testing.assert_allclose(
        values[[0, 2]], surface_albedo(make_model(), BANDS, make_albedo(), None)[0]
    )
    assert sources["emissivity_source"] == "0.9 over land, 0.978 over water"


def test_c07_alone_needs_no_albedo(make_model):
    model = make_model(land_mask=None)
    check_ground(model, ("C07",), None, None, "grassland")
    values, sources = surface_albedo(model, ("C07",), None, None, "grassland")
    np.testing.assert_allclose(values, 0.08)
    assert sources == {"emissivity_source": "0.92 (grassland) in all columns"}


def test_the_models_emissivity_is_warned_of(make_model):
    model = make_model(surface_emissivity=0.97)
    with pytest.warns(UserWarning, match="is of the whole thermal infrared"):
        values, sources = surface_albedo(model, ("C07",), None, None, "model")
    np.testing.assert_allclose(values, 0.03)
    assert sources == {"emissivity_source": "the model's broadband one"}


@pytest.mark.parametrize(
    ("emissivity", "message"),
    [
        (None, "C07 needs the emissivity of the ground: name a number, a type of surface"),
        ("lava", "no emissivity is known of 'lava'; name a number, one of evergreen"),
        (1.2, "the emissivity is 1.2; it must be 0 to 1"),
        ("model", "the model has no emissivity of its own"),
    ],
)
def test_an_emissivity_that_is_none_is_refused(make_model, emissivity, message):
    with pytest.raises(InputError, match=message):
        surface_albedo(make_model(), ("C07",), None, None, emissivity)
