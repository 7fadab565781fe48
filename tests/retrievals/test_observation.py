"""What is measured, how well, and where it is used."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy
import xarray as xr

from abi_operator.instrument import (
    NOISE,
    Imager,
    observe_mean,
    reflectance_factor_from_radiance,
)
from abi_operator.nomenclature import QUALITY_FLAGS
from abi_operator.planck import in_band_radiance
from abi_operator.satellites import packing
from retrievals.kinds import BANDS
from retrievals.observation import (
    Observation,
    add_noise,
    ceiling,
    measurement,
    noise_sigma,
    observe,
)
from retrievals.results import ResultCode
from retrievals.usable_pixels import usable


@jax.jit
def residual_of(observation, predicted):
    """As retrievals ask it: one program, and not one for every operation."""
    return observation.residual(predicted)


@jax.jit
def slope_of(observation, predicted, along):
    """The residual and its slope along a direction."""
    return jax.jvp(observation.residual, (predicted,), (along,))


def test_noise_meets_the_requirement_and_the_measured_point():
    # SNR 300 at 100 %; C02 at 5 %: found 57 +- 8 (Iacovazzi & Wu 2020)
    np.testing.assert_allclose(1 / noise_sigma(1.0, "C02"), 300, rtol=2e-3)
    np.testing.assert_allclose(0.05 / noise_sigma(0.05, "C02"), 57, rtol=2e-2)
    np.testing.assert_allclose(noise_sigma([-0.01, 0.0], "C01"), 4.8e-4, rtol=1e-12)
    # C07: 0.1 K at 300 K, whatever the radiance
    hotter = in_band_radiance(jnp.asarray(300.05), "C07") - in_band_radiance(
        jnp.asarray(299.95), "C07"
    )
    np.testing.assert_allclose(noise_sigma([0.1, 5.0], "C07"), hotter, rtol=1e-6)


def test_noise_is_that_of_its_seed_and_of_its_size():
    clean = xr.DataArray(
        np.full((2, 100, 100), 0.2), dims=("band", "y", "x"), coords={"band": ["C01", "C02"]}
    )
    noisy = add_noise(clean, 3)
    np.testing.assert_array_equal(noisy, add_noise(clean, 3))
    assert (noisy != add_noise(clean, 4)).all()
    assert (noisy[0] != noisy[1]).all()
    standardised = (noisy - clean) / noise_sigma(0.2, "C01")
    assert abs(standardised.mean()) < 0.03  # 4 standard errors of 2 * 10^4 draws
    assert abs(standardised.std() - 1) < 0.02


def test_ceilings_are_those_of_the_instrument():
    imager = Imager(fire_saturation_temperature=400.0)
    for band in ("C05", "C07"):
        seen = observe_mean(jnp.asarray(1e3), band, imager)
        top = seen.radiance if band == "C07" else seen.reflectance_factor
        np.testing.assert_allclose(ceiling(band, imager), top, rtol=1e-12)
    found = measurement([[0.3, 1.3, 50.0], [0.3, 0.5, 0.4]], ("C05", "C06", "C07"), imager)
    np.testing.assert_array_equal(found.saturated, [[False, True, True], [False] * 3])
    np.testing.assert_allclose(found.measured[0, 2], ceiling("C07", imager))
    np.testing.assert_array_equal(found.num_values, [1, 3])


def test_what_was_reported_saturated_is_its_own_bound():
    """Counts round a ceiling down, and rounding in files does: by its size it would be a value."""
    imager = Imager(fire_saturation_temperature=400.0, quantised=True)
    seen = observe_mean(jnp.asarray(50.0), "C07", imager)
    assert seen.saturated and seen.radiance < ceiling("C07", imager)
    values = np.array([[0.3, float(seen.radiance)], [1.3, np.nan]])
    flags = np.array([[False, True], [False, False]])
    found = measurement(values, ("C05", "C07"), imager, saturated=flags)
    np.testing.assert_array_equal(found.saturated, [[False, True], [True, False]])
    np.testing.assert_array_equal(found.measured[:, 1], values[:, 1])
    np.testing.assert_allclose(found.measured[1, 0], ceiling("C05", imager))
    np.testing.assert_array_equal(found.num_values, [1, 0])


def test_an_image_has_the_ceilings_of_its_satellite_and_its_sun():
    """At aphelion a ceiling is the reflectance factor of a weaker sun, which has to be as high."""
    bands, dims = ("C02", "C06"), ("band", "column")
    top = ceiling("C02", Imager("GOES-18"))
    factor = [[1.02 * top, 1.04 * top, 0.5], [0.2, 0.2, 0.2]]
    columns = xr.Dataset(
        {"reflectance_factor": (dims, factor)},
        {"band": list(bands), "time": np.datetime64("2019-07-04T22:00", "ns")},
        {"satellite": "GOES-18"},
    )
    found = observe(columns, bands)
    np.testing.assert_array_equal(found.saturated, [[False] * 2, [True, False], [False] * 2])
    np.testing.assert_allclose(found.measured[1, 0], 1.0167**2 * top, rtol=1e-4)  # [AU]
    assert found.sun_distance is None  # which reflected light does not tell
    reported = columns.assign(saturated=(dims, np.array([[0, 0, 1], [0, 0, 0]], np.int8)))
    found = observe(reported, bands)
    np.testing.assert_array_equal(found.saturated[:, 0], [False, True, True])
    assert found.measured[2, 0] == 0.5
    told = {"noise": "of the instrument, seed 1", "calibration_error": "of the instrument, seed 1"}
    whole = observe(reported.assign_attrs(told | {"quantised": 1}), bands)
    gains = [NOISE.calibration[band] for band in bands]
    steps = [
        reflectance_factor_from_radiance(jnp.asarray(packing(b, "GOES-18").scale), b, "GOES-18")
        for b in bands
    ]
    squares = found.sigma**2 + (gains * found.measured) ** 2 + np.array(steps) ** 2 / 12
    np.testing.assert_allclose(whole.sigma, np.sqrt(squares), rtol=1e-12)


def test_no_noise_changes_what_is_saturated():
    clean = xr.DataArray(np.full((2, 9), 0.3), {"band": ["C01", "C02"]}, ("band", "x"))
    limited = clean.copy(data=np.arange(18).reshape(2, 9) % 2 == 0)
    noisy = add_noise(clean, 3, saturated=limited)
    np.testing.assert_array_equal(noisy == clean, limited)
    np.testing.assert_array_equal(noisy.where(~limited), add_noise(clean, 3).where(~limited))


def test_calibration_and_forward_error_add_in_squares():
    plain = measurement([[0.2, 0.4]], ("C01", "C07"))
    worse = measurement([[0.2, 0.4]], ("C01", "C07"), calibration=True, forward_error=0.04)
    expected = np.hypot(plain.sigma, [[0.05 * 0.2, 0.04 * 0.4]])  # C07 has no error specified
    np.testing.assert_allclose(worse.sigma, expected, rtol=1e-12)


def test_errors_of_a_forward_model_go_together():
    """Residuals are those of a normal distribution with the covariance written out."""
    relative = np.diag([0.02, 0.03, 0.05]) @ np.array([[1, 0.9, 0.4], [0.9, 1, 0.2], [0.4, 0.2, 1]])
    relative = relative @ np.diag([0.02, 0.03, 0.05])
    seen = np.array([[0.2, 0.3, 0.4], [0.1, np.nan, 0.3]])
    plain = measurement(seen, BANDS)
    found = measurement(seen, BANDS, forward_error=relative)
    predicted = np.array([[0.21, 0.29, 0.43], [0.11, 0.2, 0.27]])
    residual = np.asarray(residual_of(found, predicted))
    for row, there in enumerate(np.isfinite(seen)):
        y = seen[row, there]
        S = np.diag(plain.sigma[row, there] ** 2) + np.outer(y, y) * relative[np.ix_(there, there)]
        departure = predicted[row, there] - y
        expected = departure @ np.linalg.solve(S, departure)
        np.testing.assert_allclose(np.sum(residual[row] ** 2), expected, rtol=1e-10)
        np.testing.assert_allclose(found.sigma[row, there] ** 2, np.diagonal(S), rtol=1e-12)
    assert residual[1, 1] == 0
    one = jax.tree.map(lambda leaf: leaf[0], found)  # several guesses of one pixel, as of a scan
    several = residual_of(one, np.stack([predicted[0]] * 2))
    np.testing.assert_allclose(several, np.stack([residual[0]] * 2), rtol=1e-14)
    alone = measurement(seen, BANDS, forward_error=np.zeros((3, 3)))
    found, expected = (residual_of(x, predicted) for x in (alone, plain))
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_missing_bands_do_not_count():
    observation = Observation(
        np.array([0.2, np.nan, 0.3, 0.4]), np.array([0.1, 0.1, np.inf, np.nan])
    )
    predicted = np.array([0.25, 0.2, 0.5, 0.1])
    value, slope = slope_of(observation, predicted, np.ones(4))
    np.testing.assert_allclose(value, [0.5, 0, 0, 0], rtol=1e-12)
    np.testing.assert_allclose(slope, [10, 0, 0, 0], rtol=1e-12)
    assert observation.num_values == 1


def test_a_saturated_band_is_a_lower_bound():
    r"""Twice the cost is -2 ln Phi(z); its slope is that of the normal's hazard, phi / Phi."""
    z = np.array([-20.0, -3.0, -0.5, 0.0, 1.0, 4.0, 30.0])
    observation = Observation(np.full(7, 1.2), np.full(7, 0.01), np.ones(7, bool))
    found = slope_of(observation, 1.2 + 0.01 * z, np.full(7, 0.01))
    residual, slope = (np.asarray(x) for x in found)
    near = z < 6
    expected = -2 * scipy.stats.norm.logcdf(z)
    np.testing.assert_allclose(residual[near] ** 2, expected[near], rtol=1e-9)
    assert residual[-1] ** 2 < 1e-8 and slope[-1] == 0
    hazard = np.exp(scipy.stats.norm.logpdf(z) - scipy.stats.norm.logcdf(z))
    np.testing.assert_allclose((2 * residual * slope)[near], -2 * hazard[near], rtol=1e-9)


def test_what_is_no_number_exceeds_no_bound():
    """A state that is none would end as a success, explained by all of its saturated bands."""
    observation = Observation(np.full(2, 1.2), np.full(2, 0.01), np.ones(2, bool))
    residual = residual_of(observation, np.array([np.nan, 9.0]))
    assert np.isnan(residual[0]) and residual[1] ** 2 < 1e-8


def test_pixels_are_refused_for_a_reason(make_scenario):
    made = make_scenario()
    image = made.assign(reflectance_factor=0 * made["surface_albedo"] + 0.2)
    image["reflectance_factor"][1, 0, 0] = np.nan  # one band of three
    image["reflectance_factor"][:, 1, 0] = np.nan
    image["quality_flag"][0, 1] = QUALITY_FLAGS["grazing_sun"]
    image["quality_flag"][1, 1] = QUALITY_FLAGS["outside_fit"]  # attempted all the same
    image["smoke_brightness"] = image["smoke_brightness"].copy(deep=True)
    image["smoke_brightness"][0, 2] = 0.0
    codes = usable(image, BANDS, "smoke", "plume")
    assert codes[1, 0] == ResultCode.INVALID_INPUT
    assert codes[0, 1] == ResultCode.UNUSABLE
    assert codes[0, 2] == ResultCode.NO_PLUME
    assert (np.delete(codes.ravel(), [1, 2, 4]) == ResultCode.SUCCESS).all()
    assert usable(image, BANDS, "smoke", "all")[0, 2] == ResultCode.SUCCESS
    with pytest.raises(ValueError, match="where must be one of plume, cloud, all; got 'plumes'"):
        usable(image, BANDS, "smoke", "plumes")
