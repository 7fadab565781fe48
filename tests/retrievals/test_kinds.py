"""From a Dataset to a Dataset."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from abi_operator.files import InputError
from abi_operator.nomenclature import QUALITY_FLAGS
from retrievals import ResultCode, retrieve_kind, retrieve_smoke
from retrievals.images import how_made, in_one_row
from retrievals.kinds import BANDS

DARK, BRIGHT, CLOUDY = 0, 1, 2  # rows of a scene


def shifted(ssa, shift):
    """Single-scattering albedo with `shift` added to its logit."""
    return 1 / (1 + (1 - ssa) / ssa * np.exp(-shift))


RECOVERED = 1e-3
"""The bar for noise-free recovery: error of optical depth on every pixel called a success."""


def errors(simulated, retrieval):
    error = np.abs(retrieval["aod_550"] - simulated["smoke_aod_550"])
    return error.where(retrieval["result_code"] == ResultCode.SUCCESS)


@pytest.fixture(scope="module")
def retrieval(simulated):
    return retrieve_smoke(simulated)


def test_smoke_is_recovered_over_every_ground(simulated, retrieval):
    assert retrieval["result_code"].dims == ("y", "x")
    codes = retrieval["result_code"]
    assert (codes[[DARK, BRIGHT]] == ResultCode.SUCCESS).all()
    assert (codes[CLOUDY] == ResultCode.SUCCESS).sum() >= 2
    assert errors(simulated, retrieval).max() < RECOVERED
    assert (retrieval["cost"] < 1e-6).all() and (retrieval["num_steps"] > 0).all()
    assert retrieval.attrs["num_streams"] == 2


@pytest.mark.slow
def test_single_scattering_albedo_is_recovered_with_it(make_result):
    simulated = make_result(aod_550=(0.9, 2.0), ssa_shift=0.35)
    truth = simulated["smoke_ssa"].copy()
    known = simulated.assign(smoke_ssa=("band", shifted(truth.values, -0.35)))
    # Bands are told apart by their names, in whichever order they are asked for.
    retrieval = retrieve_smoke(known, retrieve_ssa=True, bands=BANDS[::-1])
    assert retrieval["band"].values.tolist() == list(BANDS[::-1])
    success = retrieval["result_code"] == ResultCode.SUCCESS
    assert success[DARK].all()
    assert errors(simulated, retrieval).max() < RECOVERED
    error = np.abs(retrieval["ssa"] - truth).where(success)
    assert error.max() < RECOVERED and set(retrieval["ssa"].dims) == {"band", "y", "x"}
    assert (retrieval["ssa_sigma"].where(success) > 0).sum() == 3 * success.sum()
    unaware = retrieve_smoke(known)
    assert (unaware["result_code"][DARK] == ResultCode.POOR_FIT).all()
    # Of several starts that end alike the lowest counts, by rounding: some begin where smoke is
    # too thick to be told, from where it takes three rounds.
    assert (unaware["num_steps"][DARK] <= 32).all()


def test_times_and_refusals_keep_their_places(simulated):
    times = np.array(["2007-10-23T18:00", "2007-10-23T19:00"], "datetime64[ns]")
    broken = simulated.copy(deep=True)
    broken["quality_flag"][0, 1] = QUALITY_FLAGS["night"]
    broken["reflectance_factor"][:, 2, 2] = np.nan
    broken["reflectance_factor"][0, 0, 2] = np.nan  # one band of three: it is left out
    both = xr.concat([simulated, broken], xr.DataArray(times, dims="time", name="time"))
    for name in simulated.data_vars:
        if "y" not in simulated[name].dims:
            both[name] = simulated[name]
    retrieval = retrieve_smoke(both)
    assert retrieval["aod_550"].dims == ("time", "y", "x")
    codes = retrieval["result_code"].values
    assert codes[1, 0, 1] == ResultCode.UNUSABLE and codes[1, 2, 2] == ResultCode.INVALID_INPUT
    assert np.isnan(retrieval["aod_550"].values[1, 0, 1])
    assert retrieval["num_steps"].values[1, 0, 1] == 0
    num_values = retrieval["num_values"].values
    assert num_values[1, 0, 2] == 2 and num_values[0, 0, 2] == 3
    codes[1, 0, 1], codes[1, 2, 2] = codes[0, 0, 1], codes[0, 2, 2]
    np.testing.assert_array_equal(codes[0], codes[1])
    np.testing.assert_array_equal(retrieval["time"], times)
    assert errors(both, retrieval).max() < RECOVERED


def test_a_result_of_other_streams_is_fitted_within_its_noise(simulated):
    """Of the solver's own error an exact fit would find a poor one in every pixel."""
    off = 1 + 1e-3 * np.array([1, -1, 1])[:, None, None]
    other = simulated.assign(reflectance_factor=simulated["reflectance_factor"] * off)
    poor = retrieve_smoke(other)["result_code"]
    assert (poor[[DARK, BRIGHT]] == ResultCode.POOR_FIT).all()
    found = retrieve_smoke(other.assign_attrs(num_streams=4), num_streams=2)
    assert found.attrs["num_streams"] == 2
    assert not (found["result_code"] == ResultCode.POOR_FIT).any()
    assert (found["result_code"][DARK] == ResultCode.SUCCESS).sum() >= 3


def test_of_fires_a_scene_reflects_nothing(simulated, retrieval):
    """A result with fires elsewhere is that of sunlight, as it was simulated: without their heat,
    and the ground's."""
    calm = xr.zeros_like(simulated["smoke_brightness"])
    beside = simulated.assign(fire_fraction=calm, fire_temperature=calm + 700.0)
    found = retrieve_smoke(beside)
    np.testing.assert_array_equal(found["aod_550"], retrieval["aod_550"])


def test_nothing_to_attempt_is_a_product_too(simulated):
    clear = simulated.assign(smoke_brightness=xr.zeros_like(simulated["smoke_brightness"]))
    retrieval = retrieve_smoke(clear)
    assert (retrieval["result_code"] == ResultCode.NO_PLUME).all()


def test_cloud_is_where_there_is_water(simulated):
    """Where there is none there is no place for it, whoever asks for every pixel."""
    dry = simulated.assign(liquid_mass_path=0 * simulated["liquid_mass_path"])
    found = retrieve_kind(dry, "cloud", bands=("C02", "C03"), where="all")
    assert (found["result_code"] == ResultCode.NO_PLUME).all()
    assert "cloud needs cloud water" in ResultCode.NO_PLUME.message


def test_what_cannot_be_asked_for_is_named(simulated):
    with pytest.raises(ValueError, match="cannot retrieve 'fog'; choose from smoke, ash, dust, "):
        retrieve_kind(simulated, "fog")
    for kind, where, allowed in (
        ("smoke", "detected", "plume, cloud, all"),
        ("smoke", "", "plume, cloud, all"),
        ("cloud", "plume", "cloud, all"),
        ("fire", "plume", "detected, all"),
    ):
        with pytest.raises(ValueError, match=f"one of {allowed}; got '{where}'"):
            retrieve_kind(simulated, kind, where=where)


def test_noise_is_not_added_twice_and_is_told(simulated, retrieval):
    noisy = simulated.assign_attrs(noise="of the instrument, seed 1", satellite="GOES-16")
    with pytest.raises(InputError, match="the result has noise .of the instrument, seed 1.; retr"):
        retrieve_smoke(noisy, noise=True)
    told = how_made(noisy, ("C01",), 2, False, 0, None, ("aod_550",))
    assert told["noise"] == "of the instrument, seed 1" and told["satellite"] == "GOES-16"
    assert retrieval.attrs["noise"] == "none"


def test_a_low_sun_in_one_image_is_one_of_a_sphere_in_all(columns):
    observations, states = columns[:2]
    low = replace(states, geometry=replace(states.geometry, spherical=True))
    seen, joined = in_one_row([(observations, states), (observations, low)])
    assert joined.geometry.spherical
    assert len(joined.geometry.solar_zenith) == len(seen.measured) == 2 * len(observations.measured)


def test_with_a_radius_nothing_is_assumed_of_the_asymmetry(simulated, monkeypatch):
    monkeypatch.setattr("retrievals.kinds.retrieve_image", lambda *_, **how: how["assumed"])
    assert "asymmetry_shift" in retrieve_kind(simulated, "smoke").names
    known = retrieve_kind(simulated, "smoke", effective_radius=True)
    assert known.names == (*(f"albedo_{band}" for band in BANDS), "height_shift")


def test_what_a_dataset_lacks_is_named(simulated):
    with pytest.raises(InputError, match="no smoke_brightness; simulate a scene with a plume"):
        retrieve_smoke(simulated.drop_vars("smoke_brightness"))
    with pytest.raises(InputError, match="no band C06"):
        retrieve_smoke(simulated, bands=("C01", "C06"))
    with pytest.raises(InputError, match="2 unknowns need as many bands"):
        retrieve_smoke(simulated, bands=("C01",), retrieve_ssa=True)


@pytest.mark.slow
def test_errors_under_noise_are_those_foretold(make_result, scale):
    """Reduced chi-square and coverage over many draws; 600 pixels at full scale."""
    num_columns = max(8, round(200 * scale))
    simulated = make_result(aod_550=tuple(np.linspace(0.3, 2.0, num_columns)))
    retrieval = retrieve_smoke(simulated, noise=True, seed=5)
    success = (retrieval["result_code"] == ResultCode.SUCCESS).values
    success[CLOUDY] = False  # where the forward model is far from linear within the noise
    error = (retrieval["aod_550"] - simulated["smoke_aod_550"]).values[success]
    ratio = error / retrieval["aod_550_sigma"].values[success]
    num = success.sum()
    assert num >= 0.9 * 2 * num_columns
    reduced = retrieval["cost"].values[success].mean() / 2  # three bands, one unknown
    assert abs(reduced - 1) < 4 / np.sqrt(num)  # 4 standard errors; variance 2 * 2 / 2^2 = 1
    assert abs(np.mean(np.abs(ratio) < 1) - 0.683) < 4 * np.sqrt(0.683 * 0.317 / num)
    assert abs(np.mean(ratio**2) - 1) < 4 * np.sqrt(2 / num)
