"""How often the intervals of a retrieval hold the truth."""

from collections.abc import Mapping

import numpy as np
import xarray as xr

SHARES = (68, 95)
"""Of the intervals, as `retrievals.intervals` has them. [%]"""


def intervals_held(
    retrieval: xr.Dataset, truths: Mapping[str, xr.DataArray], success: np.ndarray
) -> dict[str, tuple[float, ...]]:
    """Share of pixels whose truth lies in each interval, by quantity, of those that have intervals.

    Parameters
    ----------
    retrieval
        A retrieval; its quantities have intervals where there are diagnostics.
    truths, success
        True values by name, and where the retrieval counts.
    """
    held = {}
    for name, truth in truths.items():
        if f"{name}_lower_68" not in retrieval or "band" in truth.dims:
            continue
        true = truth.values
        rows = success & np.isfinite(true) & np.isfinite(retrieval[f"{name}_lower_68"].values)
        if not rows.any():
            continue
        bounds = [
            [retrieval[f"{name}_{side}_{share}"].values[rows] for side in ("lower", "upper")]
            for share in SHARES
        ]
        inside = [(low <= true[rows]) & (true[rows] <= high) for low, high in bounds]
        held[name] = tuple(float(x.mean()) for x in inside)
    return held
