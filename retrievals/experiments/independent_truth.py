"""Retrievals whose truth the inversion does not share, against the inverse crime.

The truth has 32 streams, and five strips of 400 m in a pixel of 2 km that are not alike, whose
reflectances are averaged; what else it has that the inversion, of 8 streams and one column, does
not know of is said in `independent_plumes`, `independent_clouds` and `independent_fires`. What is
wrong by that enters S_obs as a relative covariance of the bands,

.. math:: C_{bc} = \\left\\langle d_b\\, d_c \\right\\rangle, \\qquad d_b = y_b / F_b(x) - 1,

the mean over pixels of other seeds than those that are scored, with F at the true x.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import jax
import numpy as np
import scipy
import xarray as xr

from ..forward import ForwardModel, prepared
from ..observation import measurement
from ..pixels import retrieve_pixels
from . import scenes
from .independent_case import STRIPS, Case
from .independent_clouds import independent_cloud
from .independent_fires import independent_fire
from .independent_plumes import independent_plume
from .tables import score_variables

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CASES: dict[str, Callable[[], Case]] = {
    **{species: partial(independent_plume, species) for species in ("smoke", "ash", "dust")},
    "cloud": independent_cloud,
    "fire": independent_fire,
}
"""What is retrieved, by name."""
S_OBS = ("noise", "noise and forward model", "its mean taken out")
"""What the inversion knows of: noise; the covariance above as well; instead of that the covariance
about the mean of d, by which measurements are corrected."""


class Found(NamedTuple):
    """What became of one case.

    Parameters
    ----------
    retrieved, sigma
        Values and their posterior standard deviations, (quantity, S_obs, pixel); NaN where a
        retrieval did not converge.
    truth
        (quantity, pixel).
    error
        Relative standard deviation of the forward model, by band. [-]
    """

    retrieved: np.ndarray
    sigma: np.ndarray
    truth: np.ndarray
    error: dict[str, float]


@scenes.in_double_precision
def independent_truth(
    *,
    size: int = 10,
    seed: int = 0,
    kinds: Sequence[str] = tuple(CASES),
    true_streams: int = 32,
    num_streams: int = 8,
) -> xr.Dataset:
    """Do the error bars of smoke, ash, dust, cloud and fires hold a truth by another model (more
    streams, other particles and heights, uneven pixels), without and with a forward-model
    covariance in S_obs, and its mean?

    Parameters
    ----------
    size
        Root of the number of pixels that are scored, and of those that the covariance is from.
    seed
        Of all that is random.
    kinds
        What is retrieved, of `CASES`.
    true_streams, num_streams
        Of the truth, and of the inversion.

    Returns
    -------
    xarray.Dataset
        Scores by ``quantity`` and ``S_obs``, in the unit of each; truth, retrieval and standard
        deviation of every pixel; the relative standard deviations of the forward model,
        `forward_error`, NaN in bands that a kind has not.
    """
    cases = {kind: CASES[kind]() for kind in kinds}
    found = [_of_case(case, size**2, seed, true_streams, num_streams) for case in cases.values()]
    retrieved, sigma, truth = (
        np.concatenate(parts)
        for parts in (
            [f.retrieved for f in found],
            [f.sigma for f in found],
            [f.truth for f in found],
        )
    )
    labels = [name for case in cases.values() for name in case.quantities]
    bands = sorted({band for case in cases.values() for band in case.bands})
    error = np.array([[f.error.get(band, np.nan) for band in bands] for f in found])
    dims = ("quantity", "S_obs")
    words = {"units": "1", "long_name": "relative error of the forward model"}
    variables = score_variables(retrieved, truth[:, None], sigma, dims, None) | {
        "truth": (("quantity", "pixel"), truth),
        "retrieved": ((*dims, "pixel"), retrieved),
        "sigma": ((*dims, "pixel"), sigma),
        "forward_error": (("kind", "band"), error, words),
    }
    coordinates = {"quantity": labels, "S_obs": list(S_OBS), "kind": list(cases), "band": bands}
    return xr.Dataset(variables, coordinates, {"rows": " ".join(dims)})


def _of_case(case: Case, num_pixels: int, seed: int, true_streams: int, num_streams: int) -> Found:
    # Pixels of both seeds go through the solver together: the first half is scored.
    scored, others = (case.draw(np.random.default_rng([seed, i]), num_pixels) for i in (0, 1))
    cells, believed, x = jax.tree.map(lambda *parts: np.concatenate(parts), scored[:3], others[:3])
    true_model = ForwardModel(case.vector, case.bands, true_streams, gases=case.gases)
    by_cell = np.asarray(true_model.measured(cells))
    seen = by_cell.reshape(2 * num_pixels, STRIPS, -1).mean(axis=1)
    model = ForwardModel(case.vector, case.bands, num_streams, gases=case.gases)
    forward = prepared(model, believed)
    relative = (seen / np.asarray(forward(x, believed)) - 1)[num_pixels:]
    mean = relative.mean(axis=0)
    covariance = relative.T @ relative / num_pixels
    known = (
        (0.0, np.zeros_like(covariance)),
        (0.0, covariance),
        (mean, covariance - np.outer(mean, mean)),
    )

    rng = np.random.default_rng([seed, 2])
    noise = measurement(seen, case.bands).sigma * rng.standard_normal(seen.shape)
    noisy, state = (seen + noise)[:num_pixels], scored.believed
    found = []
    for factor, error in known:
        observation = measurement(noisy / (1 + factor), case.bands, forward_error=error)
        inversion = retrieve_pixels(forward, observation, state, prior=case.prior).inversion
        values, sigma = case.report(
            np.asarray(inversion.x), np.asarray(inversion.covariance), state
        )
        found.append((np.where(inversion.converged, values, np.nan), sigma))
    retrieved, sigma = (np.stack(parts, axis=1) for parts in zip(*found, strict=True))
    error = dict(zip(case.bands, np.sqrt(np.diagonal(covariance)).tolist(), strict=True))
    return Found(retrieved, sigma, scored.truth, error)


def draw_independent_truth(table: xr.Dataset, figure: "Figure") -> None:
    """Of each quantity retrieved against true values with their errors, and the coverage."""
    figure.set_layout_engine("constrained")
    figure.set_size_inches(20, 3 * len(table["quantity"]))
    axes = figure.subplots(len(table["quantity"]), 1 + len(table["S_obs"]), squeeze=False)
    probability = np.linspace(0.02, 0.98, 49)
    widths = scipy.stats.norm.ppf((1 + probability) / 2)
    for row, quantity in zip(axes, table["quantity"].values, strict=True):
        truth = table["truth"].sel(quantity=quantity).values
        row[-1].plot([0, 1], [0, 1], color="black", linewidth=1)
        for panel, case in zip(row, table["S_obs"].values, strict=False):
            one = table.sel(quantity=quantity, S_obs=case)
            retrieved, sigma = one["retrieved"].values, one["sigma"].values
            panel.errorbar(truth, retrieved, sigma, fmt=".", markersize=3, linewidth=0.6)
            panel.plot(*[[truth.min(), truth.max()]] * 2, color="black", linewidth=1)
            panel.set(xlabel=f"true {quantity}", ylabel="retrieved")
            panel.set_title(f"{case}: bias {float(one['bias']):.3f}")
            ratio = np.abs(retrieved - truth) / sigma
            row[-1].plot(probability, share_within(ratio, widths), label=case)
        row[-1].set(xlabel="probability of the interval", ylabel="share of truths inside")
        row[-1].set_title(quantity)
        row[-1].legend()


def share_within(ratio: np.ndarray, widths: np.ndarray) -> np.ndarray:
    """Share of errors up to each width, of those that are numbers, as the scores count them.

    Parameters
    ----------
    ratio
        Errors over their standard deviations, NaN where a retrieval did not converge. [-]
    widths
        In standard deviations. [-]

    Returns
    -------
    numpy.ndarray
        For each width; NaN without any number. [-]
    """
    known = ratio[np.isfinite(ratio)]
    if known.size == 0:
        return np.full(widths.shape, np.nan)
    return np.mean(known[:, None] <= widths, axis=0)
