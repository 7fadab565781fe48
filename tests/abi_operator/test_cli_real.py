"""The command line on a real WRF file."""

import os
from pathlib import Path

import numpy as np
import pytest

from abi_operator import simulation
from abi_operator.files import read_result
from abi_operator.nomenclature import QUALITY_FLAGS


@pytest.mark.slow
@pytest.mark.real
def test_hurricane_katrina(invoke, tmp_path, monkeypatch):
    """All four times of a real WRF file, the first of them at sunrise, in two kinds of band.

    In two blocks of rows, which chunks of one size fill where the whole would need two.
    """
    folder = os.environ.get("ABI_OPERATOR_SAMPLE_DATA")
    if not folder:
        pytest.skip("ABI_OPERATOR_SAMPLE_DATA names no folder of real files")
    wrf = Path(folder) / "wrf_mercator_sample.nc"
    out = tmp_path / "out"
    options = ["--ocean-albedo", 0.06, "--num-streams", 2, "--bands", "C02,C07"]
    options += ["--emissivity", "water"]
    monkeypatch.setattr(simulation, "_BLOCK_COLUMNS", 1152)
    outcome = invoke("simulate", wrf, *options, "--out", out)
    assert outcome.exit_code == 0, outcome.output
    assert "warning: the model has no temperature of the ground" in outcome.stderr
    for name in ("rain", "ice", "snow"):
        assert f"number of {name}, assumed: as the microphysics wsm3 does" in outcome.stdout
    assert len(list(out.glob("C07_*.png"))) == 4
    with read_result(out / "result.nc") as result:
        grazing = (result["quality_flag"] & QUALITY_FLAGS["grazing_sun"]) > 0
        assert grazing.isel(time=0).all() and not grazing.isel(time=slice(1, None)).any()
        assert (result["solar_zenith_angle"] < 90).all()
        red = result.sel(band="C02")
        assert np.isfinite(red["brf"]).all() and np.isfinite(red["reflectance_factor"]).all()
        assert float(red["brf"].min()) > 0 and float(red["brf"].max()) < 1.3
        assert (result["pressure"].isel(level=0) == 0).all()
        assert 45000 < result.attrs["smallest_model_top_pressure"] < 51400
        assert result.attrs["standard_atmosphere"] == "tropical"
        assert result.attrs["unsimulated_condensate_share"] == 0.0
        # Deep cloud is cold at its top, at 500 hPa, and the clear sea is warm.
        temperature = result["brightness_temperature"].isel(time=2)
        snow = result["snow_optical_depth"].sel(band="C02").isel(time=2)
        liquid = result["liquid_optical_depth"].sel(band="C02").isel(time=2)
        deep, clear = snow > 20, (snow + liquid) < 0.01
        assert 255 < float(temperature.where(deep).mean()) < 275
        assert 297 < float(temperature.where(clear).mean()) < 303
