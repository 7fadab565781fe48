"""What is said of the sensitivities of a scene: rankings, the check by sampling, maps."""

from os import PathLike
from typing import NamedTuple

import numpy as np
import xarray as xr

from .panels import change_map, write_panels

_HEAD = (
    "step",
    "unit",
    "slope",
    "elasticity",
    "step up",
    "step down",
    "2nd order",
    "variance",
)


class Ranked(NamedTuple):
    """Means over the pixels of what one input does to one output.

    Parameters
    ----------
    of, to, units
        Names of both, and the unit of the input.
    step, jacobian, elasticity, up, down
        As of `derivatives.Sensitivity`.
    second
        What the second derivative adds to a step, up and down alike, half of it times the step
        squared.
    share
        Of the variance, the input's part of the mean variance. [-]
    pixels
        That all means but the share are over: those whose slope, changes and second derivative are
        numbers, so that these may be compared.
    """

    of: str
    to: str
    units: str
    step: float
    jacobian: float
    elasticity: float
    up: float
    down: float
    second: float
    share: float
    pixels: int


def ranking(study: xr.Dataset) -> list[Ranked]:
    """Every input of every output, those first that contribute most to its variance."""
    rows = []
    for of in study["of"].values:
        some = study.sel(of=of)
        total = _mean(some["variance"])
        found = []
        for to in study["to"].values:
            one = some.sel(to=to)
            step = float(one["step"])
            where = _compared(one)
            names = ("jacobian", "elasticity", "change_up", "change_down", "second_derivative")
            slope, elasticity, up, down, second = (_mean(one[name], where) for name in names)
            second *= step**2 / 2
            share = _mean(one["variance_part"]) / total if total else 0.0
            units = str(one["to_units"].values)
            means = (slope, elasticity, up, down, second, share)
            found.append(Ranked(str(of), str(to), units, step, *means, int(where.sum())))
        rows += sorted(found, key=lambda row: -abs(row.share))
    return rows


def report_lines(study: xr.Dataset) -> list[str]:
    """The printed report."""
    rows, lines = ranking(study), []
    width = max(len(row.to) for row in rows)
    for of in study["of"].values:
        value = study["value"].sel(of=of)
        low, high = np.nanpercentile(value.values, [5, 95])
        pixels = int(np.isfinite(value.values).sum())
        lines.append(
            f"{of}: mean {_mean(value):.5g}, 5th to 95th percentile {low:.4g} to {high:.4g}, "
            f"{pixels} pixels"
        )
        lines.append(f"  {'':{width}} " + " ".join(f"{title:>10}" for title in _HEAD))
        lines += [f"  {_line(row, width, pixels)}" for row in rows if row.of == of]
        lines += [f"  {line}" for line in check_lines(study.sel(of=of))]
    return lines


def check_lines(study: xr.Dataset) -> list[str]:
    """How the variance of draws of one output compares with that to first order of the same draws.

    Some draws cannot be (a negative optical depth); those that are left are not quite normal, and
    the first order knows of neither. What differs is what is not linear.
    """
    if "sampled_variance" not in study:
        return []
    linear, sampled = study["sampled_linear"].values, study["sampled_variance"].values
    good = np.isfinite(sampled) & (linear > 0)
    if not good.any():
        return ["no draw moves it"]
    draws = study["sample_count"].values[good]
    ratio = sampled[good] / linear[good]
    low, middle, high = np.percentile(ratio, [5, 50, 95])
    return [
        f"variance by draws ({draws.mean():.0f} a pixel, {good.sum()} pixels) over that to first "
        f"order: median {middle:.3f}, 5th to 95th percentile {low:.3f} to {high:.3f}"
    ]


def csv_of(rows: list[Ranked]) -> str:
    """Rows as a file has them."""
    head = ",".join(Ranked._fields)
    body = [",".join([r.of, r.to, r.units, *(f"{x:.8g}" for x in r[3:])]) for r in rows]
    return "\n".join([head, *body]) + "\n"


def write_picture(path: str | PathLike[str], study: xr.Dataset) -> None:
    """A map of the change for one step by its slope, a row for each output, on one scale a row."""
    panels = []
    for of in study["of"].values:
        fields = study["jacobian"].sel(of=of) * study["step"]
        largest = float(np.nanpercentile(np.abs(fields.values), 99.5)) or 1.0
        for to in study["to"].values:
            title = f"{of}: {to} {float(study['step'].sel(to=to)):+g}"
            panels.append(change_map(title, fields.sel(to=to).values, largest, ""))
    caption = "Change for one step of each input by its slope; grey where no pixel is looked at."
    write_panels(path, panels, columns=study.sizes["to"], caption=caption)


def _line(row: Ranked, width: int, pixels: int) -> str:
    numbers = (row.jacobian, row.elasticity, row.up, row.down, row.second)
    cells = " ".join(f"{x:>+10.3g}" if np.isfinite(x) else f"{'-':>10}" for x in numbers)
    fewer = f"  (changes of {row.pixels} pixels)" if row.pixels < pixels else ""
    share = f"{100 * row.share:>8.1f} %"
    return f"{row.to:{width}} {row.step:>10.3g} {row.units:>10} {cells} {share}{fewer}"


def _compared(one: xr.Dataset) -> np.ndarray:
    """Pixels (y, x) of which slope and changes are numbers, without those that are none anywhere.

    A step that leads out of the allowed range in some pixels has a change in the others alone, of
    which the slope may be another; second derivatives may not have been asked for.
    """
    slope = np.isfinite(one["jacobian"].values)
    others = ("change_up", "change_down", "second_derivative")
    finite = [np.isfinite(one[name].values) for name in others]
    return np.all([slope, *(some for some in finite if some.any())], axis=0)


def _mean(array: xr.DataArray, where: np.ndarray | bool = True) -> float:
    values = array.values[np.isfinite(array.values) & where]
    return float(values.mean()) if values.size else float("nan")
