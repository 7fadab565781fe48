"""Pictures of a retrieval beside the truth; they need matplotlib, of the extra ``plot``."""

from pathlib import Path

import numpy as np
import scipy
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..results import ResultCode, expected_error
from .truths import known_truths

_NOMINAL = np.linspace(0.02, 0.98, 49)  # probabilities of intervals


def write_pictures(result: xr.Dataset, retrieval: xr.Dataset, folder: Path) -> list[Path]:
    """Draw every quantity whose truth is known and that has one value in a pixel.

    Of each there is ``{name}.png``, maps of truth, retrieval and error of the first time; and
    ``{name}_scatter.png``, retrieved against true values with the lines of the expected error, and
    the coverage of posterior intervals against their probability. Pixels are those of the scores:
    successes.

    Parameters
    ----------
    result, retrieval
        As of `score_retrieval`.
    folder
        Where to write, which exists.

    Returns
    -------
    The files written.
    """
    kind = str(retrieval.attrs.get("kind", "smoke"))
    success = retrieval["result_code"].values == ResultCode.SUCCESS
    paths = []
    for name, truth in known_truths(result, kind).items():
        if "band" in truth.dims or name not in retrieval:
            continue
        units = str(retrieval[name].attrs.get("units", ""))
        label = name if units in ("", "1") else f"{name} [{units}]"
        true, retrieved = truth.values, np.where(success, retrieval[name].values, np.nan)
        figures = {f"{name}.png": _maps(true, retrieved, label)}
        rows = np.isfinite(retrieved) & np.isfinite(true)
        sigma = retrieval[f"{name}_sigma"].values[rows]
        figures[f"{name}_scatter.png"] = _scatter(true[rows], retrieved[rows], sigma, label, name)
        for file, figure in figures.items():
            figure.savefig(folder / file, dpi=120)
            paths.append(folder / file)
    return paths


def _maps(truth: np.ndarray, retrieved: np.ndarray, label: str) -> Figure:
    """Truth, retrieval and error, north at the top."""
    if truth.ndim == 3:
        truth, retrieved = truth[0], retrieved[0]
    figure = Figure(figsize=(13, 4), layout="constrained")
    error = retrieved - truth
    limits = _limits(truth)
    largest = np.nanmax(np.abs(error)) if np.isfinite(error).any() else 1.0
    largest = largest or 1.0  # an error of 0 everywhere is white
    maps = (("truth", truth, limits), ("retrieved", retrieved, limits))
    maps += (("retrieved - truth", error, (-largest, largest)),)
    for axes, (title, image, (low, high)) in zip(figure.subplots(1, 3), maps, strict=True):
        colours = "RdBu_r" if title == "retrieved - truth" else "viridis"
        drawn = axes.imshow(image, origin="lower", vmin=low, vmax=high, cmap=colours)
        axes.set_title(f"{title}: {label}")
        figure.colorbar(drawn, ax=axes)
    return figure


def _limits(truth: np.ndarray) -> tuple[float, float]:
    if not np.isfinite(truth).any():
        return 0.0, 1.0
    return float(np.nanmin(truth)), float(np.nanmax(truth))


def _scatter(
    truth: np.ndarray, retrieved: np.ndarray, sigma: np.ndarray, label: str, name: str
) -> Figure:
    figure = Figure(figsize=(10, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    line = np.linspace(*_limits(np.concatenate([truth, retrieved])), 50)
    left.plot(line, line, color="black", linewidth=1, label="1 : 1")
    if name == "aod_550":
        for sign in (-1, 1):
            words = "expected error" if sign > 0 else None
            edge = line + sign * expected_error(line)
            left.plot(line, edge, color="black", linestyle="--", linewidth=1, label=words)
    left.plot(truth, retrieved, ".", markersize=3, alpha=0.5)
    left.set(xlabel=f"true {label}", ylabel=f"retrieved {label}", title=f"{truth.size} pixels")
    left.legend()
    _draw_coverage(right, retrieved - truth, sigma)
    return figure


def _draw_coverage(axes: Axes, error: np.ndarray, sigma: np.ndarray) -> None:
    axes.plot([0, 1], [0, 1], color="black", linewidth=1)
    if error.size:
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(error) / sigma
        widths = scipy.stats.norm.ppf((1 + _NOMINAL) / 2)
        axes.plot(_NOMINAL, [np.mean(ratio <= width) for width in widths])
    axes.set(
        xlabel="probability of the posterior interval",
        ylabel="share of pixels whose truth is inside",
        xlim=(0, 1),
        ylim=(0, 1),
    )
