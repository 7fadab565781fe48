"""What is said of the test with the near infrared: a table, whence its numbers come, a picture."""

from os import PathLike
from typing import NamedTuple

import numpy as np
import xarray as xr

from ..drawing import picture_in_natural_colors
from ..products import GREEN_RECIPES, nir_test
from .nir_study import BAND, brf_by_band
from .panels import Panel, change_map, histogram, write_panels
from .ssa_root import FALLS_SHORT, NOT_CONVERGED

PAPER = {1: 2.5, -1: -1.5}
"""What Grasso et al. (2013) report of their ash scene, by the sign of the change. [%]"""
# Shares of near infrared to green between which pixels are told apart. [-]
_RATIOS = (0.0, 0.5, 1.0, 1.5, 2.0, np.inf)


class Row(NamedTuple):
    """Change of green over the pixels that are counted. [%]"""

    what: str
    change: float
    mean: float
    median: float
    lower: float
    upper: float
    pixels: int


def rows_of(study: xr.Dataset) -> list[Row]:
    """A row for every recipe and change: mean, median, 5th and 95th percentile."""
    counted = study["counted"].values > 0
    rows = []
    for recipe in study["recipe"].values:
        for change in study["change"].values:
            field = study["green_change"].sel(recipe=recipe, change=change).values
            rows.append(_row(str(recipe), float(change), field[counted]))
    return rows


def account_of(study: xr.Dataset, image: xr.Dataset) -> list[Row]:
    """Where the numbers of Eq. (1) come from: the same by other ways, and by the kind of pixel."""
    counted = study["counted"].values > 0
    paper = study.sel(recipe="grasso2013")
    ratio = (paper["near_infrared"] / paper["green"]).values
    brf = brf_by_band(image)
    plain = [x[counted] for x in (brf["C02"], brf["C01"], paper["near_infrared"].values)]
    rows = []
    for change in study["change"].values:
        size = abs(float(change))
        both = nir_test(*plain, change=size)
        ways = {
            "every pixel's C03 by just that": both.increase if change > 0 else both.decrease,
            "green as it is below the line": _picked(paper, "green_change_of_base", change)[
                counted
            ],
            "C03 by its slope": _picked(paper, "green_change_first_order", change)[counted],
        }
        rows += [_row(way, float(change), values) for way, values in ways.items()]
        exact = _picked(paper, "green_change", change)
        for low, high in zip(_RATIOS[:-1], _RATIOS[1:], strict=True):
            some = counted & (ratio >= low) & (ratio < high)
            if some.any():
                words = f"{low:g} to {high:g}" if np.isfinite(high) else f"{low:g} or more"
                rows.append(_row(f"C03 / green {words}", float(change), exact[some]))
    return rows


def report_lines(study: xr.Dataset, image: xr.Dataset) -> list[str]:
    """The printed report."""
    counted, inside = study["counted"].values > 0, np.isfinite(study["ssa"].values)
    near = study["near_infrared"].values
    lines = [
        f"{study.attrs['species']} in {inside.sum()} pixels; counted: {counted.sum()} without "
        f"cloud, where its picture is at least {study.attrs['smallest_brightness']:g} bright",
        f"single-scattering albedo in {BAND}: {study.attrs['single_scattering_albedo']}",
    ]
    for k, change in enumerate(study["change"].values):
        changed = study["near_infrared_changed"].values[k]
        ssa, code = study["ssa_changed"].values[k], study["ssa_code"].values[k]
        base_ssa = study["ssa"].values
        step = changed[counted] / near[counted] - 1
        lines.append(
            f"{100 * change:+g} %: {_mean(base_ssa[counted])} to {_mean(ssa[counted])}; mean brf "
            f"{near[counted].mean():.5f} to {changed[counted].mean():.5f} "
            f"({100 * (changed[counted].mean() / near[counted].mean() - 1):+.3f} %), pixels "
            f"{100 * np.percentile(step, 5):+.1f} to {100 * np.percentile(step, 95):+.1f} % "
            "(5th to 95th percentile)"
        )
        short, lost = (np.count_nonzero(code == x) for x in (FALLS_SHORT, NOT_CONVERGED))
        if short:
            end = "1" if change > 0 else "0"
            lines.append(f"  {short} pixels fall short with {end}, which they keep")
        if lost:
            lines.append(f"  {lost} pixels have no root and stay as they are")
    ratio = (near / study["green"].sel(recipe="grasso2013").values)[counted]
    low, middle, high = np.percentile(ratio, [5, 50, 95])
    lines.append(
        f"C03 / green: median {middle:.2f}, 5th to 95th percentile {low:.2f} to {high:.2f}"
    )
    lines += ["", "Change of green [%], Eqs. (2) and (3): over the green as changed"]
    lines += _table(rows_of(study))
    lines += [f"the paper's, look-up table: {PAPER[1]:+.1f} and {PAPER[-1]:+.1f}", ""]
    lines += ["Whence the numbers of Eq. (1)", *_table(account_of(study, image))]
    return [*lines, *(needed_line(float(change), middle) for change in study["change"].values)]


def needed_line(change: float, ratio: float) -> str:
    r"""What it takes for Eq. (1) to give what the paper reports.

    With :math:`\Delta = x / (1 + x)` and :math:`x = c\,w\,N / G`, step c and weight w of C03.
    """
    share = PAPER[1 if change > 0 else -1] / 100
    product = share / (1 - share) / GREEN_RECIPES["grasso2013"].near_infrared
    step = 100 * product / ratio
    return (
        f"The paper's {100 * share:+.1f} % takes C03 / green of {product / change:.1f} at a step "
        f"of {100 * change:+g} %, or at a ratio of {ratio:.2f} one of {step:+.0f} %."
    )


def write_picture(path: str | PathLike[str], study: xr.Dataset, image: xr.Dataset) -> None:
    """Natural colours as they are and changed; maps of the change on one scale; its histogram."""
    counted, inside = study["counted"].values > 0, np.isfinite(study["ssa"].values)
    paper = study.sel(recipe="grasso2013")
    changes = [float(x) for x in study["change"].values]
    fields = [100 * _picked(paper, "green_change", change) for change in changes]
    largest = max(float(np.nanpercentile(abs(field[inside]), 99.5)) for field in fields)
    words = [f"{100 * change:+g} %" for change in changes]
    panels = [Panel("Natural colour", _colours(image, study["near_infrared"].values))]
    for k, word in enumerate(words):
        changed = study["near_infrared_changed"].values[k]
        panels.append(Panel(f"The same, {BAND} of the plume {word}", _colours(image, changed)))
    panels += [
        change_map(f"Change of green, {BAND} {word}", field, largest, "%")
        for word, field in zip(words, fields, strict=True)
    ]
    series = {word: field[counted] for word, field in zip(words, fields, strict=True)}
    panels.append(histogram("Pixels that are counted", series, -largest, largest, "%"))
    short = study["ssa_code"].values == FALLS_SHORT
    if short.any():
        which = np.where(short[0], 1.0, np.where(short[1], -1.0, 0.0))
        title = f"Fall short of {words[0]} (red), {words[1]} (blue)"
        panels.append(change_map(title, which, 1.0, "")._replace(bar=None))
    counts = " and ".join(str(np.count_nonzero(x)) for x in short)
    caption = f"Pixels that fall short: {counts}. Changes of green are over the changed green."
    write_panels(path, panels, columns=3, caption=caption)


def csv_of(rows: list[Row]) -> str:
    """Rows as a file has them."""
    head = "what,change_percent,mean_percent,median_percent,percentile_5,percentile_95,pixels"
    body = [
        f"{r.what},{r.change:g},{r.mean:.6f},{r.median:.6f},{r.lower:.6f},{r.upper:.6f},{r.pixels}"
        for r in rows
    ]
    return "\n".join([head, *body]) + "\n"


def _colours(image: xr.Dataset, near_infrared: np.ndarray) -> np.ndarray:
    bands = [str(band) for band in image["band"].values]
    brf = brf_by_band(image) | {BAND: near_infrared}
    changed = image.assign(brf=(("band", "y", "x"), np.stack([brf[band] for band in bands])))
    return picture_in_natural_colors(changed)


def _picked(study: xr.Dataset, name: str, change: float) -> np.ndarray:
    return study[name].sel(change=change).values


def _row(what: str, change: float, values: np.ndarray) -> Row:
    lower, median, upper = 100 * np.percentile(values, [5, 50, 95])
    return Row(what, 100 * change, 100 * values.mean(), median, lower, upper, values.size)


def _mean(values: np.ndarray) -> str:
    spread = f" (mean, {values.min():.4f} to {values.max():.4f})" if np.ptp(values) > 1e-9 else ""
    return f"{values.mean():.5f}{spread}"


def _table(rows: list[Row]) -> list[str]:
    width = max(len(row.what) for row in rows)
    titles = f"{'C03 by':>8} {'mean':>8} {'median':>8} {'5 %':>8} {'95 %':>8} {'pixels':>8}"
    lines = [f"{'':{width}} {titles}"]
    for row in rows:
        numbers = " ".join(f"{x:+8.3f}" for x in (row.mean, row.median, row.lower, row.upper))
        lines.append(f"{row.what:{width}} {row.change:+8g} {numbers} {row.pixels:8d}")
    return lines
