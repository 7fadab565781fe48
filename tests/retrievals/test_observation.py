"""What is measured, how well, and where it is used."""

import numpy as np
import xarray as xr

from abi_operator.nomenclature import QUALITY_FLAGS
from retrievals.observation import add_noise, noise_sigma, usable
from retrievals.results import ResultCode
from retrievals.smoke import BANDS


def test_noise_meets_the_requirement_and_the_measured_point():
    # SNR 300 at 100 %; C02 at 5 %: found 57 +- 8 (Iacovazzi & Wu 2020)
    np.testing.assert_allclose(1 / noise_sigma(1.0), 300, rtol=2e-3)
    np.testing.assert_allclose(0.05 / noise_sigma(0.05), 57, rtol=2e-2)
    assert noise_sigma(-0.01) == noise_sigma(0.0) == 4.8e-4


def test_noise_is_that_of_its_seed_and_of_its_size():
    clean = xr.DataArray(np.full((100, 100), 0.2), dims=("y", "x"))
    noisy = add_noise(clean, 3)
    np.testing.assert_array_equal(noisy, add_noise(clean, 3))
    assert (noisy != add_noise(clean, 4)).all()
    standardised = (noisy - clean) / noise_sigma(0.2)
    assert abs(standardised.mean()) < 0.04  # 4 standard errors of 10^4 draws
    assert abs(standardised.std() - 1) < 0.03


def test_pixels_are_refused_for_a_reason(simulated):
    image = simulated.copy(deep=True)
    image["reflectance_factor"][1, 0, 0] = np.nan
    image["quality_flag"][0, 1] = QUALITY_FLAGS["grazing_sun"]
    image["quality_flag"][1, 1] = QUALITY_FLAGS["outside_fit"]  # attempted all the same
    image["smoke_brightness"] = image["smoke_brightness"].copy(deep=True)
    image["smoke_brightness"][0, 2] = 0.0
    codes = usable(image, BANDS, "smoke", "plume")
    assert codes[0, 0] == ResultCode.INVALID_INPUT
    assert codes[0, 1] == ResultCode.UNUSABLE
    assert codes[0, 2] == ResultCode.NO_PLUME
    assert (codes.ravel()[3:] == ResultCode.SUCCESS).all()
    assert usable(image, BANDS, "smoke", "all")[0, 2] == ResultCode.SUCCESS
    assert usable(image, ("C01",), "smoke", "plume")[0, 0] == ResultCode.SUCCESS
