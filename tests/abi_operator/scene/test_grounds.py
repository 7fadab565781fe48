"""Anisotropic grounds of a scene: which weights and winds columns get, and what is seen of them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

from abi_operator import brf
from abi_operator.files import InputError
from abi_operator.files.mcd43 import KERNELS
from abi_operator.nomenclature import GROUND, QUALITY_FLAGS
from abi_operator.scene import column_states, scenario, simulate
from abi_operator.scene.grounds import check_ocean_wind, sea_albedo, wind_speed
from abi_operator.scene.kinds_of_ground import by_kind
from abi_operator.surface import LandAndSea, Ocean, RossLi, ocean

BANDS = ("C01", "C03")
# One band is solved: what is asked of columns is asked of each alike.
SOLVED = ("C03",)
WHITE_SKY_ALBEDO = jax.jit(lambda ground: ground.white_sky_albedo())
OPTIONS = {"bands": SOLVED, "num_streams": 2, "error_budget": None}


@pytest.fixture
def kernels(make_albedo):
    """An albedo file with weights that grow to the east and to the north."""
    albedo = make_albedo(bands=BANDS)
    shares = 0.3 * albedo["surface_albedo"] + 0.1 * (albedo["lat"] - 33)
    return albedo.assign({name: shares / (1 + k) for k, name in enumerate(KERNELS)})


@pytest.fixture
def coast(make_model):
    """Three rows: water in the west, a part of it frozen in the second; land in the east."""
    ice = np.array([[0.0, 0.0], [0.4, 0.0], [0.0, 0.0]])
    land = np.array([[0.0, 1.0]] * 3)
    winds = {"wind_along_x": 3.0, "wind_along_y": -4.0}
    return make_model(land_mask=land, sea_ice=ice, cloud_mixing_ratio=0.0, **winds)


@pytest.fixture
def thawed(coast):
    """Without ice no column has a ground of two parts, for which there is a program of its own."""
    return coast.assign(sea_ice=0 * coast["sea_ice"])


@pytest.fixture
def make_scenario(coast, kernels):
    def make(model=coast, albedo=kernels, **options):
        options = {"ocean_wind": "model", "sea_ice_albedo": 0.6, "gases": (), **options}
        return scenario(model, albedo=albedo, bands=BANDS, **options)

    return make


def test_land_has_the_files_kernels_and_water_the_models_wind(make_scenario, kernels):
    made = make_scenario()
    for name, entry in GROUND.items():
        assert made[name].dims == entry.dims and made[name].attrs["units"] == entry.units
    np.testing.assert_allclose(made["wind_speed"], 5.0)
    np.testing.assert_allclose(made["water_share"], [[1, 0], [0.6, 0], [1, 0]])
    places = {"lat": made["latitude"][:, 1], "lon": made["longitude"][:, 1]}
    for name in KERNELS:
        of_file = kernels[name].sel(time="2007-10-24").squeeze().sel(places, method="nearest")
        np.testing.assert_allclose(made[name][:, :, 1], of_file)
        np.testing.assert_array_equal(made[name][:, :, 0], 0.0)
    sea = [float(WHITE_SKY_ALBEDO(ocean(jnp.array(5.0), band))) for band in BANDS]
    np.testing.assert_allclose(made["surface_albedo"][:, 0, 0], sea, rtol=1e-4)
    np.testing.assert_allclose(
        made["surface_albedo"][:, 1, 0], 0.6 * np.array(sea) + 0.4 * 0.6, rtol=1e-4
    )
    assert made.attrs["kernel_count"] == 3 and made.attrs["water_count"] == 3
    assert "water rough by a wind of the model's" in made.attrs["surface_albedo_source"]


def test_states_keep_the_white_sky_albedo(make_scenario):
    made = make_scenario()
    states = column_states(made, BANDS)
    for band in BANDS:
        ground = states.albedo[band]
        assert isinstance(ground, LandAndSea)
        found = np.asarray(WHITE_SKY_ALBEDO(ground)).reshape(3, 2)
        np.testing.assert_allclose(found, made["surface_albedo"].sel(band=band), rtol=1e-4)


def test_snow_lies_over_the_kernels(make_scenario, coast):
    snowy = coast.assign(snow_cover=(("y", "x"), np.array([[0, 0.25], [0, 0], [0, 1.0]])))
    bare = make_scenario()
    with pytest.warns(UserWarning, match="snow"):
        found = make_scenario(snowy, snow_albedo=0.8)
    uncovered = np.array([0.75, 1.0, 0.0])
    for name in KERNELS:
        np.testing.assert_allclose(found[name][..., 1], uncovered * bare[name][..., 1])


def test_a_lambertian_scene_has_none_of_it(make_scenario, kernels):
    plain = kernels.drop_vars(list(KERNELS))
    made = make_scenario(albedo=plain, ocean_wind=None, ocean_albedo=0.06)
    assert not set(GROUND) & set(made.variables)
    assert all(isinstance(x, np.ndarray) for x in column_states(made, BANDS).albedo.values())


def test_columns_are_solved_by_their_kind(make_scenario, coast, kernels):
    """Each as if it stood alone with the mixed ground; lambertian land as such.

    Every column is there twice: one alone would be solved by a program of its own.
    """
    albedo = kernels.copy(deep=True)
    for name in KERNELS:
        albedo[name].loc[{"lat": 33.2}] = 0.0  # one column of land without kernels
    twice = xr.concat([coast, coast], "y", data_vars="minimal", coords="minimal", compat="override")
    made = make_scenario(twice, albedo)
    states = column_states(made, SOLVED, num_streams=2)
    kinds = {type(some.albedo["C03"]): chosen for chosen, some in by_kind(states)}
    assert set(kinds) == {np.ndarray, RossLi, Ocean, LandAndSea}
    assert sum(chosen.sum() for chosen in kinds.values()) == 12
    direct = brf(states, SOLVED, gases=(), num_streams=2)
    found = simulate(made, **OPTIONS)["brf"].values.reshape(1, 12)
    np.testing.assert_allclose(found.T, direct, rtol=1e-10)


def test_land_is_brighter_with_the_sun_behind_the_satellite(make_scenario, thawed, kernels):
    """And, with the sun on the other side, the sea glints."""
    made = make_scenario(thawed)
    flat = make_scenario(thawed, kernels.drop_vars(list(KERNELS))).isel(x=slice(1, 2))  # land

    def seen(dataset, azimuth):
        dataset = dataset.assign(
            solar_zenith_angle=dataset["solar_zenith_angle"] * 0 + 40.0,
            view_zenith_angle=dataset["view_zenith_angle"] * 0 + 40.0,
            relative_azimuth_angle=dataset["relative_azimuth_angle"] * 0 + azimuth,
        )
        return simulate(dataset, **OPTIONS)["brf"].sel(band="C03").values

    assert (seen(made, 0.0)[:, 1] > 1.05 * seen(flat, 0.0)[:, 0]).all()
    assert (seen(made, 180.0)[:, 0] > 3 * seen(made, 0.0)[:, 0]).all()


def test_kernels_that_are_no_ground_are_flagged(make_scenario, thawed):
    made = make_scenario(thawed)
    made["volume_kernel_weight"].values[:, 0, 1] = -60.0
    flags = simulate(made, **OPTIONS)["quality_flag"].values
    bad = QUALITY_FLAGS["ground_below_zero"] | QUALITY_FLAGS["ground_above_one"]
    np.testing.assert_array_equal((flags & bad) > 0, [[False, True], [False] * 2, [False] * 2])


def test_white_sky_albedo_of_the_sea_is_interpolated_closely():
    winds = np.array([0.1, 4.13, 9.87, 22.2, 36.9])
    for band in BANDS:
        exact = np.array([float(WHITE_SKY_ALBEDO(ocean(jnp.array(x), band))) for x in winds])
        np.testing.assert_allclose(sea_albedo(band, winds), exact, rtol=1e-4)


def test_a_storm_is_told_of(coast):
    storm = coast.assign(wind_along_x=(("y", "x"), np.full((3, 2), 60.0)))
    with pytest.warns(UserWarning, match="above 37 m/s over water"):
        speed, count = wind_speed(storm, "model")
    assert count == 3 and (speed == 37).all()


def test_refusals(coast, make_scenario, kernels):
    for wind, model, message in (
        ("breeze", coast, "no wind is known by the name of 'breeze'"),
        (-1.0, coast, "the wind is -1 m/s; it must be 0 to 37 m s-1"),
        ("model", coast.drop_vars("wind_along_x"), "the model has no wind at 10 m"),
        (5.0, coast.drop_vars("land_mask"), "does not tell water from land"),
    ):
        with pytest.raises(InputError, match=message):
            check_ocean_wind(wind, model)
    with pytest.raises(InputError, match="water has an albedo or a wind"):
        make_scenario(ocean_albedo=0.06)
