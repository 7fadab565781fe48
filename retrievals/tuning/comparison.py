"""A simulated image beside the observed one: statistics, histograms and maps, band by band."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from abi_operator.nomenclature import QUALITY_FLAGS

from ..scoring import Score, score

REGIONS = ("plume", "outside", "all")
STATISTICS: dict[str, str] = {
    "count": "pixels that are compared",
    "observed_mean": "mean of what was observed",
    "simulated_mean": "mean of what was simulated",
    "bias": "mean of simulated minus observed",
    "rmse": "root mean square of simulated minus observed",
    "correlation": "Pearson's correlation of simulated and observed",
    "slope": "slope of the regression of simulated on observed",
    **{f"percentile_{p}": f"{p} % of simulated minus observed are below" for p in (5, 25, 50)},
    **{f"percentile_{p}": f"{p} % of simulated minus observed are below" for p in (75, 95)},
}
"""What is said of each band, region and stage, in words."""
NUM_BINS = 50
"""Bins of a histogram, between the lowest and the highest reflectance factor of a band. [-]"""
_UNSEEN = sum(QUALITY_FLAGS[name] for name in ("night", "no_albedo", "out_of_sight"))


class Pixels(NamedTuple):
    """Which pixels are compared (y, x), by region, whatever a band lacks there."""

    plume: np.ndarray
    outside: np.ndarray
    all: np.ndarray


def regions_of(image: xr.Dataset, species: str | None) -> Pixels:
    """Pixels of a scene inside and outside of a plume, where the sun shines on a known ground.

    Parameters
    ----------
    image
        Result of one time.
    species
        Name of the plume, which is where its brightness is above 0; None without one.
    """
    seen = (image["quality_flag"].values & _UNSEEN) == 0
    inside = np.zeros_like(seen)
    if species is not None:
        inside = np.broadcast_to(image[f"{species}_brightness"].values > 0, seen.shape)
    return Pixels(seen & inside, seen & ~inside, seen)


def compare(
    stages: Mapping[str, xr.DataArray], observed: xr.Dataset, regions: Pixels
) -> xr.Dataset:
    """Compare stages of a simulated image with the observed one.

    A pixel counts in a band where all stages and the observation are finite there and the
    observation is not saturated, so that stages are compared over the same pixels.

    Parameters
    ----------
    stages
        Reflectance factors (band, y, x) by name, such as ``"scene"`` and ``"tuned"``. [-]
    observed
        Of `read_observed`, with the bands of the stages.
    regions
        Of `regions_of`.

    Returns
    -------
    xarray.Dataset
        Along ``stage``, ``band`` and ``region`` the `STATISTICS`; ``histogram`` (stage, band,
        region, bin), numbers of pixels, with the observation as one more stage ``observed``, and
        ``bin_edges`` (band, edge); ``observed`` (band, y, x), ``simulated`` and ``difference``
        (stage, band, y, x), simulated minus observed.
    """
    bands = [str(band) for band in observed["band"].values]
    fields = np.stack([x.transpose("band", "y", "x").values for x in stages.values()])
    values = observed["reflectance_factor"].transpose("band", "y", "x").values
    good = np.isfinite(fields).all(axis=0) & np.isfinite(values)
    good &= observed["saturated"].values == 0
    chosen = np.stack([good & pixels for pixels in regions], axis=1)  # band, region, y, x
    statistics = np.full((len(stages), len(bands), len(REGIONS), len(STATISTICS)), np.nan)
    edges = np.empty((len(bands), NUM_BINS + 1))
    counts = np.zeros((len(stages) + 1, len(bands), len(REGIONS), NUM_BINS), np.int64)
    for b in range(len(bands)):
        everything = np.concatenate([values[b][good[b]], fields[:, b][:, good[b]].ravel()])
        edges[b] = _edges(everything)
        for r in range(len(REGIONS)):
            rows = chosen[b, r]
            counts[-1, b, r] = np.histogram(values[b][rows], edges[b])[0]
            for s in range(len(stages)):
                statistics[s, b, r] = _statistics(fields[s, b][rows], values[b][rows])
                counts[s, b, r] = np.histogram(fields[s, b][rows], edges[b])[0]
    return _dataset(list(stages), bands, (statistics, counts, edges), (fields, values))


def _edges(values: np.ndarray) -> np.ndarray:
    low, high = (values.min(), values.max()) if values.size else (0.0, 1.0)
    return np.linspace(low, high if high > low else low + 1e-6, NUM_BINS + 1)


def _statistics(simulated: np.ndarray, observed: np.ndarray) -> list[float]:
    found: Score = score(simulated, observed, None)
    means = [float(x.mean()) if x.size else np.nan for x in (observed, simulated)]
    own: Sequence[str] = list(STATISTICS)[3:]
    return [found.num_pairs, *means, *(getattr(found, name) for name in own)]


def _dataset(
    stages: list[str],
    bands: list[str],
    found: tuple[np.ndarray, np.ndarray, np.ndarray],
    maps: tuple[np.ndarray, np.ndarray],
) -> xr.Dataset:
    statistics, counts, edges = found
    simulated, observed = maps
    table, image = ("stage", "band", "region"), ("band", "y", "x")
    variables = {
        name: (table, statistics[..., k], {"long_name": words, "units": "1"})
        for k, (name, words) in enumerate(STATISTICS.items())
    }
    names = {"units": "1"}
    variables |= {
        "histogram": (
            ("series", "band", "region", "bin"),
            counts,
            names | {"long_name": "pixels in a bin"},
        ),
        "bin_edges": (("band", "edge"), edges, names | {"long_name": "edges of the bins"}),
        "observed": (image, observed, names | {"long_name": "observed reflectance factor"}),
        "simulated": (
            ("stage", *image),
            simulated,
            names | {"long_name": "simulated reflectance factor"},
        ),
        "difference": (
            ("stage", *image),
            simulated - observed,
            names | {"long_name": "simulated minus observed reflectance factor"},
        ),
    }
    coordinates = {
        "stage": stages,
        "series": [*stages, "observed"],
        "band": bands,
        "region": list(REGIONS),
    }
    return xr.Dataset(variables, coordinates)
