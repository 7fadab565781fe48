"""Scores of a retrieval against the truth in the result it was made from, as a plain table."""

import numpy as np
import xarray as xr

from abi_operator.files import InputError

from ..results import ResultCode
from .metrics import Score, binned_scores, score, standardised_spread

AOD_EDGES = (0.0, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, np.inf)
"""Bins of true optical depth. [-]"""
ALBEDO_EDGES = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 1.0)
"""Bins of surface albedo in C02, or in the first band where that was not used. [-]"""

_TRUTH = ("smoke_aod_550", "surface_albedo")
_HEADS = ("", "N", "bias", "rmse", "max", "r", "slope", "inside EE")


def score_retrieval(result: xr.Dataset, retrieval: xr.Dataset) -> xr.Dataset:
    """Score the pixels that were retrieved with success.

    Parameters
    ----------
    result, retrieval
        A result, which holds the truth, and what `retrieve_smoke` made of it.

    Returns
    -------
    xarray.Dataset
        By ``group`` (all, bins of true optical depth, bins of surface albedo), the numbers of
        `metrics.Score`; by ``code``, ``code_count`` and ``code_share`` among pixels attempted or
        refused for another reason than the plume mask. Mean square and coverage of standardised
        errors are attributes.
    """
    missing = [name for name in _TRUTH if name not in result.variables]
    if missing:
        raise InputError(
            f"the result has no {', '.join(missing)}; give the one that the retrieval was made of, "
            "with all of its variables."
        )
    codes = retrieval["result_code"].values
    truth_image = result["smoke_aod_550"].values
    if truth_image.shape != codes.shape:
        raise InputError(
            f"the retrieval has the shape {codes.shape} but the result {truth_image.shape}; "
            "give the retrieval of this result."
        )
    success = codes == ResultCode.SUCCESS
    nothing = np.full(codes.shape, np.nan)  # where no pixel was attempted
    retrieved, sigma = (
        (retrieval[name].values if name in retrieval else nothing)[success]
        for name in ("aod_550", "aod_550_sigma")
    )
    truth = truth_image[success]
    bands = str(retrieval.attrs["bands"]).split()
    band = "C02" if "C02" in bands else bands[0]
    albedo = result["surface_albedo"].sel(band=band).values[success]
    scores = {"all": score(retrieved, truth)}
    for name, by, edges in (
        ("aod_550", truth, AOD_EDGES),
        (f"albedo {band}", albedo, ALBEDO_EDGES),
    ):
        labels = [f"{name} {low:g}-{high:g}" for low, high in zip(edges, edges[1:], strict=False)]
        scores |= dict(zip(labels, binned_scores(retrieved, truth, by, edges), strict=True))
    columns = zip(*scores.values(), strict=True)
    by_group = {name: ("group", list(c)) for name, c in zip(Score._fields, columns, strict=True)}
    judged = [code for code in ResultCode if code is not ResultCode.NO_PLUME]
    counts = np.array([np.count_nonzero(codes == code) for code in judged])
    by_code = {
        "code_count": ("code", counts),
        "code_share": ("code", counts / max(1, counts.sum())),
    }
    names = [code.name.lower() for code in judged]
    report = xr.Dataset(by_group | by_code, coords={"group": list(scores), "code": names})
    if success.any():
        square, coverage = standardised_spread(retrieved - truth, sigma)
        report = report.assign_attrs(mean_square_of_error_by_sigma=square, within_sigma=coverage)
    return report


def format_report(report: xr.Dataset) -> str:
    """Write a report as text: scores by group, empty ones left out, then the result codes."""
    rows: list[tuple[str, ...]] = [_HEADS]
    for group in report["group"].values:
        values = Score(*(report[name].sel(group=group).item() for name in Score._fields))
        if values.num_pairs:
            rows.append((str(group), *_cells(values)))
    widths = [max(len(row[i]) for row in rows) for i in range(len(_HEADS))]
    lines = [
        "  ".join(
            cell.ljust(width) if i == 0 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]
    for code in report["code"].values:
        count, share = (report[f"code_{x}"].sel(code=code).item() for x in ("count", "share"))
        if count:
            lines.append(f"{code}: {count} pixels, {100 * share:.1f} %")
            if code != "success":
                lines.append(f"    {ResultCode[str(code).upper()].message}")
    return "\n".join(lines)


def _cells(values: Score) -> tuple[str, ...]:
    """Cells of a row after its first one."""
    errors = (f"{x:.1e}" for x in (values.bias, values.rmse, values.max_error))
    return (
        str(values.num_pairs),
        *errors,
        f"{values.correlation:.3f}",
        f"{values.slope:.3f}",
        f"{100 * values.within:.1f} %",
    )
