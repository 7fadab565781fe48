"""Tables of the experiments: scores by case, and their plain text."""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from ..scoring import Score, score

_SCORES = {
    "num_pixels": "retrievals that converged",
    "bias": "mean of retrieved minus true",
    "rmse": "root mean square of retrieved minus true",
    "coverage_68": "share of errors within one posterior standard deviation",
    "coverage_95": "share of errors within 1.96 posterior standard deviations",
    "chi_square": "mean square of error by posterior standard deviation",
}
_WITH_UNITS = ("bias", "rmse")


def score_variables(
    retrieved: np.ndarray,
    truth: np.ndarray,
    sigma: np.ndarray,
    dims: Sequence[str],
    units: str | None = "1",
    prefix: str = "",
) -> dict[str, tuple]:
    """Scores by case, as variables of a Dataset.

    Parameters
    ----------
    retrieved, truth, sigma
        Cases first, as many axes as there are `dims`; pixels in all others. What is not finite does
        not count.
    dims
        Of the cases.
    units
        Of what was retrieved; None where cases have units of their own.
    prefix
        Of the names of the variables.
    """
    shape = retrieved.shape[: len(dims)]
    truth = np.broadcast_to(truth, retrieved.shape)
    scores = np.empty(shape, object)
    for case in np.ndindex(shape):
        fine = np.isfinite(retrieved[case]) & np.isfinite(sigma[case])
        pairs = (x[case][fine] for x in (retrieved, truth, sigma))
        scores[case] = _scored(*pairs)
    found = {}
    for name, words in _SCORES.items():
        field = "num_pairs" if name == "num_pixels" else name
        values = np.array([getattr(s, field) for s in scores.ravel()]).reshape(shape)
        own = units if name in _WITH_UNITS else "1"
        about = {"long_name": f"{words}, in the unit of each"} if own is None else {"units": own}
        found[prefix + name] = (tuple(dims), values, {"long_name": words} | about)
    return found


def _scored(retrieved: np.ndarray, truth: np.ndarray, sigma: np.ndarray) -> Score:
    return score(retrieved, truth, None, sigma)


def format_table(table: xr.Dataset) -> str:
    """Plain text of the variables that have no other dimensions than the attribute ``rows``."""
    rows: list[str] = str(table.attrs["rows"]).split()
    names = [
        str(name) for name, v in table.data_vars.items() if v.dims and set(v.dims) <= set(rows)
    ]
    sizes = [table.sizes[row] for row in rows]
    lines = [[*rows, *(_head(name, table[name].attrs) for name in names)]]
    for case in np.ndindex(*sizes):
        at = dict(zip(rows, case, strict=True))
        labels = [_cell(table[row].values[i]) for row, i in at.items()]
        cells = [
            _cell(table[name].isel({str(d): at[str(d)] for d in table[name].dims}).item())
            for name in names
        ]
        lines.append([*labels, *cells])
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    texts = [
        "  ".join(
            cell.ljust(width) if i < len(rows) else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    ]
    return "\n".join(texts)


def _head(name: str, attributes: Mapping[str, object]) -> str:
    units = attributes.get("units", "1")
    return name if units == "1" else f"{name} [{units}]"


def _cell(value: object) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, int | np.integer):
        return str(value)
    return f"{float(value):.4g}"  # pyright: ignore[reportArgumentType]
