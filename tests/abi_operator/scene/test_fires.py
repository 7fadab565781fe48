"""Fires of a scene: in which column they burn, and what is seen of them."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

from abi_operator import Fire, radiance
from abi_operator.files import InputError
from abi_operator.files.cell_bounds import cell_bounds
from abi_operator.nomenclature import FIRE, FIRE_TABLE
from abi_operator.planck import in_band_radiance
from abi_operator.satellites import solar_irradiance
from abi_operator.scene import check_fires, column_states, fires_inside, scenario, simulate
from abi_operator.scene.angles import sun_distance
from abi_operator.scene.fires import burning_columns

BANDS = ("C03", "C06", "C07")
OPTIONS = {"num_streams": 2, "error_budget": None}


def table(*fires, start=None, end=None):
    """Fires of latitude, longitude, temperature and area."""
    columns = dict(
        zip(("latitude", "longitude", "temperature", "area"), zip(*fires, strict=True), strict=True)
    )
    for name, time in (("start", start), ("end", end)):
        columns[name] = np.full(len(fires), np.datetime64(time or "NaT", "ns"))
    return xr.Dataset({name: (FIRE_TABLE[name].dims, np.array(x)) for name, x in columns.items()})


@pytest.fixture
def model(make_model):
    """Three rows of two cells of a tenth of a degree, with corners and a warm ground."""
    made = make_model(land_mask=None, surface_temperature=300.0)
    bounds = cell_bounds(made["latitude"].values, made["longitude"].values)
    names = "latitude_bounds", "longitude_bounds"
    return made.assign({n: (("y", "x", "corner"), x) for n, x in zip(names, bounds, strict=True)})


def test_a_fire_burns_in_the_cell_where_it_lies(model):
    found = burning_columns(model, table((33.12, -116.93, 900.0, 5e4), (33.2, 243.0, 700.0, 1e4)))
    assert (found.num_fires, found.num_joined) == (2, 0)
    assert list(zip(*np.nonzero(found.fraction), strict=True)) == [(1, 1), (2, 0)]
    assert found.temperature[1, 1] == 900 and found.temperature[2, 0] == 700
    assert np.isnan(found.temperature[found.fraction == 0]).all()
    # A tenth of a degree each way, on a sphere of 6371 km.
    north = 6.371e6 * np.radians(0.1)
    for place, area, latitude in (((1, 1), 5e4, 33.1), ((2, 0), 1e4, 33.2)):
        ground = north**2 * np.cos(np.radians(latitude))
        assert found.fraction[place] == pytest.approx(area / ground, rel=1e-3)


def test_a_fire_on_an_edge_burns_once(model):
    """Corners and edges of cells: nothing burns twice, and inside the scene nothing is lost."""
    corners = [model[f"{name}_bounds"].values for name in ("latitude", "longitude")]
    inner = corners[0][1, 0, 1:3], corners[1][1, 0, 1:3]  # the edge between (1, 0) and (1, 1)
    shares = np.array([0.0, 0.25, 0.5, 1.0])
    places = [x[0] + shares * (x[1] - x[0]) for x in inner]
    fires = table(*((lat, lon, 900.0, 1e4) for lat, lon in zip(*places, strict=True)))
    whole = burning_columns(model, fires)
    blocks = [burning_columns(model.isel(y=rows), fires) for rows in (slice(0, 1), slice(1, 3))]
    assert whole.num_fires == sum(block.num_fires for block in blocks) == 4
    np.testing.assert_array_equal(
        np.concatenate([block.fraction for block in blocks]), whole.fraction
    )
    assert fires_inside(fires, model).all()


def test_cells_meet_across_the_date_line(model):
    moved = {name: model[name] + 296.95 for name in ("longitude", "longitude_bounds")}
    fires = table((33.1, 179.99, 900.0, 1e4), (33.1, -179.99, 900.0, 1e4), (33.1, 0.0, 900.0, 1e4))
    found = burning_columns(model.assign(moved), fires)
    assert found.num_fires == 2 and (found.fraction[1] > 0).all()


def test_fires_that_share_a_cell_emit_as_much_together(model):
    one, other = (33.1, -117.0, 600.0, 3e4), (33.11, -117.01, 1000.0, 3e4)
    found = burning_columns(model, table(one, other))
    assert found.attributes == {
        "fire_count": 2,
        "fires_joined_count": 2,
        "burning_columns_count": 1,
    }
    hot = found.temperature[1, 0]
    assert hot**4 == pytest.approx((600.0**4 + 1000.0**4) / 2)
    bright = np.asarray(in_band_radiance(jnp.array([600.0, 1000.0, hot]), "C07"))
    assert bright[2] / bright[:2].mean() == pytest.approx(1.04, abs=0.005)  # as its docstring says


def test_a_fire_burns_between_its_times(model):
    place = (33.1, -117.0, 900.0, 1e4)
    burns = {
        (None, None): 1,
        ("2007-10-23T18:00", None): 1,
        ("2007-10-23T18:01", None): 0,
        (None, "2007-10-23T18:00"): 0,
        ("2007-10-23T17:00", "2007-10-23T18:01"): 1,
    }
    for (start, end), expected in burns.items():
        assert burning_columns(model, table(place, start=start, end=end)).num_fires == expected


def test_refusals(model):
    here, away = table((33.1, -117.0, 900.0, 1e4)), table((0.0, 0.0, 900.0, 1e4))
    with pytest.raises(InputError, match="fires shine in C05, C06, C07; simulate one of these"):
        check_fires(fires_inside(here, model), ("C01", "C02"))
    with pytest.raises(InputError, match="none of the 1 fires lies in the scene"):
        check_fires(fires_inside(away, model), BANDS)
    both = xr.concat([here, away], "fire")
    with pytest.warns(UserWarning, match="1 of 2 fires lie outside the scene"):
        check_fires(fires_inside(both, model), BANDS)
    with pytest.raises(
        InputError, match=r"2e\+08 m2 burn in the column at y=5, x=0, which has 1.0"
    ):
        burning_columns(model, table((33.1, -117.0, 900.0, 2e8)), first_row=4)
    with pytest.raises(InputError, match="fires need the corners of the model's cells"):
        burning_columns(model.drop_vars("latitude_bounds"), here)
    with pytest.raises(InputError, match="only a scene of two rows and columns or more"):
        fires_inside(here, model.isel(x=slice(1)))


@pytest.fixture
def burning(model):
    """A scene with two fires in it, one of them by night."""
    fires = table((33.1, -116.9, 900.0, 4e5), (33.2, -116.9, 800.0, 9e5))
    made = scenario(model, ocean_albedo=0.06, emissivity=0.96, bands=BANDS, fires=fires, gases=())
    made["solar_zenith_angle"][2] = 110.0
    return made


def test_a_scenario_knows_its_fires(burning):
    for name, entry in FIRE.items():
        assert burning[name].dims == entry.dims and burning[name].attrs["units"] == entry.units
    assert burning.attrs["fire_count"] == 2
    states = column_states(burning, BANDS)
    np.testing.assert_array_equal(states.fire.fraction, burning["fire_fraction"].values.ravel())
    assert np.isfinite(states.fire.temperature).all()


def test_fires_are_seen_by_day_and_by_night(burning):
    """Where it burns the radiance is that of the operator with its fire, elsewhere as without."""
    result = simulate(burning, **OPTIONS)
    names = ["fire_fraction", "fire_temperature"]
    without = simulate(burning.drop_vars(names), bands=("C03", "C06"), **OPTIONS)
    burns = burning["fire_fraction"].values > 0
    day, night = (1, 1), (2, 1)
    assert burns[day] and burns[night] and burns.sum() == 2
    for name in ("radiance", "reflectance_factor", "brf"):
        ours, plain = (x[name].sel(band=["C03", "C06"]).values for x in (result, without))
        np.testing.assert_array_equal(ours[0], plain[0])
        np.testing.assert_array_equal(ours[1][~burns], plain[1][~burns])
    states, distance = column_states(burning, BANDS), sun_distance(burning["time"].values)
    assert isinstance(states.fire, Fire)
    how = {"sun_distance": distance, "gases": (), "num_streams": 2}
    direct = [radiance(states, (band,), **how) for band in BANDS[1:]]
    seen = result["radiance"].sel(band=list(BANDS[1:])).values
    expected = np.reshape(direct, (2, 3, 2))
    np.testing.assert_allclose(seen[:, burns], expected[:, burns], rtol=1e-10)
    assert (result["brightness_temperature"].values[burns] > 350).all()
    of_c06 = {name: result[name].sel(band="C06").values for name in ("reflectance_factor", "brf")}
    light = solar_irradiance("C06", "GOES-16") / (np.pi * distance**2)
    np.testing.assert_allclose(of_c06["reflectance_factor"][burns], seen[0][burns] / light)
    assert of_c06["reflectance_factor"][night] > 0.01 and np.isnan(of_c06["brf"][night])
    # A ground as hot shines without a fire: as one that has a share of nothing in flames.
    hot = burning.drop_vars(names)
    hot["surface_temperature"][day] = 800.0
    shining = simulate(hot, **OPTIONS)
    states = column_states(hot, BANDS)
    none = np.zeros_like(states.surface_temperature)
    states = dataclasses.replace(states, fire=Fire(none, none + 900.0))
    expected = np.reshape(radiance(states, ("C06",), **how), (3, 2))[day]
    np.testing.assert_allclose(shining["radiance"].sel(band="C06").values[day], expected)
    assert expected > 3 * without["radiance"].sel(band="C06").values[day]
    mu0 = np.cos(np.radians(burning["solar_zenith_angle"].values[day]))
    assert of_c06["brf"][day] == pytest.approx(of_c06["reflectance_factor"][day] / mu0)


def test_a_hot_ground_shines_whatever_other_bands_there_are(make_model):
    """One column of six is hotter than 350 K, and the scenario of any bands knows of it."""
    warmth = np.full((3, 2), 300.0)
    warmth[1, 1] = 800.0
    model, ground = make_model(land_mask=None, surface_temperature=warmth), {"ocean_albedo": 0.06}
    alone = scenario(model, bands=("C06",), gases=(), **ground)
    with_c07 = scenario(model, bands=("C06", "C07"), emissivity=0.96, gases=(), **ground)
    for name in ("temperature", "surface_temperature"):
        np.testing.assert_array_equal(alone[name], with_c07[name])
    seen = simulate(alone, **OPTIONS)["radiance"].sel(band="C06")
    expected = simulate(with_c07, bands=("C06",), **OPTIONS)["radiance"].sel(band="C06")
    np.testing.assert_allclose(seen, expected, rtol=1e-12)
    assert seen[1, 1] > 10 * seen[0, 1]
    cool = scenario(model.isel(y=[0]), bands=("C06",), gases=(), **ground)
    assert "surface_temperature" not in cool
    told = scenario(model.isel(y=[0]), bands=("C06",), gases=(), hot_ground=True, **ground)
    assert "surface_temperature" in told
    assert "surface_temperature" not in scenario(model, bands=("C03",), gases=(), **ground)
