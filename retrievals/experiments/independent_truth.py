"""Smoke and ash whose truth the inversion does not share, against the inverse crime.

The truth has 32 streams, the phase functions of Mie theory, particles of another size in every
pixel, a plume 0.5 km higher than is believed, and five strips of 400 m in a pixel of 2 km, of
different optical depth and albedo, whose reflectances are averaged. The inversion has 8 streams,
the phase function of Henyey and Greenstein, particles of one size and one column. What is wrong
by that enters S_obs as a relative covariance of the bands,

.. math:: C_{bc} = \\left\\langle d_b\\, d_c \\right\\rangle, \\qquad d_b = y_b / F_b(x) - 1,

the mean over pixels of other seeds than those that are scored, with F at the true x.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy
import xarray as xr

from abi_operator import MiePlume, Plume, State, reflectance_factor
from abi_operator.optics import mie_optics

from ..declarations import plume
from ..forward import ForwardModel, prepared
from ..kinds import BANDS
from ..observation import Observation, measurement
from ..pixels import retrieve_pixels
from ..prior import Prior
from ..quality import sigmas
from ..state_vector import StateVector
from . import scenes
from .tables import score_variables

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = ("smoke", "ash")
QUANTITIES = ("aod_550", "ssa C02")
S_OBS = ("noise", "noise and forward model")
RAISED = 500.0
"""How much higher than believed the plume is. [m]"""
STRIPS = 5
"""Columns of 400 m in a pixel. [-]"""
MEAN_AOD, SIGMAS = 0.4, (0.7, 0.3)
"""Of the prior: optical depth, and x. [-]"""

_RADII_UM = {"smoke": (0.12, 0.17), "ash": (2.0, 4.5)}  # that the truth is drawn from
_ALBEDO = (0.02, 0.25)
_UNEVEN_PLUME, _UNEVEN_GROUND = 0.3, 0.15  # relative standard deviation among the strips


class Truth(NamedTuple):
    """Pixels as they are: what is seen, the state as it is believed, and what is to be found.

    Parameters
    ----------
    seen
        Reflectance factors, (pixel, band). [-]
    state
        Without the quantities that are retrieved.
    aod_550, ssa
        Optical depth, and single-scattering albedo by band, (pixel, band). [-]
    """

    seen: np.ndarray
    state: State
    aod_550: np.ndarray
    ssa: np.ndarray


@scenes.in_double_precision
def independent_truth(
    *,
    size: int = 10,
    seed: int = 0,
    kinds: Sequence[str] = KINDS,
    true_streams: int = 32,
    num_streams: int = 8,
) -> xr.Dataset:
    """Do the error bars of smoke and ash hold a truth by another model (32 streams, Mie theory,
    a higher plume, uneven pixels), without and with a forward-model covariance in S_obs?

    Parameters
    ----------
    size
        Root of the number of pixels that are scored, and of those that the covariance is from.
    seed
        Of all that is random.
    kinds
        Plumes, of `KINDS`.
    true_streams, num_streams
        Of the truth, and of the inversion.

    Returns
    -------
    xarray.Dataset
        Scores by ``quantity`` and ``S_obs``; truth, retrieval and standard deviation of every
        pixel; the relative standard deviations of the forward model, `forward_error`.
    """
    cases = [_of_one_kind(kind, size**2, seed, true_streams, num_streams) for kind in kinds]
    retrieved, sigma, truth, covariance = (
        np.stack(parts) for parts in zip(*cases, strict=True)
    )  # (kind, quantity, ...)
    labels = [f"{kind} {name}" for kind in kinds for name in QUANTITIES]
    retrieved, sigma = (a.reshape(len(labels), *a.shape[2:]) for a in (retrieved, sigma))
    truth = truth.reshape(len(labels), 1, -1)
    dims = ("quantity", "S_obs")
    error = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    words = {"units": "1", "long_name": "relative error of the forward model"}
    variables = score_variables(retrieved, truth, sigma, dims) | {
        "truth": (("quantity", "pixel"), truth[:, 0], {"units": "1"}),
        "retrieved": ((*dims, "pixel"), retrieved, {"units": "1"}),
        "sigma": ((*dims, "pixel"), sigma, {"units": "1"}),
        "forward_error": (("kind", "band"), error, words),
    }
    coordinates = {"quantity": labels, "S_obs": list(S_OBS), "kind": list(kinds)}
    return xr.Dataset(variables, coordinates | {"band": list(BANDS)}, {"rows": " ".join(dims)})


def _of_one_kind(
    kind: str, num_pixels: int, seed: int, true_streams: int, num_streams: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Retrieved and sigma, (quantity, S_obs, pixel); truth, (quantity, pixel); the covariance."""
    # Pixels of both seeds go through the solver together: the first half is scored.
    drawn = (_drawn(np.random.default_rng([seed, i]), kind, num_pixels) for i in (0, 1))
    cells, *rest = jax.tree.map(lambda *x: jnp.concatenate(x), *drawn)
    by_cell = reflectance_factor(cells, BANDS, gases=(), num_streams=true_streams)
    seen = np.asarray(by_cell).reshape(2 * num_pixels, STRIPS, -1).mean(axis=1)
    truth = Truth(seen, *rest)
    vector = plume(kind, ssa=True)
    forward = prepared(ForwardModel(vector, BANDS, num_streams, gases=()), truth.state)
    x = vector.x(jnp.asarray(truth.aod_550), jnp.asarray(_mean_shift(truth, kind)))
    relative = seen / np.asarray(forward(x, truth.state)) - 1
    others = relative[num_pixels:]
    covariance = others.T @ others / len(others)

    rng = np.random.default_rng([seed, 2])
    noisy = seen + measurement(seen, BANDS).sigma * rng.standard_normal(seen.shape)
    scored = jax.tree.map(lambda leaf: leaf[:num_pixels], truth)
    found = []
    for error in (np.zeros_like(covariance), covariance):
        observation = measurement(noisy[:num_pixels], BANDS, forward_error=error)
        found.append(_retrieved(forward, vector, kind, observation, scored.state))
    retrieved, sigma = (np.stack(parts, axis=1) for parts in zip(*found, strict=True))
    c02 = BANDS.index("C02")
    true = np.stack([np.asarray(scored.aod_550), np.asarray(scored.ssa[:, c02])])
    return retrieved, sigma, true, covariance


def _drawn(
    rng: np.random.Generator, kind: str, num_pixels: int
) -> tuple[State, State, np.ndarray, np.ndarray]:
    """The cells of pixels as they are, the pixels as they are believed, and what is to be found."""
    n = num_pixels
    aod = MEAN_AOD * np.exp(SIGMAS[0] * rng.standard_normal(n))
    smallest, largest = np.log(_RADII_UM[kind])
    radius = np.exp(rng.uniform(smallest, largest, n))
    albedo = rng.uniform(*_ALBEDO, (n, len(BANDS)))
    geometry = scenes.random_directions(rng, n)
    of_plume = _uneven(rng, n, _UNEVEN_PLUME)
    of_ground = _uneven(rng, n, _UNEVEN_GROUND)
    base = np.full(n * STRIPS, scenes.BASE[kind] + RAISED)
    mie = MiePlume(
        base=jnp.asarray(base),
        top=jnp.asarray(base + scenes.THICKNESS),
        extinction_550=jnp.asarray((aod[:, None] * of_plume).ravel() / scenes.THICKNESS),
        brightness=jnp.ones(n * STRIPS),
        effective_radius_um=jnp.repeat(jnp.asarray(radius), STRIPS),
        species=kind,
    )
    cells = State(
        scenes.clear_air(n * STRIPS, {kind: mie}),
        {b: jnp.asarray((albedo[:, i, None] * of_ground).ravel()) for i, b in enumerate(BANDS)},
        jax.tree.map(lambda angle: jnp.repeat(angle, STRIPS), geometry),
    )
    air = scenes.clear_air(n, {kind: scenes.known_plume(kind, n, BANDS)})
    believed = scenes.with_albedo(State(air, {}, geometry), albedo, BANDS)
    spheres = [mie_optics(kind, jnp.asarray(radius), band) for band in BANDS]
    ssa = np.stack([1 - np.asarray(s.coalbedo) for s in spheres], axis=-1)
    return cells, believed, aod, ssa


def _uneven(rng: np.random.Generator, num_pixels: int, spread: float) -> np.ndarray:
    """Positive factors of the strips of pixels, whose mean is 1. [-]"""
    factors = np.exp(spread * rng.standard_normal((num_pixels, STRIPS)))
    return factors / factors.mean(axis=1, keepdims=True)


def _mean_shift(truth: Truth, kind: str) -> np.ndarray:
    """The shift of the logit of the believed ssa that is nearest to the truth in all bands. [-]"""
    plumes = truth.state.atmosphere.plumes[kind]
    assert isinstance(plumes, Plume)
    believed = np.stack([np.asarray(plumes.ssa[band]) for band in BANDS], axis=-1)
    return np.mean(scipy.special.logit(truth.ssa) - scipy.special.logit(believed), axis=-1)


def _retrieved(
    forward: ForwardModel, vector: StateVector, kind: str, observation: Observation, state: State
) -> tuple[np.ndarray, np.ndarray]:
    """Optical depth and ssa in C02, and their posterior standard deviations, (quantity, pixel)."""
    prior = Prior(np.asarray(vector.x(MEAN_AOD, 0.0)), np.diag(np.square(SIGMAS)))
    found = retrieve_pixels(forward, observation, state, prior=prior).inversion
    values = vector.values(jnp.asarray(found.x))
    plumes = state.atmosphere.plumes[kind]
    assert isinstance(plumes, Plume)
    ssa = scipy.special.expit(
        scipy.special.logit(np.asarray(plumes.ssa["C02"])) + np.asarray(values["ssa_shift"])
    )
    aod = np.asarray(values["aod_550"])
    of_aod, of_shift = sigmas(vector, found).T
    sigma = np.stack([of_aod, ssa * (1 - ssa) * of_shift])
    return np.where(found.converged, np.stack([aod, ssa]), np.nan), sigma


def draw_independent_truth(table: xr.Dataset, figure: "Figure") -> None:
    """Of each quantity retrieved against true values with their errors, and the coverage."""
    figure.set_size_inches(16, 12)
    axes = figure.subplots(len(table["quantity"]), 3, squeeze=False)
    probability = np.linspace(0.02, 0.98, 49)
    widths = scipy.stats.norm.ppf((1 + probability) / 2)
    for row, quantity in zip(axes, table["quantity"].values, strict=True):
        truth = table["truth"].sel(quantity=quantity).values
        row[2].plot([0, 1], [0, 1], color="black", linewidth=1)
        for panel, case in zip(row, table["S_obs"].values, strict=False):
            one = table.sel(quantity=quantity, S_obs=case)
            retrieved, sigma = one["retrieved"].values, one["sigma"].values
            panel.errorbar(truth, retrieved, sigma, fmt=".", markersize=3, linewidth=0.6)
            panel.plot(*[[truth.min(), truth.max()]] * 2, color="black", linewidth=1)
            panel.set(xlabel=f"true {quantity}", ylabel="retrieved")
            panel.set_title(f"S_obs of {case}: bias {float(one['bias']):.3f}")
            ratio = np.abs(retrieved - truth) / sigma
            row[2].plot(probability, [np.nanmean(ratio <= w) for w in widths], label=case)
        row[2].set(xlabel="probability of the interval", ylabel="share of truths inside")
        row[2].set_title(quantity)
        row[2].legend()
