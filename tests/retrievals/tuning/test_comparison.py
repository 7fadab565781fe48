"""Statistics, histograms and maps of a scene beside what was observed."""

import numpy as np
import pytest

from abi_operator.files import InputError
from retrievals.tuning import compared, report_lines
from retrievals.tuning.comparison import NUM_BINS
from retrievals.tuning.report import csv_of


def test_statistics_are_those_of_the_pixels_of_each_region(image, observe_as):
    factor = image["reflectance_factor"]
    seen = observe_as(1.1 * factor + 0.01)
    seen["reflectance_factor"][0, 0, 0] = np.nan  # missing in C01
    seen["saturated"][1, 1, 1] = 1  # and no value in C02
    half = image["smoke_brightness"].where(image["x"] < 4, 0)
    found = compared(image.assign(smoke_brightness=half), seen)
    assert found["count"].sel(stage="scene", region="all").values.tolist() == [23, 23, 24]
    assert found["count"].sel(stage="scene", region="plume").values.tolist() == [11, 11, 12]
    one = found.sel(stage="scene", band="C03", region="plume")
    own = factor.sel(band="C03").values[:, :4]
    np.testing.assert_allclose(one["bias"], -np.mean(0.1 * own + 0.01), rtol=1e-12)
    np.testing.assert_allclose(one["rmse"], np.sqrt(np.mean((0.1 * own + 0.01) ** 2)), rtol=1e-12)
    np.testing.assert_allclose([one["correlation"], one["slope"]], [1, 1 / 1.1], rtol=1e-12)
    np.testing.assert_allclose(one["percentile_50"], np.median(-0.1 * own - 0.01), rtol=1e-12)
    difference = found["difference"].sel(stage="scene", band="C03")
    np.testing.assert_allclose(difference, -0.1 * factor.sel(band="C03") - 0.01, rtol=1e-12)


def test_histograms_hold_every_pixel_that_counts_once(image, observe_as):
    found = compared(image, observe_as(image["reflectance_factor"], seed=1))
    counts = found["histogram"].sum("bin")
    assert found.sizes["bin"] == NUM_BINS
    assert (counts.sel(region="all") == 24).all() and (counts.sel(region="outside") == 0).all()
    assert list(found["series"].values) == ["scene", "observed"]


def test_the_printed_table_and_the_file_say_the_same(image, observe_as):
    found = compared(image, observe_as(image["reflectance_factor"], seed=1))
    lines = report_lines(found)
    assert lines[0] == "observed: C01 of a.nc"
    rows = [line.split(",") for line in csv_of(found).splitlines()]
    assert len(rows) == 1 + 3 * 3  # bands and regions
    shown = next(line.split() for line in lines if line.startswith("C02") and " plume " in line)
    row = next(row for row in rows if row[:2] == ["C02", "plume"])
    at = rows[0].index("bias")
    assert float(shown[5]) == pytest.approx(float(row[at]), rel=1e-3)


def test_a_scene_that_lacks_something_is_refused(image, observe_as):
    seen = observe_as(image["reflectance_factor"])
    with pytest.raises(InputError, match="no plume of ash"):
        compared(image, seen, species="ash")
    with pytest.raises(InputError, match="has no surface_albedo"):
        compared(image.drop_vars("surface_albedo"), seen)
