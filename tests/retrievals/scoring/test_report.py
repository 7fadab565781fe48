"""The report on a retrieval made up by hand."""

import numpy as np
import pytest
import xarray as xr
from PIL import Image

from abi_operator.files import InputError
from retrievals.results import ResultCode
from retrievals.scoring import format_report, score_retrieval


@pytest.fixture
def made_up():
    """A result and a retrieval of two by three pixels: three successes, two failures, no plume."""
    truth = np.array([[0.04, 0.5, 1.5], [0.2, 0.3, 0.0]])
    codes = np.array([[0, 0, 0], [ResultCode.POOR_FIT, ResultCode.UNUSABLE, ResultCode.NO_PLUME]])
    albedo = np.full((2, 2, 3), 0.3)
    albedo[1] = [[0.04, 0.04, 0.12], [0.1, 0.1, 0.1]]
    result = xr.Dataset(
        {
            "smoke_aod_550": (("y", "x"), truth),
            "surface_albedo": (("band", "y", "x"), albedo),
            "solar_zenith_angle": (("y", "x"), [[20.0, 40.0, 50.0], [50.0, 85.0, 20.0]]),
        },
        coords={"band": ["C01", "C02"]},
    )
    retrieval = xr.Dataset(
        {
            "result_code": (("y", "x"), codes.astype(np.int8)),
            "aod_550": (("y", "x"), np.where(codes == 0, truth + 0.1, np.nan)),
            "aod_550_sigma": (("y", "x"), np.full((2, 3), 0.2)),
        },
        attrs={"bands": "C01 C02"},
    )
    return result, retrieval


def test_groups_and_codes_are_counted(made_up):
    report = score_retrieval(*made_up)
    counts = report["num_pairs"].to_series()
    assert counts["all"] == 3
    assert counts["aod_550 0-0.05"] == counts["aod_550 0.2-0.5"] == counts["aod_550 1-2"] == 1
    assert counts["albedo C02 0-0.05"] == 2 and counts["albedo C02 0.1-0.15"] == 1
    np.testing.assert_allclose(report["bias"].sel(group="all"), 0.1)
    shares = report["code_share"].to_series()
    assert shares["success"] == 0.6 and shares["poor_fit"] == shares["unusable"] == 0.2
    assert "no_plume" not in shares
    assert report["coverage_68"].sel(group="all") == 1
    assert report["chi_square"].sel(group="all") == pytest.approx(0.25)
    assert counts["sun 0-30"] == counts["sun 30-45"] == counts["sun 45-60"] == 1


def test_the_table_is_plain_text(made_up):
    lines = format_report(score_retrieval(*made_up)).split("\n")
    assert lines[1].split()[:3] == ["all", "3", "1.0e-01"]
    assert "success: 3 pixels, 60.0 %" in lines
    assert "    " + ResultCode.POOR_FIT.message in lines
    assert not any(line.startswith("aod_550 2-inf") for line in lines)


def test_intervals_are_judged_by_how_often_they_hold_the_truth(made_up):
    result, retrieval = made_up
    assert "interval_held" not in score_retrieval(result, retrieval)
    found = retrieval["aod_550"]
    moved = {"lower_95": -0.3, "lower_68": -0.2, "upper_68": [-0.15, 0.0, 0.1], "upper_95": 0.2}
    bounds = {
        f"aod_550_{bound}": found + xr.DataArray(np.broadcast_to(by, 3), dims="x")
        for bound, by in moved.items()
    }
    report = score_retrieval(result, retrieval.assign(bounds))  # all are 0.1 above the truth
    np.testing.assert_allclose(report["interval_held"].values, [[2 / 3, 1.0]])
    expected = "intervals of aod_550: of 100 truths 66.7 in that of 68 %, 100.0 in that of 95 %"
    assert expected in format_report(report).split("\n")


def test_what_else_is_known_is_scored_by_the_same_bins(made_up):
    result, retrieval = made_up
    radius = ("y", "x"), np.full((2, 3), 3.0)
    known = result.assign(smoke_effective_radius_um=radius)
    found = retrieval.assign(
        effective_radius_um=(("y", "x"), np.full((2, 3), 3.5)),
        effective_radius_um_sigma=(("y", "x"), np.full((2, 3), 0.4)),
    )
    report = score_retrieval(known, found)
    every = report.sel(group="effective_radius_um")
    assert every["num_pairs"] == 3 and every["bias"] == pytest.approx(0.5)
    assert every["coverage_68"] == 0 and every["coverage_95"] == 1
    assert report["num_pairs"].sel(group="effective_radius_um: albedo C02 0-0.05") == 2
    lines = format_report(report).split("\n")
    assert any(line.startswith("effective_radius_um ") for line in lines)
    assert not any(": albedo" in line for line in lines)


def test_plumes_are_told_from_clear_pixels_that_were_attempted(made_up):
    result, retrieval = made_up
    assert "detection" in score_retrieval(*made_up).dims  # 0.04 is no plume
    thick = result.assign(smoke_aod_550=result["smoke_aod_550"] + 0.1)
    assert "detection" not in score_retrieval(thick, retrieval).dims
    values = score_retrieval(*made_up)["detection_value"].to_series()
    # Attempted are 0.04, 0.5, 1.5 and a failure at 0.2, at ratios of 0.7, 3, 8 and none.
    assert values["num_true"] == 3 and values["num_pixels"] == 4
    assert values["hit_rate"] == pytest.approx(2 / 3) and values["false_alarm_rate"] == 0
    assert values["roc_area"] == pytest.approx(2 / 3)
    retrieval["result_code"][1, 0] = ResultCode.TOO_FEW_BANDS  # not attempted any more
    fewer = score_retrieval(result, retrieval)["detection_value"].to_series()
    assert fewer["num_true"] == 2 and fewer["num_pixels"] == 3 and fewer["hit_rate"] == 1
    retrieval["result_code"][1, 0] = ResultCode.POOR_FIT
    assert "detection, score 2 or more: 66.7 % of 3 pixels hit" in format_report(
        score_retrieval(*made_up)
    )


def test_fires_are_scored_where_they_burn():
    fraction = np.array([[0.0, 1e-3, 1e-2], [0.0, 0.0, 0.0]])
    codes = np.array([[1, 0, 0], [0, 1, 1]])  # one false alarm
    result = xr.Dataset(
        {
            "fire_fraction": (("y", "x"), fraction),
            "fire_temperature": (("y", "x"), np.full((2, 3), 700.0)),
            "surface_albedo": (("band", "y", "x"), np.full((1, 2, 3), 0.1)),
        },
        {"band": ["C05"]},
    )
    retrieval = xr.Dataset(
        {
            "result_code": (("y", "x"), codes.astype(np.int8)),
            "fire_temperature": (("y", "x"), np.full((2, 3), 710.0)),
            "fire_temperature_sigma": (("y", "x"), np.full((2, 3), 20.0)),
            "fire_fraction": (("y", "x"), fraction + 1e-4),
            "fire_detection_score": (("y", "x"), [[0.0, 9.0, 50.0], [4.5, -1.0, np.nan]]),
        },
        attrs={"bands": "C05", "kind": "fire", "detection_threshold": 4.0},
    )
    report = score_retrieval(result, retrieval)
    assert report["num_pairs"].sel(group="all") == 2
    assert report["bias"].sel(group="all") == pytest.approx(10)
    assert report["bias"].sel(group="fire_fraction") == pytest.approx(1e-4)
    values = report["detection_value"].to_series()
    assert values["num_pixels"] == 5 and values["hit_rate"] == 1
    assert values["false_alarm_rate"] == pytest.approx(1 / 3) and values["roc_area"] == 1


def test_pictures_are_drawn_of_what_is_known(made_up, tmp_path):
    pictures = pytest.importorskip("retrievals.scoring.pictures")
    paths = pictures.write_pictures(*made_up, tmp_path)
    assert [path.name for path in paths] == ["aod_550.png", "aod_550_scatter.png"]
    for path in paths:
        with Image.open(path) as picture:
            assert picture.size[0] > 1000
            assert len(np.unique(np.asarray(picture.convert("L")))) > 20  # not a blank sheet


def test_the_retrieval_has_to_be_of_the_result(made_up):
    result, retrieval = made_up
    with pytest.raises(InputError, match="give the retrieval of this result"):
        score_retrieval(result.isel(x=slice(2)), retrieval)
