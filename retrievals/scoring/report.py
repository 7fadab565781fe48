"""Scores of a retrieval against the truth in the result it was made from, as a plain table."""

import jax.numpy as jnp
import numpy as np
import xarray as xr

from abi_operator import LiquidCloud
from abi_operator.files import InputError

from ..declarations import mean_droplet_radius_um, optical_thickness
from ..results import ResultCode, expected_error
from .metrics import Score, binned_scores, score, standardised_spread

AOD_EDGES = (0.0, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, np.inf)
"""Bins of true optical depth. [-]"""
ALBEDO_EDGES = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 1.0)
"""Bins of surface albedo in C02, or in the first band where that was not used. [-]"""

THICKNESS_EDGES = (0.0, 1.0, 3.0, 10.0, 30.0, 150.0)
"""Bins of the optical thickness of cloud. [-]"""

_HEADS = ("", "N", "bias", "rmse", "max", "r", "slope", "inside EE")


def score_retrieval(result: xr.Dataset, retrieval: xr.Dataset) -> xr.Dataset:
    """Score the pixels that were retrieved with success.

    Parameters
    ----------
    result, retrieval
        A result, which holds the truth, and what `retrieve_kind` made of it.

    Returns
    -------
    xarray.Dataset
        By ``group``, the numbers of `metrics.Score`: of the first quantity that was retrieved all,
        bins of its true value, and bins of surface albedo; of what else was retrieved and is known
        (single-scattering albedo by band, effective radius of cloud) all, under its name. By
        ``code``, ``code_count`` and ``code_share`` among pixels attempted or refused for another
        reason than the mask. Mean square and coverage of the first quantity's standardised errors
        are attributes.
    """
    kind = str(retrieval.attrs.get("kind", "smoke"))
    first = "cloud_optical_thickness" if kind == "cloud" else "aod_550"
    edges = THICKNESS_EDGES if kind == "cloud" else AOD_EDGES
    allowed = None if kind == "cloud" else expected_error
    truths = known_truths(result, kind)
    codes = retrieval["result_code"].values
    if truths[first].shape != codes.shape:
        raise InputError(
            f"the retrieval has the shape {codes.shape} but the result {truths[first].shape}; "
            "give the retrieval of this result."
        )
    success = codes == ResultCode.SUCCESS
    nothing = xr.DataArray(np.full(codes.shape, np.nan))  # where no pixel was attempted

    def of(name: str) -> np.ndarray:
        return retrieval.get(name, nothing).values[success]

    retrieved, sigma, truth = of(first), of(f"{first}_sigma"), truths[first].values[success]
    bands = str(retrieval.attrs["bands"]).split()
    band = "C02" if "C02" in bands else bands[0]
    albedo = result["surface_albedo"].sel(band=band).values[success]
    scores = {"all": score(retrieved, truth, allowed)}
    for name, by, bins in ((first, truth, edges), (f"albedo {band}", albedo, ALBEDO_EDGES)):
        labels = [f"{name} {low:g}-{high:g}" for low, high in zip(bins, bins[1:], strict=False)]
        found = binned_scores(retrieved, truth, by, bins, allowed)
        scores |= dict(zip(labels, found, strict=True))
    for name, others in truths.items():
        if name == first or name not in retrieval:
            continue
        if "band" not in others.dims:
            scores[name] = score(of(name), others.values[success], None)
            continue
        for one in retrieval["band"].values:
            found, true = (x.sel(band=one).values[success] for x in (retrieval[name], others))
            scores[f"{name} {one}"] = score(found, true, None)
    report = xr.Dataset(_by_group(scores) | _by_code(codes))
    if success.any():
        square, coverage = standardised_spread(retrieved - truth, sigma)
        report = report.assign_attrs(mean_square_of_error_by_sigma=square, within_sigma=coverage)
    return report


def known_truths(result: xr.Dataset, kind: str) -> dict[str, xr.DataArray]:
    """What a result specifies of the quantities of a retrieval, by name.

    Parameters
    ----------
    result
        A result.
    kind
        One of `KINDS`.

    Raises
    ------
    InputError
        Where it lacks the truth.
    """
    needed = ["liquid_mass_path", "liquid_number_path"] if kind == "cloud" else [f"{kind}_aod_550"]
    missing = [name for name in [*needed, "surface_albedo"] if name not in result.variables]
    if missing:
        raise InputError(
            f"the result has no {', '.join(missing)}; give the one that the retrieval was made of, "
            "with all of its variables."
        )
    if kind != "cloud":
        truths = {"aod_550": result[f"{kind}_aod_550"]}
        if f"{kind}_ssa" in result:
            truths["ssa"] = _everywhere(result[f"{kind}_ssa"], truths["aod_550"])
        return truths
    mass, number = (
        result[name].transpose(..., "layer") for name in ("liquid_mass_path", "liquid_number_path")
    )
    cloud = LiquidCloud(jnp.asarray(mass.values, float), jnp.asarray(number.values, float))
    image = mass.isel(layer=0, drop=True)
    return {
        "cloud_optical_thickness": image.copy(data=np.asarray(optical_thickness(cloud))),
        "cloud_effective_radius_um": image.copy(data=np.asarray(mean_droplet_radius_um(cloud))),
    }


def _everywhere(by_band: xr.DataArray, image: xr.DataArray) -> xr.DataArray:
    """A variable (band,) at every pixel of an image."""
    return by_band if "y" in by_band.dims else by_band.broadcast_like(image)


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
