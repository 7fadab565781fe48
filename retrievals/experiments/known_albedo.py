"""Smoke over a ground whose albedo is known as it is, on average, or with errors.

The claim of Grasso et al. (2013) that synthetic imagery needs an albedo that varies as the ground
does, put to a retrieval: three bands see smoke through a ground that is not retrieved. That its
albedo is not known enters no error bar, as in products that take it from a climatology.
"""

from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..declarations import plume
from ..forward import ForwardModel, prepared
from ..kinds import BANDS
from ..observation import measurement
from ..pixels import retrieve_pixels
from ..prior import Prior
from ..quality import sigmas
from . import scenes
from .tables import score_variables

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GROUNDS = ("land", "water")
KNOWN = ("as it is", "its mean", "10 % errors")
RELATIVE_ERROR = 0.1
"""Of the third albedo, another one in every pixel and band. [-]"""
MEAN_AOD, SIGMA = 0.3, 0.7
"""Of the prior, from which the truth is drawn: optical depth [-], and x [-]."""


@scenes.in_double_precision
def known_albedo(*, size: int = 32, seed: int = 0, num_streams: int = 8) -> xr.Dataset:
    """How well is the optical depth of smoke retrieved if albedo is known as it is, as its mean,
    or with errors of 10 %, over land and over water?

    Parameters
    ----------
    size
        Rows and columns of the image.
    seed
        Of grounds, smoke and noise.
    num_streams
        Of the solver, for truth and retrieval.

    Returns
    -------
    xarray.Dataset
        Scores of `aod_550` by ``ground`` and ``known_albedo``; maps of truth, retrieval, its
        standard deviation and the albedo of both.
    """
    rng = np.random.default_rng(seed)
    num_pixels, vector = size**2, plume("smoke")
    x = float(vector.x(MEAN_AOD)[0]) + SIGMA * scenes.random_field(rng, size).reshape(-1, 1)
    truth = np.asarray(vector.values(jnp.asarray(x))["aod_550"])
    albedo = np.stack(
        [
            scenes.land_albedo(rng, size, BANDS).reshape(num_pixels, -1),
            scenes.water_albedo(rng, size, BANDS).reshape(num_pixels, -1),
        ]
    )
    mean = np.broadcast_to(albedo.mean(axis=1, keepdims=True), albedo.shape)
    wrong = albedo * (1 + RELATIVE_ERROR * rng.standard_normal(albedo.shape))
    known = np.stack([albedo, mean, wrong], axis=1)  # (ground, known, pixel, band)

    smoke = scenes.known_plume("smoke", num_pixels, BANDS)
    air = scenes.clear_air(num_pixels, {"smoke": smoke})
    one = scenes.State(air, {}, scenes.directions(num_pixels))
    forward = ForwardModel(vector, BANDS, num_streams, gases=())
    forward = prepared(forward, scenes.with_albedo(one, albedo[0], BANDS))
    observations, states = [], []
    for ground in range(len(GROUNDS)):
        seen = np.asarray(forward(jnp.asarray(x), scenes.with_albedo(one, albedo[ground], BANDS)))
        noisy = seen + measurement(seen, BANDS).sigma * rng.standard_normal(seen.shape)
        observations += [measurement(noisy, BANDS)] * len(KNOWN)
        states += [scenes.with_albedo(one, assumed, BANDS) for assumed in known[ground]]
    together = jax.tree.map(lambda *parts: np.concatenate(parts), *observations)
    prior = Prior(np.asarray(vector.x(MEAN_AOD)), np.array([[SIGMA**2]]))
    found = retrieve_pixels(
        forward, together, jax.tree.map(lambda *parts: np.concatenate(parts), *states), prior=prior
    )
    values = vector.values(found.inversion.x)["aod_550"]
    aod = np.where(found.inversion.converged, values, np.nan)
    cases = (len(GROUNDS), len(KNOWN))
    aod, sigma = (a.reshape(*cases, -1) for a in (aod, sigmas(vector, found.inversion)[:, 0]))
    return _table(size, truth, aod, sigma, known)


def _table(
    size: int, truth: np.ndarray, aod: np.ndarray, sigma: np.ndarray, known: np.ndarray
) -> xr.Dataset:
    cases, image = ("ground", "known_albedo"), ("y", "x")
    maps = (*aod.shape[:2], size, size)
    variables = score_variables(aod, truth, sigma, cases) | {
        "true_aod_550": (image, truth.reshape(size, size), {"units": "1"}),
        "aod_550": ((*cases, *image), aod.reshape(maps), {"units": "1"}),
        "aod_550_sigma": ((*cases, *image), sigma.reshape(maps), {"units": "1"}),
        "albedo": ((*cases, *image, "band"), known.reshape(*maps, -1), {"units": "1"}),
    }
    coordinates = {"ground": list(GROUNDS), "known_albedo": list(KNOWN), "band": list(BANDS)}
    return xr.Dataset(variables, coordinates, {"rows": " ".join(cases)})


def draw_known_albedo(table: xr.Dataset, figure: "Figure") -> None:
    """By ground, the albedo in C02, the true optical depth, and the errors of each retrieval."""
    figure.set_size_inches(16, 6)
    error = table["aod_550"] - table["true_aod_550"]
    axes = figure.subplots(len(GROUNDS), 2 + len(KNOWN))
    for row, ground in zip(axes, GROUNDS, strict=True):
        true = table["albedo"].sel(ground=ground, known_albedo=KNOWN[0], band="C02")
        drawn = row[0].imshow(true, origin="lower", cmap="Greys_r")
        row[0].set_title(f"{ground}: albedo in C02")
        figure.colorbar(drawn, ax=row[0])
        drawn = row[1].imshow(table["true_aod_550"], origin="lower", vmin=0)
        row[1].set_title("true aod_550")
        figure.colorbar(drawn, ax=row[1])
        # One scale for a ground: what exceeds it has the colour of its end.
        limit = float(np.nanpercentile(np.abs(error.sel(ground=ground)), 98))
        for panel, known in zip(row[2:], KNOWN, strict=True):
            case = {"ground": ground, "known_albedo": known}
            drawn = panel.imshow(
                error.sel(case), origin="lower", cmap="RdBu_r", vmin=-limit, vmax=limit
            )
            numbers = table.sel(case)
            panel.set_title(
                f"error, albedo {known}\nrmse {float(numbers['rmse']):.3f}, "
                f"68 % holds {100 * float(numbers['coverage_68']):.0f} %"
            )
        figure.colorbar(drawn, ax=row[-1])
    for panel in axes.ravel():
        panel.set_xticks([])
        panel.set_yticks([])
