"""The report on a retrieval made up by hand."""

import numpy as np
import pytest
import xarray as xr

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
    assert report.attrs["within_sigma"] == 1
    assert report.attrs["mean_square_of_error_by_sigma"] == pytest.approx(0.25)


def test_the_table_is_plain_text(made_up):
    lines = format_report(score_retrieval(*made_up)).split("\n")
    assert lines[1].split()[:3] == ["all", "3", "1.0e-01"]
    assert "success: 3 pixels, 60.0 %" in lines
    assert "    " + ResultCode.POOR_FIT.message in lines
    assert not any(line.startswith("aod_550 2-inf") for line in lines)


def test_the_retrieval_has_to_be_of_the_result(made_up):
    result, retrieval = made_up
    with pytest.raises(InputError, match="give the retrieval of this result"):
        score_retrieval(result.isel(x=slice(2)), retrieval)
