"""Tables of the experiments."""

import numpy as np
import xarray as xr

from retrievals.experiments import format_table
from retrievals.experiments.tables import score_variables


def test_scores_by_case_leave_out_what_did_not_converge():
    truth = np.linspace(0.0, 1.0, 4)
    retrieved = truth + np.array([[0.1, -0.1, 0.1, -0.1], [0.3, 0.3, 0.3, np.nan]])
    sigma = np.full((2, 4), 0.2)
    found = xr.Dataset(score_variables(retrieved, truth, sigma, ("case",), "K", "t_"))
    np.testing.assert_array_equal(found["t_num_pixels"], [4, 3])
    np.testing.assert_allclose(found["t_bias"], [0, 0.3], atol=1e-15)
    np.testing.assert_allclose(found["t_rmse"], [0.1, 0.3])
    np.testing.assert_array_equal(found["t_coverage_68"], [1, 0])
    np.testing.assert_allclose(found["t_chi_square"], [0.25, 2.25])
    assert found["t_rmse"].attrs["units"] == "K"
    mixed = score_variables(retrieved, truth, sigma, ("case",), None)
    assert "units" not in mixed["bias"][2] and "unit of each" in mixed["bias"][2]["long_name"]
    assert mixed["chi_square"][2]["units"] == "1"


def test_a_table_has_a_line_for_each_case():
    table = xr.Dataset(
        {
            "rmse": (("ground", "known"), [[0.12345, 2.0], [3.0, 4.0]], {"units": "K"}),
            "count": ("ground", [7, 8]),
            "map": (("ground", "y"), np.zeros((2, 3))),
        },
        {"ground": ["land", "sea"], "known": ["a", "b"]},
        {"rows": "ground known"},
    )
    lines = [line.split() for line in format_table(table).split("\n")]
    assert lines[0] == ["ground", "known", "rmse", "[K]", "count"]
    assert lines[1:3] == [["land", "a", "0.1235", "7"], ["land", "b", "2", "7"]]
    assert lines[4] == ["sea", "b", "4", "8"]
