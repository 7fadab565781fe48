"""A result through the instrument, and pixels of several columns."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

from abi_operator.files import InputError, ResultWriter, read_result
from abi_operator.instrument import (
    IMAGER,
    Imager,
    noise_deviation,
    quantise,
    range_ceiling,
    reflectance_factor_from_radiance,
)
from abi_operator.nomenclature import variable
from abi_operator.planck import brightness_temperature, in_band_radiance
from abi_operator.scene import observed
from abi_operator.scene.angles import sun_distance
from abi_operator.scene.pixels import pixel_means

BANDS = ("C02", "C06", "C07")
TIME = np.datetime64("2019-01-03T18:00", "ns")
SHAPE = (40, 42)


@pytest.fixture
def result():
    """Light of 40 x 42 columns, with one fire, north of the date line."""
    rng = np.random.default_rng(2)
    radiance = rng.uniform([[[50.0]], [[1.0]], [[0.5]]], [[[300.0]], [[8.0]], [[0.8]]], (3, *SHAPE))
    radiance[2, 1, 1] = float(in_band_radiance(jnp.array(500.0), "C07"))
    east = 179.0 + 0.1 * np.arange(SHAPE[1])
    fields = {
        "radiance": radiance,
        "solar_zenith_angle": np.full(SHAPE, 40.0),
        "surface_albedo": rng.uniform(0, 1, radiance.shape),
        "fire_temperature": np.where(radiance[2] > 5, 900.0, np.nan),
        "pressure": np.zeros((2, *SHAPE)),
        "quality_flag": np.where(np.arange(SHAPE[1]) % 7 == 0, 2, 1) * np.ones(SHAPE, np.uint8),
        "latitude": 33 + 0.1 * np.arange(SHAPE[0])[:, None] * np.ones(SHAPE),
        "longitude": (east + 180) % 360 - 180 + np.zeros(SHAPE),
    }
    dataset = xr.Dataset(
        {name: (variable(name).dims, x) for name, x in fields.items()},
        {"band": list(BANDS), "time": TIME},
        {"satellite": "GOES-16"},
    )
    dataset["quality_flag"] = dataset["quality_flag"].astype(np.uint8)
    return dataset.set_coords(["latitude", "longitude"])


def test_what_is_seen_is_limited_and_told(result):
    seen = observed(result, IMAGER)
    ceiling = range_ceiling("C07", "GOES-16")
    expected = np.zeros((3, *SHAPE), bool)
    expected[2, 1, 1] = True
    np.testing.assert_array_equal(seen["saturated"] == 1, expected)
    np.testing.assert_allclose(seen["radiance"].values[2, 1, 1], ceiling)
    np.testing.assert_array_equal(
        seen["radiance"].values[~expected], result["radiance"].values[~expected]
    )
    factor = reflectance_factor_from_radiance(
        jnp.asarray(result["radiance"].values[0]), "C02", "GOES-16", sun_distance(TIME)
    )
    np.testing.assert_allclose(seen["reflectance_factor"].values[0], factor)
    np.testing.assert_allclose(seen["brf"].values[0], factor / np.cos(np.radians(40.0)))
    assert np.isnan(seen["reflectance_factor"].values[2]).all()
    hot = brightness_temperature(jnp.asarray(seen["radiance"].values[2]), "C07")
    np.testing.assert_allclose(seen["brightness_temperature"], hot)
    assert seen["brightness_temperature"].dims == ("y", "x")


def test_c07_may_saturate_earlier(result):
    seen = observed(result, Imager(fire_saturation_temperature=400.0))
    assert float(seen["brightness_temperature"].max()) == pytest.approx(400.0, abs=1e-6)
    assert seen.attrs["fire_saturation_temperature"] == 400.0


def test_noise_is_the_instruments_and_of_the_seed_alone(result):
    """Its standard deviation of 1,680 pixels is known to 1.7 %; four times that is allowed."""
    first, second, other = (observed(result, IMAGER, seed=seed) for seed in (5, 5, 6))
    xr.testing.assert_identical(first, second)
    error = (first["radiance"] - result["radiance"]).values
    for k, band in enumerate(BANDS[:2]):
        light = jnp.asarray(result["radiance"].values[k])
        sigma = noise_deviation(light, band, "GOES-16", IMAGER.noise, sun_distance(TIME))
        assert np.std(error[k] / np.asarray(sigma)) == pytest.approx(1, abs=0.07)
    assert abs(np.corrcoef(error[0].ravel(), error[1].ravel())[0, 1]) < 0.1
    assert not np.allclose(first["radiance"], other["radiance"])
    both = xr.concat([result, result], "time").assign_coords(time=[TIME, TIME])
    series = observed(both, IMAGER, seed=5)["radiance"].values
    assert series.shape == (2, 3, *SHAPE) and not np.allclose(series[0], series[1])


def test_an_error_of_the_calibration_is_one_for_all_pixels(result):
    gain = observed(result, IMAGER, seed=5, calibration=True)["radiance"]
    noise = observed(result, IMAGER, seed=5)["radiance"]
    factors = [(gain.sel(band=b) / noise.sel(band=b)).values for b in BANDS]
    assert abs(factors[0].mean() - 1) > 1e-4 and abs(factors[1].mean() - 1) > 1e-4
    assert np.ptp(factors[0]) < 1e-9 and np.ptp(factors[1]) < 1e-9
    np.testing.assert_allclose(factors[2], 1)  # none is specified


def test_counts_are_those_of_the_files(result):
    seen = observed(result, Imager(quantised=True))["radiance"].values
    counts = quantise(jnp.asarray(result["radiance"].values[0]), "C02", "GOES-16")
    np.testing.assert_allclose(seen[0], counts)


def test_a_column_without_light_stays_without(result):
    """Where the ground has no albedo nothing was simulated; the imager tells nothing there."""
    result["radiance"][:, 20, 20] = np.nan
    seen = observed(result, IMAGER)
    for name in ("radiance", "reflectance_factor", "brf"):
        assert np.isnan(seen[name].values[:, 20, 20]).all(), name
    assert np.isnan(seen["brightness_temperature"].values[20, 20])
    assert not (seen["saturated"].values[:, 20, 20] == 1).any()
    assert np.isfinite(seen["radiance"].values).sum() == 3 * (40 * 42 - 1)


def test_a_pixel_sees_the_mean_before_anything_saturates(result):
    result["radiance"][:, 20, 20] = np.nan  # of which one pixel sees something
    seen = observed(result, IMAGER, footprint=4)
    assert seen.sizes["y"] == 10 and seen.sizes["x"] == 10  # two columns fill no pixel
    blocks = result["radiance"].values[..., :40].reshape(3, 10, 4, 10, 4)
    np.testing.assert_allclose(seen["radiance"], blocks.mean(axis=(2, 4)))
    assert np.isnan(seen["radiance"].values).sum() == 3
    assert not (seen["saturated"] == 1).any()


def test_pixels_have_means_of_all_else(result):
    with jax.enable_x64(True):
        seen = pixel_means(result, 4)
    assert "pressure" not in seen and "fire_temperature" not in seen
    blocks = result["surface_albedo"].values[..., :40].reshape(3, 10, 4, 10, 4)
    np.testing.assert_allclose(seen["surface_albedo"], blocks.mean(axis=(2, 4)))
    np.testing.assert_allclose(seen["longitude"][0, :3], [179.15, 179.55, 179.95])
    turned = seen["longitude"][0] % 360
    np.testing.assert_allclose(turned, 179.15 + 0.4 * np.arange(10))
    # Columns 0, 7, 14, ... have another flag than the rest.
    flags = [1 | 2 * any(x % 7 == 0 for x in range(4 * k, 4 * k + 4)) for k in range(10)]
    np.testing.assert_array_equal(seen["quality_flag"][0], flags)


def test_refusals(result):
    for wrong, options, message in (
        (result.drop_vars("radiance"), {}, "has no radiance"),
        (result.drop_vars("solar_zenith_angle"), {}, "has no solar_zenith_angle"),
        (result, {"footprint": 0}, "a footprint is 1 to 40 columns wide here; got 0"),
        (result, {"footprint": 41}, "got 41"),
        (result, {"calibration": True}, "is drawn by a seed"),
        (observed(result, IMAGER), {}, "was observed before"),
    ):
        with pytest.raises(InputError, match=message):
            observed(wrong, IMAGER, **options)


def test_an_observed_result_is_written_and_read(result, tmp_path):
    seen = observed(result, IMAGER, seed=1, footprint=4)
    with ResultWriter(tmp_path / "seen.nc", times=[TIME], shape=(10, 10)) as writer:
        writer.write(0, slice(None), seen)
    with read_result(tmp_path / "seen.nc") as back:
        np.testing.assert_array_equal(back["radiance"][0], seen["radiance"])
        assert back["saturated"].dtype == np.int8
