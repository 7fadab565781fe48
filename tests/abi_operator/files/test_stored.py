"""What a result's file keeps, and how exactly."""

import numpy as np
import pytest
import xarray as xr

from abi_operator.files import InputError, check_variables, rounded, stored

DIMS = {
    "reflectance_factor": ("band", "y", "x"),
    "radiance": ("band", "y", "x"),
    "pressure": ("level", "y", "x"),
    "ice_mass_path": ("layer", "y", "x"),
    "solar_zenith_angle": ("y", "x"),
    "smoke_aod_550": ("y", "x"),
    "smoke_ssa": ("band",),
    "smoke_base": (),
}
SIZES = {"band": 2, "layer": 3, "level": 4, "y": 2, "x": 5}
DOUBLE = {"reflectance_factor", "solar_zenith_angle", "smoke_aod_550", "smoke_ssa", "smoke_base"}


@pytest.fixture
def result():
    rng = np.random.default_rng(3)
    values = {n: (dims, rng.uniform(size=[SIZES[d] for d in dims])) for n, dims in DIMS.items()}
    position = {n: (("y", "x"), rng.uniform(size=(2, 5))) for n in ("latitude", "longitude")}
    coords = position | {"band": ["C01", "C02"], "band_wavelength": ("band", [0.47, 0.64])}
    flag = ("y", "x"), np.zeros((2, 5), np.uint8)
    dataset = xr.Dataset(values | {"quality_flag": flag}, coords)
    dataset["radiance"].attrs["units"] = "W"
    return dataset


def doubles(dataset):
    return {name for name in dataset.data_vars if dataset[name].dtype == np.float64}


def test_all_is_kept_and_most_of_it_in_single_precision(result):
    kept = stored(result)
    assert set(kept.variables) == set(result.variables)
    assert doubles(kept) == DOUBLE
    assert kept["quality_flag"].dtype == np.uint8 and kept["latitude"].dtype == np.float32
    assert kept["radiance"].attrs == {"units": "W"}


def test_what_was_rounded_is_kept_to_the_last_digit(result):
    exact = rounded(result)
    kept = stored(exact)
    assert (exact["pressure"] != result["pressure"]).any()
    for name in result.variables:
        np.testing.assert_array_equal(kept[name], exact[name])
        if name in DOUBLE:
            np.testing.assert_array_equal(exact[name], result[name])
    assert doubles(exact) == doubles(result)


def test_an_image_has_no_layers_and_is_in_single_precision(result):
    kept = stored(result, ("image",))
    assert set(result.variables) - set(kept.variables) == {"pressure", "ice_mass_path"}
    assert doubles(kept) == {"smoke_ssa", "smoke_base"}  # a few numbers


def test_names_bring_places_bands_and_flags_with_them(result):
    kept = stored(result, ("smoke_aod_550",))
    places = {"latitude", "longitude", "band", "band_wavelength", "quality_flag"}
    assert set(kept.variables) == {"smoke_aod_550", *places}
    assert doubles(kept) == set()
    assert set(stored(result, ("latitude", "quality_flag")).data_vars) == {"quality_flag"}


def test_names_that_there_are_not_are_refused(result):
    with pytest.raises(InputError, match="has no brf; choose of .*, radiance, reflectance_factor"):
        stored(result, ("radiance", "brf"))
    with pytest.raises(InputError, match=r"variables \['radiances'\] are not .* give all, image"):
        check_variables(["radiances", "brf"])
    with pytest.raises(InputError, match=r"variables \['all'\] are not"):
        check_variables(["all", "brf"])
    assert check_variables(["radiance", "smoke_aod_550"]) == ("radiance", "smoke_aod_550")
