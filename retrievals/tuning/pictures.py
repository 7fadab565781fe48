"""Pictures of a comparison; they need matplotlib, of the extra ``plot``."""

from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure


def write_pictures(found: xr.Dataset, folder: Path) -> list[Path]:
    """Draw ``tuning.png``: for each band observed, simulated, differences and a histogram.

    Parameters
    ----------
    found
        Of `compared` or `tuned`.
    folder
        Where to write, which exists.

    Returns
    -------
    The files written.
    """
    stages, bands = found["stage"].values, found["band"].values
    figure = Figure(figsize=(3.6 * (2 + 1 + len(stages)), 3.1 * len(bands)), layout="constrained")
    rows = figure.subplots(len(bands), 3 + len(stages), squeeze=False)
    for axes, band in zip(rows, bands, strict=True):
        one = found.sel(band=band)
        last = one["simulated"].isel(stage=-1).values
        observed = one["observed"].values
        both = np.concatenate([observed.ravel(), last.ravel()])
        limits = np.nanpercentile(both, [0.5, 99.5]) if np.isfinite(both).any() else (0, 1)
        _map(axes[0], f"{band} observed", observed, limits, "gray", figure)
        _map(axes[1], f"{band} simulated, {stages[-1]}", last, limits, "gray", figure)
        differences = one["difference"].values
        fine = np.isfinite(differences)
        largest = float(np.percentile(np.abs(differences[fine]), 99)) if fine.any() else 1.0
        largest = largest or 1.0
        for k, stage in enumerate(stages):
            title = f"{band} {stage} - observed"
            _map(axes[2 + k], title, differences[k], (-largest, largest), "RdBu_r", figure)
        _histogram(axes[-1], one, str(band))
    path = folder / "tuning.png"
    figure.savefig(path, dpi=90)
    return [path]


def _map(axes: Axes, title: str, values: np.ndarray, limits, colours: str, figure: Figure) -> None:
    drawn = axes.imshow(values, origin="lower", vmin=limits[0], vmax=limits[1], cmap=colours)
    axes.set_title(title, fontsize=10)
    axes.set(xticks=[], yticks=[])
    figure.colorbar(drawn, ax=axes, shrink=0.8)


def _histogram(axes: Axes, one: xr.Dataset, band: str) -> None:
    """Pixels of the plume by reflectance factor, or all where there is no plume."""
    region = "plume" if float(one["count"].sel(region="plume").max()) > 0 else "all"
    edges = one["bin_edges"].values
    colours = {"observed": "black", "scene": "tab:blue", "tuned": "tab:red"}
    for series in one["series"].values:
        counts = one["histogram"].sel(series=series, region=region).values
        style = "--" if series == "tuned" else "-"
        axes.stairs(counts, edges, color=colours[str(series)], label=str(series), linestyle=style)
    axes.set_title(f"{band}, {region}: pixels by reflectance factor", fontsize=10)
    axes.legend(fontsize=8)
