"""Scores of a retrieval against the truth in the result it was made from, as a plain table."""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from abi_operator.files import InputError

from ..fire_detection import DETECTED
from ..fires import SCORE
from ..results import ResultCode, expected_error
from .detection import Detection, detection
from .held import SHARES, intervals_held
from .metrics import Score, binned_scores, score
from .truths import first_of, known_truths

AOD_EDGES = (0.0, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, np.inf)
"""Bins of true optical depth. [-]"""
ALBEDO_EDGES = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 1.0)
"""Bins of surface albedo in C02, or in the first band where that was not used. [-]"""
SUN_EDGES = (0.0, 30.0, 45.0, 60.0, 70.0, 80.0, 90.0, 180.0)
"""Bins of solar zenith angle. [degree]"""
THICKNESS_EDGES = (0.0, 1.0, 3.0, 10.0, 30.0, 150.0)
"""Bins of the optical thickness of cloud. [-]"""
TEMPERATURE_EDGES = (0.0, 500.0, 600.0, 700.0, 800.0, 1000.0, np.inf)
"""Bins of the temperature of fires. [K]"""

PLUME_AOD = 0.05
"""Optical depth from which there is a plume to be detected: the expected error of none. [-]"""
PLUME_DETECTED = 2.0
"""Optical depth in posterior standard deviations from which a plume is detected. [-]"""

_HEADS = ("", "N", "bias", "rmse", "max", "r", "slope", "inside EE", "68 %", "95 %", "chi2")
# Codes of pixels that were not attempted.
_NOT_ATTEMPTED = (
    ResultCode.NO_PLUME,
    ResultCode.UNUSABLE,
    ResultCode.INVALID_INPUT,
    ResultCode.TOO_FEW_BANDS,
)


def score_retrieval(result: xr.Dataset, retrieval: xr.Dataset) -> xr.Dataset:
    """Score the pixels that were retrieved with success and whose truth is known.

    Parameters
    ----------
    result, retrieval
        A result, which holds the truth, and what `retrieve_kind` made of it.

    Returns
    -------
    xarray.Dataset
        By ``group``, the numbers of `metrics.Score`: of the first quantity that was retrieved all,
        bins of its true value, of surface albedo and of the sun; of what else was retrieved and is
        known (single-scattering albedo by band, effective radius of cloud, share of a fire) the
        same under its name. By ``code``, ``code_count`` and ``code_share`` among pixels attempted
        or refused for another reason than the mask. By ``detection``, the numbers of
        `detection.Detection`, of fires and, where pixels without plume were attempted, of plumes.
        ``interval_held``, by ``quantity`` and ``share``, is how often its intervals hold the truth,
        where the retrieval has diagnostics.
    """
    kind = str(retrieval.attrs.get("kind", "smoke"))
    first = first_of(kind)
    truths = known_truths(result, kind)
    codes = retrieval["result_code"].values
    if truths[first].shape != codes.shape:
        raise InputError(
            f"the retrieval has the shape {codes.shape} but the result {truths[first].shape}; "
            "give the retrieval of this result."
        )
    success = codes == ResultCode.SUCCESS
    bins = _bins(result, retrieval, truths[first].values, first)
    scores: dict[str, Score] = {}
    for name, truth in truths.items():
        if name != first and name not in retrieval:
            continue
        label = "" if name == first else name
        allowed = expected_error if name == "aod_550" else None
        if "band" not in truth.dims:
            values = [_values(retrieval, name + end, codes.shape) for end in ("", "_sigma")]
            scores |= _scores(label, values, truth.values, success, bins, allowed)
            continue
        for band in retrieval["band"].values:
            values = [_values(retrieval, name + end, codes.shape, band) for end in ("", "_sigma")]
            found = _scores(
                f"{label} {band}", values, truth.sel(band=band).values, success, bins, allowed
            )
            scores |= found
    report = xr.Dataset(_by_group(scores) | _by_code(codes))
    held = intervals_held(retrieval, truths, success)
    if held:
        report = report.assign_coords(quantity=list(held), share=list(SHARES)).assign(
            interval_held=(("quantity", "share"), np.array(list(held.values())))
        )
    found = detected(result, retrieval, kind)
    if found is None:
        return report
    names = ("detection", list(Detection._fields))
    return report.assign_coords(detection=names).assign(
        detection_value=("detection", np.array(found, float))
    )


def detected(result: xr.Dataset, retrieval: xr.Dataset, kind: str) -> Detection | None:
    """How well the pixels with a fire or plume were told from the others.

    The score of a fire is ``fire_detection_score``, of every pixel that has one; that of a plume is
    its optical depth in posterior standard deviations, of the pixels that were attempted, where
    a plume is an optical depth of `PLUME_AOD` or more.

    Returns
    -------
    None of cloud, and where all that was attempted has a plume.
    """
    if kind == "fire":
        values = retrieval[SCORE].values
        looked = ~np.isnan(values)
        burns = result["fire_fraction"].values > 0
        threshold = float(retrieval.attrs.get("detection_threshold", DETECTED))
        return detection(values[looked], burns[looked], threshold)
    if kind == "cloud" or "aod_550" not in retrieval:
        return None
    looked = ~np.isin(retrieval["result_code"].values, _NOT_ATTEMPTED)
    there = result[f"{kind}_aod_550"].values[looked] >= PLUME_AOD
    if there.all():
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = (retrieval["aod_550"] / retrieval["aod_550_sigma"]).values[looked]
    return detection(np.where(np.isnan(ratio), -np.inf, ratio), there, PLUME_DETECTED)


def _values(
    retrieval: xr.Dataset, name: str, shape: tuple[int, ...], band: str | None = None
) -> np.ndarray:
    """A variable of a retrieval, NaN where no pixel was attempted."""
    if name not in retrieval:
        return np.full(shape, np.nan)
    found = retrieval[name]
    return found.values if band is None else found.sel(band=band).values


Bins = Mapping[str, tuple[np.ndarray, tuple[float, ...]]]


def _bins(result: xr.Dataset, retrieval: xr.Dataset, truth: np.ndarray, first: str) -> Bins:
    """What is binned by, of every pixel, and the edges."""
    bands = str(retrieval.attrs["bands"]).split()
    band = "C02" if "C02" in bands else bands[0]
    edges = {
        "cloud_optical_thickness": THICKNESS_EDGES,
        "fire_temperature": TEMPERATURE_EDGES,
    }.get(first, AOD_EDGES)
    albedo = np.broadcast_to(result["surface_albedo"].sel(band=band).values, truth.shape)
    bins = {first: (truth, edges), f"albedo {band}": (albedo, ALBEDO_EDGES)}
    if "solar_zenith_angle" in result:
        bins["sun"] = (np.broadcast_to(result["solar_zenith_angle"], truth.shape), SUN_EDGES)
    return bins


def _scores(
    label: str,
    values: list[np.ndarray],
    truth: np.ndarray,
    success: np.ndarray,
    bins: Bins,
    allowed: object,
) -> dict[str, Score]:
    """Scores of one quantity: all of it, and by bins."""
    rows = success & np.isfinite(truth)
    retrieved, sigma = (x[rows] for x in values)
    true = truth[rows]
    how = expected_error if allowed is expected_error else None
    scores = {label or "all": score(retrieved, true, how, sigma)}
    for name, (by, edges) in bins.items():
        prefix = f"{label}: {name}" if label else name
        labels = [f"{prefix} {low:g}-{high:g}" for low, high in zip(edges, edges[1:], strict=False)]
        found = binned_scores(retrieved, true, by[rows], edges, how, sigma)
        scores |= dict(zip(labels, found, strict=True))
    return scores


def _by_group(scores: dict[str, Score]) -> dict[str, tuple[str, list]]:
    columns = zip(*scores.values(), strict=True)
    numbers = {name: ("group", list(c)) for name, c in zip(Score._fields, columns, strict=True)}
    return {"group": ("group", list(scores))} | numbers


def _by_code(codes: np.ndarray) -> dict[str, tuple[str, object]]:
    judged = [code for code in ResultCode if code is not ResultCode.NO_PLUME]
    counts = np.array([np.count_nonzero(codes == code) for code in judged])
    return {
        "code": ("code", [code.name.lower() for code in judged]),
        "code_count": ("code", counts),
        "code_share": ("code", counts / max(1, counts.sum())),
    }


def format_report(report: xr.Dataset) -> str:
    """Write a report as text: scores by group, then result codes and detection.

    Empty groups are left out, and the bins of other quantities than the first; the file of the
    scores has them.
    """
    rows: list[tuple[str, ...]] = [_HEADS]
    for group in report["group"].values:
        values = Score(*(report[name].sel(group=group).item() for name in Score._fields))
        if values.num_pairs and ": " not in str(group):
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
    if "quantity" in report.coords:
        for name in report["quantity"].values:
            held = report["interval_held"].sel(quantity=name).values
            shares = (f"{100 * x:.1f} in that of {y} %" for x, y in zip(held, SHARES, strict=True))
            lines.append(f"intervals of {name}: of 100 truths {', '.join(shares)}")
    if "detection" in report.coords:
        lines.append(_sentence(Detection(*report["detection_value"].values)))
    return "\n".join(lines)


def _sentence(found: Detection) -> str:
    return (
        f"detection, score {found.threshold:g} or more: {100 * found.hit_rate:.1f} % of "
        f"{found.num_true:.0f} pixels hit, false alarms on {100 * found.false_alarm_rate:.2f} % of "
        f"{found.num_pixels - found.num_true:.0f} others, ROC area {found.roc_area:.4f}"
    )


def _cells(values: Score) -> tuple[str, ...]:
    """Cells of a row after its first one."""
    errors = (f"{x:.1e}" for x in (values.bias, values.rmse, values.max_error))
    shares = (values.within, values.coverage_68, values.coverage_95)
    return (
        str(values.num_pairs),
        *errors,
        f"{values.correlation:.3f}",
        f"{values.slope:.3f}",
        *(f"{100 * x:.1f} %" for x in shares),
        f"{values.chi_square:.2f}",
    )
