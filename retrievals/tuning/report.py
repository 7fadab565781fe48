"""What is said of a comparison and a fit: tables as text and as CSV."""

import numpy as np
import xarray as xr

from .comparison import STATISTICS

_SHOWN = ("count", "observed_mean", "bias", "rmse", "correlation", "slope", "percentile_5")
_SHOWN += ("percentile_50", "percentile_95")


def report_lines(found: xr.Dataset) -> list[str]:
    """The printed report: the comparison, then the numbers that were fitted, then the misfit."""
    lines = [*_observation_lines(found), *comparison_table(found)]
    if "element" in found.dims:
        lines += ["", *numbers_table(found), *_correlations(found), *band_table(found)]
        lines += ["", *_caveats(found), str(found.attrs["misfit"])]
    return lines


def _observation_lines(found: xr.Dataset) -> list[str]:
    about = found.attrs
    how = "" if about["regridding"] == "none" else f", regridded: {about['regridding']}"
    lines = [f"observed: {about['observed_variables']} of {about['observed_files']}{how}"]
    if "of MODIS" in about["observed_variables"]:
        lines.append(
            "bands of MODIS stand for those of ABI: centres of 0.469, 0.645, 0.858 and 2.130 um "
            "for 0.471, 0.640, 0.864 and 2.243; what that makes is not corrected"
        )
    return lines


def comparison_table(found: xr.Dataset) -> list[str]:
    """Statistics of reflectance factors, simulated minus observed, a row for each region."""
    rows = [["band", "region", "stage", *_SHOWN]]
    for band in found["band"].values:
        for region in found["region"].values:
            for stage in found["stage"].values:
                at = {"band": band, "region": region, "stage": stage}
                count = int(found["count"].sel(at))
                if count == 0 or (stage == "tuned" and region == "outside"):
                    continue
                numbers = [_short(float(found[name].sel(at))) for name in _SHOWN[1:]]
                rows.append([str(band), str(region), str(stage), str(count), *numbers])
    return aligned(rows, left=3)


def numbers_table(found: xr.Dataset) -> list[str]:
    """Each number with its error, its prior and what tells it."""
    bands = [str(band) for band in found["band"].values]
    rows = [
        ["", "value", "1 sigma", "unit", "before", "prior sigma", "told"]
        + [f"sigma of {band} alone" for band in bands]
    ]
    for name in found["element"].values:
        one = found.sel(element=name)
        alone = [_short(float(x)) for x in one["band_sigma"].values]
        cells = [
            _number(float(one["value"]), float(one["sigma"])),
            f"{float(one['sigma']):.2g}",
            str(one["element_units"].item()),
            f"{float(one['prior_value']):.4g}",
            f"{float(one['prior_sigma']):.2g}",
            f"{100 * float(one['told']):.1f} %",
        ]
        rows.append([str(name), *cells, *alone])
    lines = aligned(rows, left=1)
    if "ssa" in found:
        pairs = [
            f"{band} {_number(float(ssa), float(sigma))} +- {float(sigma):.2g}"
            for band, ssa, sigma in zip(
                bands, found["ssa"].values, found["ssa_sigma"].values, strict=True
            )
        ]
        lines.append(f"single-scattering albedo: {', '.join(pairs)}")
    return lines


def _correlations(found: xr.Dataset) -> list[str]:
    names = [str(name) for name in found["element"].values]
    matrix = found["error_correlation"].values
    pairs = [
        f"{names[i]} and {names[j]} {matrix[i, j]:+.2f}"
        for i in range(len(names))
        for j in range(i + 1, len(names))
    ]
    return [f"correlations of the errors: {', '.join(pairs)}"] if pairs else []


def band_table(found: xr.Dataset) -> list[str]:
    """Residuals of each band beside what noise makes of them."""
    names = ("chi_square_of_band", "mean_residual", "neighbours_product")
    rows = [["", "measurements", "reduced chi-square", "mean residual", "neighbours' product"]]
    for band in found["band"].values:
        one = found.sel(band=band)
        cells = [f"{float(one[name]):.3f} +- {float(one[f'{name}_scatter']):.3f}" for name in names]
        rows.append([str(band), str(int(one["count_of_band"])), *cells])
    return ["", "residuals, in standard deviations of noise (+-: what noise has)"] + aligned(
        rows, left=1
    )


def _caveats(found: xr.Dataset) -> list[str]:
    lines = []
    about = found.attrs
    if not about["converged"]:
        lines.append(f"NOT CONVERGED after {about['num_steps']} evaluations of the image")
    if about["not_told"] != "none":
        names = about["not_told"].replace(" ", ", ")
        lines.append(f"not told by these bands, so that the prior stays: {names}")
    if about["second_minimum"] != "none found":
        lines.append(f"a second minimum: {about['second_minimum']} (4 would be two sigma)")
    if about["at_limit"] != "none":
        lines.append(f"at a limit of what it may be: {about['at_limit'].replace(' ', ', ')}")
    if about["misfit_found"] and np.isfinite(about["chi_square"]):
        lines.append(
            "were the misfit noise, errors would be "
            f"{max(1.0, float(about['chi_square'])) ** 0.5:.2g} times as large"
        )
    if "error_budget" in about:
        lines.append(
            f"the observation was simulated within {about['error_budget']} of its value, which is "
            "part of any misfit"
        )
    return lines


def csv_of(found: xr.Dataset) -> str:
    """The comparison as a file has it, all statistics, then the numbers that were fitted."""
    rows = [["band", "region", "stage", *STATISTICS]]
    for band in found["band"].values:
        for region in found["region"].values:
            for stage in found["stage"].values:
                at = {"band": band, "region": region, "stage": stage}
                numbers = [f"{float(found[name].sel(at)):.8g}" for name in STATISTICS]
                rows.append([str(band), str(region), str(stage), *numbers])
    text = "\n".join(",".join(row) for row in rows) + "\n"
    if "element" not in found.dims:
        return text
    names = ("value", "sigma", "prior_value", "prior_sigma", "told")
    rows = [["number", "unit", *names]]
    for name in found["element"].values:
        one = found.sel(element=name)
        numbers = [f"{float(one[x]):.8g}" for x in names]
        rows.append([str(name), str(one["element_units"].item()), *numbers])
    return f"{text}\n" + "\n".join(",".join(row) for row in rows) + "\n"


def aligned(rows: list[list[str]], left: int) -> list[str]:
    """Lines of a table whose first columns are words and whose others are numbers."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return [
        "  ".join(
            cell.ljust(width) if i < left else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def _short(value: float) -> str:
    return f"{value:.4g}"


def _number(value: float, sigma: float) -> str:
    """A value to the second digit of its error."""
    if not (np.isfinite(value) and np.isfinite(sigma) and sigma > 0):
        return _short(value)
    digits = max(0, 1 - int(np.floor(np.log10(sigma))))
    return f"{value:.{digits}f}"
