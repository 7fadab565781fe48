"""The albedo reader: kernels to white-sky albedo, MODIS bands to those of ABI, what is missing."""

from pathlib import Path

import netCDF4
import numpy as np
import pytest

from abi_operator.files import InputError, mcd43_layers, read_mcd43a1, read_white_sky
from abi_operator.surface import MODIS_TO_ABI

FILL = 32767
# Rounding of sums of a few float64 numbers of order 1.
ROUNDING = 1e-14


def weights(f_iso, f_vol=0, f_geo=0, shape=(2, 2, 3)):
    """Packed weights, the same everywhere."""
    return np.broadcast_to(np.array([f_iso, f_vol, f_geo], np.int16), (*shape, 3)).copy()


BANDS = {f"Band{n}": weights(100 * n, 50, 10) for n in range(1, 8)}


def white_sky(f_iso, f_vol=0.05, f_geo=0.01):
    return f_iso + 0.189184 * f_vol - 1.377622 * f_geo


def test_albedo_is_white_sky_in_the_bands_of_abi(write_albedo_twin):
    names = ["C06", "C01", "C02", "C03", "green", "C04", "C05"]
    dataset = read_mcd43a1(write_albedo_twin(BANDS), names)
    expected = {
        "C01": 1.0057 * white_sky(0.3),
        "C02": 0.983 * white_sky(0.1) + 0.0018,
        "C03": 1.003 * white_sky(0.2) + 0.0009,
        "green": white_sky(0.4),
        # a third of the way from 1.24 to 1.64 um
        "C04": 0.667 * white_sky(0.5) + 0.333 * white_sky(0.6),
        "C05": -0.045 * white_sky(0.5) + 1.043 * white_sky(0.6) - 0.0021,
        "C06": 0.897 * white_sky(0.7) + 0.0745 * white_sky(0.6) + 0.0033,
    }
    assert list(dataset["band"].values) == names
    albedo = dataset["surface_albedo"]
    assert albedo.dims == ("band", "time", "lat", "lon")
    assert albedo.dtype == np.float64
    for band, value in expected.items():
        np.testing.assert_allclose(albedo.sel(band=band), value, rtol=ROUNDING)


def test_only_the_modis_bands_in_use_are_needed(write_albedo_twin):
    path = write_albedo_twin({"Band3": BANDS["Band3"]})
    assert read_mcd43a1(path, ["C01"]).sizes["band"] == 1


def test_regressions_keep_a_grey_ground_nearly_grey():
    for regression in MODIS_TO_ABI.values():
        assert regression.offset + 0.3 * sum(regression.weights.values()) == pytest.approx(
            0.3, abs=0.01
        )


def test_fill_becomes_nan_and_quality_255(write_albedo_twin):
    packed = weights(300)
    packed[1, 0, 2] = FILL
    dataset = read_mcd43a1(write_albedo_twin({"Band3": packed}), ["C01"]).sel(band="C01")
    missing = np.zeros((2, 2, 3), bool)
    missing[1, 0, 2] = True
    np.testing.assert_array_equal(np.isnan(dataset["surface_albedo"]), missing)
    np.testing.assert_array_equal(dataset["albedo_quality"] == 255, missing)
    assert dataset["surface_albedo"].attrs["num_outside_unit_interval"] == 0


def test_quality_is_the_worst_of_the_bands_in_use(write_albedo_twin):
    quality = {"Band6": np.array([0, 0, 1]), "Band7": np.array([0, 1, 255])}
    quality = {band: np.broadcast_to(q, (2, 2, 3)) for band, q in quality.items()}
    path = write_albedo_twin({b: BANDS[b] for b in ("Band6", "Band7")}, quality=quality)
    flags = read_mcd43a1(path, ["C06"])["albedo_quality"]
    assert flags.dtype == np.uint8
    np.testing.assert_array_equal(flags[0, 0, 0], [0, 1, 255])


def test_quality_is_not_needed(write_albedo_twin):
    """As albedo of any quality is taken; of bands of which some lack theirs none is told."""
    path = write_albedo_twin({b: BANDS[b] for b in ("Band3", "Band6", "Band7")})
    with_quality = read_mcd43a1(path, ["C01", "C06"])
    with netCDF4.Dataset(path, "a") as file:
        name = "BRDF_Albedo_Band_Mandatory_Quality_Band7"
        file.renameVariable(name, f"not_{name}")
    without = read_mcd43a1(path, ["C01", "C06"])
    assert without.identical(with_quality.drop_vars("albedo_quality"))
    assert "albedo_quality" in read_mcd43a1(path, ["C01"])
    assert "albedo_quality" in read_white_sky(path, ["Band6"])
    assert "albedo_quality" not in read_white_sky(path, ["Band6", "Band7"])


def test_albedo_outside_0_to_1_is_made_nan_and_counted(write_albedo_twin):
    packed = weights(300)
    packed[0, 0, 0] = [10, 0, 100]  # -0.128
    packed[0, 0, 1] = [990, 300, 0]  # 1.053
    albedo = read_mcd43a1(write_albedo_twin({"Band3": packed}), ["C01"])["surface_albedo"]
    assert np.isnan(albedo[0, 0, 0, :2]).all()
    assert np.isnan(albedo).sum() == 2
    assert albedo.attrs["num_outside_unit_interval"] == 2


def test_dark_ground_is_black_where_a_regression_falls_below_0(write_albedo_twin):
    """C05 of a black ground is the constant, -0.0021; of 0.1 in Band5 it is -0.0066, too little."""
    band5, band6 = weights(0), weights(0)
    band5[0, 0, 1] = [100, 0, 0]
    band5[0, 0, 2] = [300, 0, 0]
    band6[0, 0, 2] = [300, 20, 10]
    path = write_albedo_twin({"Band5": band5, "Band6": band6})
    dataset = read_mcd43a1(path, ["C05"], kernels=True).sel(band="C05")
    expected = np.zeros((2, 2, 3))
    expected[0, 0, 1] = np.nan
    expected[0, 0, 2] = 1.043 * white_sky(0.3, 0.02, 0.01) - 0.045 * 0.3 - 0.0021
    albedo = dataset["surface_albedo"]
    np.testing.assert_allclose(albedo, expected, rtol=ROUNDING)
    kernel = dataset["volume_kernel_weight"]
    np.testing.assert_array_equal(np.isnan(kernel), np.isnan(expected))
    assert albedo.attrs["num_held_at_zero"] == 10
    assert albedo.attrs["num_outside_unit_interval"] == 1


def test_weights_outside_the_valid_range_are_made_nan_and_counted(write_albedo_twin):
    packed = weights(300)
    packed[0, 1, 1, 1] = -3
    albedo = read_mcd43a1(write_albedo_twin({"Band3": packed}), ["C01"])["surface_albedo"]
    assert np.isnan(albedo).sum() == 1
    assert albedo.attrs["num_outside_valid_range"] == 1


@pytest.mark.parametrize("calendar", ["julian", "standard", "proleptic_gregorian"])
def test_times_are_dates_whatever_the_calendar(write_albedo_twin, calendar):
    path = write_albedo_twin({"Band3": BANDS["Band3"]}, calendar=calendar)
    time = read_mcd43a1(path, ["C01"])["time"]
    assert time.dtype == "datetime64[ns]"
    np.testing.assert_array_equal(time, np.array(["2007-10-15", "2007-10-23"], "datetime64[ns]"))


@pytest.mark.parametrize(
    ("days", "words"),
    [
        (np.nan, "time in .* has 1 missing or non-finite values"),
        (1e18, "time in .* cannot be read as dates"),
        (-1e4, "time in .* has the year 1972, and MODIS flies since 2000; give"),
        (-1e7, "time in .* has the year -25380, and MODIS flies since 2000; give"),
        (1e6, "time in .* has the year 4737, and"),
    ],
)
def test_times_that_are_no_dates_are_refused(write_albedo_twin, days, words):
    path = write_albedo_twin({"Band3": BANDS["Band3"]})
    with netCDF4.Dataset(path, "a") as file:
        attributes = {name: file["time"].getncattr(name) for name in ("units", "calendar")}
        file.renameVariable("time", "days")
        time = file.createVariable("time", "f8", ("time",))
        time.setncatts(attributes)
        time[:] = [2844, days]
    with pytest.raises(InputError, match=words):
        read_mcd43a1(path, ["C01"])


def test_only_the_dates_that_a_scene_has_are_read(write_albedo_twin, monkeypatch):
    """A month of dates would be a month's worth of memory."""
    packed = weights(300, shape=(31, 2, 3))
    packed[..., 0] += np.arange(31, dtype=np.int16)[:, None, None]
    path = write_albedo_twin({"Band3": packed})
    whole = read_mcd43a1(path, ["C01"], kernels=True)
    load, sizes = mcd43_layers.load, []

    def counted(array, path):
        sizes.append(array.size)
        return load(array, path)

    monkeypatch.setattr(mcd43_layers, "load", counted)
    times = whole["time"].values[[9, 4]] + np.array([30, -20], "timedelta64[h]")  # a day from each
    some = read_mcd43a1(path, ["C01"], kernels=True, times=times)
    assert some.identical(whole.isel(time=[4, 9]))
    assert max(sizes) == 2 * 2 * 3 * 3


def test_missing_bands_are_named_and_the_remedy_too(write_albedo_twin):
    path = write_albedo_twin({"vis": weights(100), "nir": weights(200)})
    message = (
        "has no BRDF_Albedo_Parameters_Band3, BRDF_Albedo_Parameters_Band2; "
        r"request these layers of MCD43A1 from AppEEARS, or let its broadband albedo \(vis, nir\) "
        r"stand in for them: --broadband \(in Python, broadband=True\)."
    )
    with pytest.raises(InputError, match=message):
        read_mcd43a1(path, ["C01", "C03"])


@pytest.mark.parametrize(
    ("held", "bands"),
    [
        (("vis",), ["C01", "C03"]),  # nir, which C03 would need, is not there
        (("shortwave",), ["C01"]),
        (("Band4",), ["C01"]),
        (("vis", "nir"), ["C01", "C06"]),  # nothing stands in for C06
    ],
)
def test_broadband_is_suggested_only_where_it_helps(write_albedo_twin, held, bands):
    path = write_albedo_twin(dict.fromkeys(held, weights(100)))
    with pytest.raises(InputError, match="request these layers of MCD43A1 from AppEEARS.$"):
        read_mcd43a1(path, bands)


def test_a_latitude_that_is_none_is_refused(write_albedo_twin):
    path = write_albedo_twin({"Band3": weights(100)}, latitude=(34.0, -999.0))
    with pytest.raises(InputError, match="lat in .* is -999 degrees_north at lat=1 .* -90 to 90"):
        read_mcd43a1(path, ["C01"])


@pytest.mark.parametrize("named", [True, False])
def test_the_projection_of_modis_itself_is_called_by_name(tmp_path, named):
    path = tmp_path / "MCD43A1.nc"
    with netCDF4.Dataset(path, "w") as file:
        for dim in ("time", "YDim", "XDim", "Num_Parameters"):
            file.createDimension(dim, 3)
        for name in ("YDim", "XDim"):
            file.createVariable(name, "f8", (name,))[:] = 463.3 * np.arange(3)
        file.createVariable("lat", "f8", ("YDim", "XDim"))[:] = 40.0
        if named:
            file.createVariable("crs", "i1").grid_mapping_name = "sinusoidal"
    message = "MCD43A1.nc is in sinusoidal projection; request .* with the projection Geographic"
    for read, name in ((read_mcd43a1, "C01"), (read_white_sky, "Band3")):
        with pytest.raises(InputError, match=message):
            read(path, [name])


def test_broadband_stands_in_with_a_warning(write_albedo_twin):
    path = write_albedo_twin({"vis": weights(100), "nir": weights(300), "Band1": weights(150)})
    with pytest.warns(UserWarning) as warned:
        albedo = read_mcd43a1(path, ["C01", "C02", "C03"], broadband=True)["surface_albedo"]
    assert [str(w.message).split("; ")[1] for w in warned] == [
        "the albedo of C01 is that of the broadband vis.",
        "the albedo of C03 is that of the broadband nir.",
    ]
    expected = [0.1, 0.983 * 0.15 + 0.0018, 0.3]
    np.testing.assert_allclose(albedo[:, 0, 0, 0], expected, rtol=ROUNDING)


def test_no_broadband_stands_in_for_c06(write_albedo_twin):
    path = write_albedo_twin({"vis": weights(100), "nir": weights(300)})
    with pytest.raises(InputError, match="Parameters_Band7, .*Parameters_Band6; request"):
        read_mcd43a1(path, ["C06"], broadband=True)


@pytest.mark.parametrize("band", ["C99", "C07"])
def test_a_band_that_modis_does_not_tell_of_is_refused(write_albedo_twin, band):
    with pytest.raises(ValueError, match=band):
        read_mcd43a1(write_albedo_twin(BANDS), [band])


def test_packed_weights_without_a_scale_are_refused(write_albedo_twin):
    path = write_albedo_twin({"Band3": BANDS["Band3"]}, scale_factor=None)
    with pytest.raises(InputError, match="Band3 in .* has no scale_factor"):
        read_mcd43a1(path, ["C01"])


def test_another_number_of_weights_is_refused(write_albedo_twin):
    path = write_albedo_twin({"Band3": BANDS["Band3"][..., :2]})
    with pytest.raises(InputError, match="has 2 kernel weights where 3 are expected"):
        read_mcd43a1(path, ["C01"])


def test_latitude_that_turns_back_is_refused(write_albedo_twin):
    path = write_albedo_twin({"Band3": BANDS["Band3"]}, latitude=(34.0, 34.0))
    with pytest.raises(InputError, match="lat in .* is not monotonic"):
        read_mcd43a1(path, ["C01"])


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match="albedo.nc does not exist"):
        read_mcd43a1(tmp_path / "albedo.nc", ["C01"])


@pytest.mark.real
def test_real_file_with_broadband_and_julian_days(sample_data: Path):
    path = sample_data / "MCD43A1.006_aid0001.nc"
    with pytest.raises(InputError, match="Parameters_Band3; request these layers"):
        read_mcd43a1(path, ["C01"])
    with pytest.warns(UserWarning, match="broadband"):
        dataset = read_mcd43a1(path, ["C01", "C03"], broadband=True)
    albedo = dataset["surface_albedo"]
    assert albedo.shape == (2, 31, 48, 54)
    assert dataset["time"].values[0] == np.datetime64("2001-01-01")
    assert dataset["time"].values[-1] == np.datetime64("2001-01-31")
    # Counts of fill and extremes of white-sky albedo, from the packed numbers with netCDF4.
    np.testing.assert_array_equal(np.isnan(albedo).sum(("time", "lat", "lon")), [220, 639])
    assert float(albedo.sel(band="C01").max()) == pytest.approx(0.113338566, rel=1e-8)
    assert float(albedo.sel(band="C03").min()) == pytest.approx(0.005324288, rel=1e-6)
    assert albedo.attrs["num_outside_unit_interval"] == 0
    np.testing.assert_array_equal(dataset["albedo_quality"] == 255, np.isnan(albedo))


@pytest.mark.real
def test_real_file_has_three_broad_bands(sample_data: Path):
    """Snow-free Texas in January: plants are dark in the visible and bright beyond."""
    path = sample_data / "MCD43A1.006_aid0001.nc"
    names = ["vis", "nir", "shortwave"]
    dataset = read_white_sky(path, names)
    albedo = dataset["white_sky_albedo"]
    assert albedo.shape == (3, 31, 48, 54)
    vis, nir, shortwave = (float(albedo.sel(modis_band=n).median()) for n in names)
    assert 0.02 < vis < shortwave < nir < 0.4
    np.testing.assert_array_equal(dataset["albedo_quality"] == 255, np.isnan(albedo))
    with pytest.raises(InputError, match="no BRDF_Albedo_Parameters_Band7; request"):
        read_white_sky(path, ["vis", "Band7"])


def test_weights_of_kernels_follow_the_same_regressions(write_albedo_twin):
    """Together with the albedo they are the weights of the band, whose white-sky albedo it is."""
    names = ["C01", "C02", "C06"]
    made = read_mcd43a1(write_albedo_twin(BANDS), names, kernels=True)
    volume, geometric = (made[f"{x}_kernel_weight"] for x in ("volume", "geometric"))
    assert volume.dims == made["surface_albedo"].dims
    for band in names:
        share = sum(MODIS_TO_ABI[band].weights.values())
        np.testing.assert_allclose(volume.sel(band=band), 0.05 * share, rtol=ROUNDING)
        np.testing.assert_allclose(geometric.sel(band=band), 0.01 * share, rtol=ROUNDING)
    constant = made["surface_albedo"] - 0.189184 * volume + 1.377622 * geometric
    expected = 0.983 * 0.1 + 0.0018  # of C02, from Band1
    np.testing.assert_allclose(constant.sel(band="C02"), expected, rtol=ROUNDING)
    assert "volume_kernel_weight" not in read_mcd43a1(write_albedo_twin(BANDS), names)
