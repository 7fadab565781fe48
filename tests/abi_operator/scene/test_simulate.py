"""Simulated scenes: what they contain, where they are undefined, and how they are cut."""

import importlib
import io
import sys

import numpy as np
import pytest
import xarray as xr
from heard import Heard

from abi_operator import brf, quality_flags, radiance, smoke
from abi_operator.files import InputError, Parts
from abi_operator.nomenclature import (
    LARGEST_SHARE_OUTSIDE,
    OPTIONAL_RESULT,
    QUALITY_FLAGS,
    RESULT,
)
from abi_operator.satellites import solar_irradiance
from abi_operator.scene import (
    PlumeSpecification,
    column_states,
    row_blocks,
    run,
    scenario,
    simulate,
    variables_of_result,
)
from abi_operator.scene.angles import sun_distance
from abi_operator.scene.parts import part_name

BRIGHTNESS = np.linspace(0, 1, 6).reshape(3, 2)
OPTIONS = {"num_streams": 2, "error_budget": None}
# Sums in another order, as chunks of columns of other sizes are compiled to other programs.
ROUNDING = 1e-10


@pytest.fixture
def made(make_model):
    """Two bands of a small scene with cloud, smoke and ocean everywhere."""
    plumes = {"smoke": PlumeSpecification(smoke(1.2, bands=("C01", "C03")), BRIGHTNESS)}
    model = make_model(land_mask=None)
    return scenario(model, ocean_albedo=0.06, plumes=plumes, bands=("C01", "C03"))


def test_a_result_is_the_scenario_with_reflectances_and_depths(made):
    result = simulate(made, **OPTIONS)
    added = {*RESULT, "smoke_optical_depth", "smoke_aod_550"}
    assert set(result.variables) == {*made.variables, *added} == variables_of_result(made)
    assert set(made.data_vars).isdisjoint(added)
    for name, entry in RESULT.items():
        assert result[name].dims == entry.dims and np.isfinite(result[name]).all()
    mu0 = np.cos(np.radians(made["solar_zenith_angle"].values))
    np.testing.assert_allclose(
        result["reflectance_factor"], mu0 * result["brf"].values, rtol=ROUNDING
    )
    np.testing.assert_allclose(result["smoke_aod_550"], 1.2 * BRIGHTNESS, rtol=ROUNDING)
    extinction = made["smoke_relative_extinction"]
    np.testing.assert_allclose(
        result["smoke_optical_depth"], extinction * result["smoke_aod_550"], rtol=ROUNDING
    )
    cloud = result["liquid_optical_depth"].values
    assert (cloud[..., 0] > 1).all() and (cloud[..., 1] == 0).all()
    air = 0.18411 * made["pressure"].isel(level=-1) / 101325.0  # Bodhaine et al. (1999)
    np.testing.assert_allclose(result["rayleigh_optical_depth"].sel(band="C01"), air, rtol=1e-4)


def test_chunks_and_one_shot_agree(made):
    direct = brf(column_states(made, ("C01", "C03")), ("C01", "C03"), num_streams=2)
    chunked = simulate(made, **OPTIONS)["brf"].values
    np.testing.assert_allclose(np.moveaxis(chunked, 0, -1).reshape(6, 2), direct, rtol=ROUNDING)


def test_an_error_budget_is_kept_and_told(made):
    exact, found = simulate(made, **OPTIONS), simulate(made, num_streams=2)
    assert found.attrs["error_budget"] == 1e-3 and "error_budget" not in exact.attrs
    wrong = np.abs(found["brf"] - exact["brf"]) / np.maximum(exact["brf"], 0.01)
    assert 0 < wrong.max() < 1e-3


def test_a_cloud_scatters_as_asked_and_the_result_says_how(made):
    mie = simulate(made, **OPTIONS)
    mitchell = simulate(made.assign_attrs(cloud_optics="mitchell"), **OPTIONS)
    for result, name in ((mie, "mie"), (mitchell, "mitchell")):
        assert result.attrs["cloud_optics"] == name
        again = simulate(result, **OPTIONS)
        np.testing.assert_array_equal(again["brf"], result["brf"])
    cloudy, clear = (abs(mie["brf"] / mitchell["brf"] - 1).isel(x=x) for x in (0, 1))
    assert (cloudy > 1e-3).all() and (clear < ROUNDING).all()


@pytest.mark.slow
def test_ice_is_smooth_or_rough(warm):
    """Asymmetry factors of 0.90 and 0.92 in C07, for these of 30 um."""
    rough = simulate(warm.assign_attrs(ice_optics="rough"), bands=("C07",), **OPTIONS)
    smooth = simulate(warm, **OPTIONS).sel(band=["C07"])
    assert (rough.attrs["ice_optics"], smooth.attrs["ice_optics"]) == ("rough", "fu")
    ratio = rough["radiance"] / smooth["radiance"]
    assert (abs(ratio - 1) > 1e-5).isel(y=1).all() and (abs(ratio - 1) < 0.1).isel(y=1).all()


def test_bands_can_be_chosen(made):
    one = simulate(made, bands=("C03",), **OPTIONS)
    assert one["band"].values.tolist() == ["C03"]
    both = simulate(made, **OPTIONS)
    np.testing.assert_allclose(one["brf"], both["brf"].sel(band=["C03"]), rtol=ROUNDING)


def test_flagged_pixels_are_not_solved(made):
    full = simulate(made, **OPTIONS)
    night, missing = QUALITY_FLAGS["night"], QUALITY_FLAGS["no_albedo"]
    unseen, grazing = QUALITY_FLAGS["out_of_sight"], QUALITY_FLAGS["grazing_sun"]
    flags = [[night, missing], [unseen, grazing], [night | unseen, night | missing]]
    flagged = made.copy(deep=True)
    flagged["quality_flag"] = ("y", "x"), np.array(flags, np.uint8)
    flagged["surface_albedo"][:, 0, 1] = np.nan
    flagged["solar_zenith_angle"][0, 0] = 95.0
    # Beside them those without a flag: one column alone would be solved by a program of its own.
    both = xr.concat([flagged, made], "x", data_vars="minimal", coords="minimal", compat="override")
    assert isinstance(both, xr.Dataset)
    both = simulate(both, **OPTIONS)
    result, beside = (both.isel(x=x) for x in (slice(0, 2), slice(2, 4)))
    np.testing.assert_allclose(beside["brf"], full["brf"], rtol=ROUNDING)
    for band in (0, 1):
        factor = result["reflectance_factor"].values[band]
        solved = full["reflectance_factor"].values[band, 1, 1]
        nan = np.nan
        np.testing.assert_allclose(factor, [[0, nan], [nan, solved], [nan, 0]], rtol=ROUNDING)
        value = result["brf"].values[band]
        assert np.isfinite(value).tolist() == [[False, False], [False, True], [False, False]]


def test_flags_of_a_scene_are_those_of_its_states(warm_model, make_warm):
    """Crystals far smaller than any fit covers, in one column of a scene and of its states."""
    warm_model["ice_effective_radius"][:, 1, 1] = 2e-6
    made = make_warm(warm_model)
    result = simulate(made, **OPTIONS)
    flags = result["quality_flag"].values
    assert flags.dtype == np.uint8
    outside = (flags & QUALITY_FLAGS["outside_fit"]) > 0
    assert outside.tolist() == [[False, False], [False, True], [False, False]]
    share = result["outside_fitted_range"].values.max(axis=0)
    np.testing.assert_array_equal(outside, share > LARGEST_SHARE_OUTSIDE)
    states = column_states(made, ("C03", "C07"))
    np.testing.assert_array_equal(flags.ravel(), quality_flags(states, ("C03", "C07")))


def test_a_scene_by_night_is_dark(make_model):
    night = make_model(land_mask=None).assign_coords(time=np.datetime64("2007-10-23T08:00", "ns"))
    made = scenario(night, ocean_albedo=0.06, bands=("C01",))
    assert (made["quality_flag"] == QUALITY_FLAGS["night"]).all()
    result = simulate(made, **OPTIONS)
    assert (result["reflectance_factor"] == 0).all() and np.isnan(result["brf"]).all()
    assert (result["rayleigh_optical_depth"] > 0.1).all()


@pytest.fixture
def warm_model(make_model):
    """A model with ice, rain and gases."""
    particles = {"rain_mixing_ratio": 1e-4, "rain_number_mixing_ratio": 1e3}
    particles |= {"ice_mixing_ratio": 1e-5, "ice_effective_radius": 3e-5}
    ground = {"surface_temperature": 295.0, "land_mask": None}
    return make_model(vapour_mixing_ratio=4e-3, **particles, **ground)


@pytest.fixture
def make_warm():
    """Builder of its scene in a band of sunlight and in C07."""
    options = {"ocean_albedo": 0.06, "emissivity": 0.95, "satellite": "GOES-18"}
    return lambda model: scenario(model, bands=("C03", "C07"), **options)


@pytest.fixture
def warm(warm_model, make_warm):
    """That scene, its first row by night and a column out of sight."""
    made = make_warm(warm_model)
    made["solar_zenith_angle"][0] = 95.0
    made["quality_flag"][0] = QUALITY_FLAGS["night"]
    made["quality_flag"][2, 1] = QUALITY_FLAGS["out_of_sight"]
    return made


def test_c07_is_simulated_by_day_and_by_night(warm):
    result = simulate(warm, **OPTIONS)
    assert set(OPTIONAL_RESULT) | {"ice_optical_depth", "rain_optical_depth"} < set(
        result.variables
    )
    assert set(result.variables) == variables_of_result(warm)
    assert np.isnan(result["reflectance_factor"].sel(band="C07")).all()
    assert np.isnan(result["brf"].sel(band="C07")).all()
    seen = np.isfinite(result["radiance"].sel(band="C07").values)
    assert seen.tolist() == [[True, True], [True, True], [True, False]]
    np.testing.assert_array_equal(np.isfinite(result["brightness_temperature"]), seen)
    cold = result["brightness_temperature"].values[0]
    assert ((cold > 250) & (cold < 295)).all()
    assert (result["brightness_temperature"].values[1] > cold).all()  # the sun adds to it
    assert (result["radiance"].sel(band="C03").values[0] == 0).all()


def test_radiance_is_the_operators_with_the_sun_of_the_day(warm):
    result = simulate(warm, **OPTIONS)
    distance = sun_distance(warm["time"].values)
    assert distance == pytest.approx(0.9947, abs=2e-4)  # 23 October, by the almanac 0.9946
    options = {"satellite": "GOES-18", "sun_distance": distance, "num_streams": 2}
    by_night_and_day = warm.isel(y=slice(0, 2))
    direct = radiance(column_states(by_night_and_day, ("C03", "C07")), ("C07",), **options)
    ours = result["radiance"].sel(band="C07").values[:2].reshape(4, 1)
    np.testing.assert_allclose(ours, direct, rtol=ROUNDING)
    factor = result["radiance"] / result["reflectance_factor"] * np.pi * distance**2
    by_day = factor.sel(band="C03").values[1]
    np.testing.assert_allclose(by_day, solar_irradiance("C03", "GOES-18"))


def test_gases_can_be_left_out_of_the_simulation(made):
    with_gases, without = simulate(made, **OPTIONS), simulate(made, gases=(), **OPTIONS)
    share = (1 - with_gases["brf"] / without["brf"]).sel
    assert (share(band="C01") > 1e-3).all()  # ozone
    assert (np.abs(share(band="C03")) < ROUNDING).all()  # the air is dry
    assert with_gases.attrs["gases"].split()[0] == "O3" and without.attrs["gases"] == "none"
    with pytest.raises(InputError, match="the scenario has no gases of which H2O could absorb"):
        simulate(made.drop_vars("vapour"), gases=("H2O",), **OPTIONS)


def test_a_run_goes_through_all_times_and_rows(made):
    written = {}
    times = np.array(["2007-10-23T18:00", "2007-10-23T18:30"], "datetime64[ns]")

    def read(time_index, rows):
        block = made.isel(y=rows).assign_coords(time=times[time_index])
        return block.assign_attrs(assumed_droplet_number_count=1)

    def write(time_index, rows, result):
        written[time_index, rows.start] = result

    account = run(read, times, (3, 2), write, block_columns=4, progress=False, **OPTIONS)
    assert account["counted_over"].startswith("2 times, ")
    assert list(written) == [(0, 0), (0, 2), (1, 0), (1, 2)]
    assert account["assumed_droplet_number_count"] == 4
    assert account["num_streams"] == 2
    whole = simulate(made, **OPTIONS)
    for (time_index, start), result in written.items():
        assert result["time"] == times[time_index]
        part = whole.isel(y=slice(start, start + 2))
        np.testing.assert_allclose(result["brf"], part["brf"], rtol=ROUNDING)


def test_a_run_goes_on_where_one_has_ended_early(made, tmp_path, monkeypatch):
    """The same numbers, of nothing that is solved again; other columns or settings are."""
    times = made["time"].values + np.arange(2) * np.timedelta64(15, "m")

    def simulated(parts, albedo=0.0):
        found = {}
        run(
            lambda time, rows: (
                made.assign(surface_albedo=made["surface_albedo"] + albedo * time)
                .isel(y=rows)
                .assign_coords(time=times[time])
            ),
            times,
            (3, 2),
            lambda time, rows, result: found.update({(time, rows.start): result}),
            block_columns=4,
            progress=False,
            parts=parts,
            **OPTIONS,
        )
        return found

    known = simulated(Parts(tmp_path))
    again = Parts(tmp_path)
    solve = importlib.import_module("abi_operator.scene.simulate")
    light, solved = solve.light, []
    monkeypatch.setattr(solve, "light", lambda *x: solved.append(1) or light(*x))
    for place, result in simulated(again).items():
        xr.testing.assert_identical(result, known[place])
    assert again.num_found == 4 and not solved
    simulated(again, albedo=1e-15)  # the second time is another
    assert (again.num_found, len(solved)) == (6, 2)
    names = {part_name(x, {"num_streams": n}) for x in (made, made.isel(y=[0])) for n in (2, 4)}
    assert len(names | {part_name(made.assign_attrs(sun_path="flat"), {"num_streams": 2})}) == 5


def test_a_listener_hears_of_columns_as_they_are_solved(made):
    listener = Heard()
    night = made.assign(quality_flag=made["quality_flag"].copy())
    night["quality_flag"][0] |= QUALITY_FLAGS["night"]
    simulate(night, listener=listener, **OPTIONS)
    assert sum(listener.columns) == 4


def test_a_run_shows_how_far_it_is(made, monkeypatch):
    terminal = io.StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(sys, "stderr", terminal)
    times, options = made["time"].values[None], {"block_columns": 4} | OPTIONS
    run(lambda _, rows: made.isel(y=rows), times, (3, 2), lambda *_: None, **options)
    assert " 0/6 " in terminal.getvalue() and " 6/6 " in terminal.getvalue()


def test_blocks_of_rows_cover_a_scene():
    assert row_blocks((5, 10), 20) == [slice(0, 2), slice(2, 4), slice(4, 5)]
    assert row_blocks((2, 10), 5) == [slice(0, 1), slice(1, 2)]
    assert row_blocks((2, 10), 1000) == [slice(0, 2)]


def test_a_low_sun_shines_through_a_sphere_and_the_result_says_so(made):
    """One column has the sun at 75 degrees: the others, in its company, stay as they were."""
    made["solar_zenith_angle"][:] = 50.0
    assert not column_states(made, ("C01",)).geometry.spherical
    made["solar_zenith_angle"][1, 1] = 75.0
    sphere = simulate(made, **OPTIONS)
    flat = simulate(made.assign_attrs(sun_path="flat"), **OPTIONS)
    assert (sphere.attrs["sun_path"], flat.attrs["sun_path"]) == ("spherical", "flat")
    gain = (sphere["brf"] / flat["brf"] - 1).sel(band="C01").values
    assert 3e-3 < gain[1, 1] < 1e-2
    gain[1, 1] = 0
    np.testing.assert_allclose(gain, 0, atol=ROUNDING)
    for result, spherical in ((sphere, True), (flat, False), (flat.drop_attrs(), False)):
        assert column_states(result, ("C01",)).geometry.spherical is spherical
    np.testing.assert_allclose(simulate(sphere, **OPTIONS)["brf"], sphere["brf"], rtol=ROUNDING)
    with pytest.raises(InputError, match="sun path 'round' is not known; choose from spherical"):
        column_states(made.assign_attrs(sun_path="round"), ("C01",))
