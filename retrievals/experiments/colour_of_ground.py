"""Ash of the colour of the ground.

A plume brightens dark ground and darkens bright ground; between is an albedo at which it changes
nothing, another one in every band. Over a ground that has these albedos in all bands ash of the
mean optical depth cannot be seen, and what is left to a retrieval is that there is not much more
of it. The albedo without contrast rises with optical depth and with ssa, so that the least is told
from that colour on to somewhat brighter grounds. How wide the gap is, and how much of it is due to
an ssa that is not known, is asked of grounds whose albedos are a multiple of it.
"""

from typing import TYPE_CHECKING

import jax.numpy as jnp
import numpy as np
import xarray as xr

from abi_operator import State

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

MEAN_AOD, SIGMA = 0.4, 0.7
"""Of the prior, from which the truth is drawn: optical depth [-], and its x [-]."""
SSA = {"known": 1e-3, "retrieved": 0.3}
"""Spread of the shift of the logit of ssa, of the truth and of the prior, by what is retrieved."""
MULTIPLES = (0.25, 1.75)
"""Of the albedo without contrast, the first and the last. [-]"""

_DRAWS = 8  # retrievals of each multiple, in multiples
_GRID = np.linspace(0.0, 1.0, 41)  # albedos between which contrast is looked for


@scenes.in_double_precision
def ash_colour(*, size: int = 9, seed: int = 0, num_streams: int = 8) -> xr.Dataset:
    """How much can be told of ash, by degrees of freedom and errors, as the ground's albedo comes
    near that at which ash has no contrast in any band?

    Parameters
    ----------
    size
        Number of grounds; of each eight times as many pixels are retrieved.
    seed
        Of ash and noise.
    num_streams
        Of the solver, for truth and retrieval.

    Returns
    -------
    xarray.Dataset
        By ``multiple`` of the albedo without contrast: `contrast`, what ash of the mean optical
        depth adds to the reflectance factor, and `albedo`, by band; degrees of freedom of optical
        depth and ssa, scores of optical depth and its mean posterior standard deviation.
    """
    rng = np.random.default_rng(seed)
    vector = plume("ash", ssa=True)
    forward = ForwardModel(vector, BANDS, num_streams, gases=())
    forward = prepared(forward, _grey(_GRID))
    colour = _without_contrast(forward)
    multiple = np.linspace(*MULTIPLES, size)
    albedo = np.minimum(multiple[:, None] * colour, 1.0)
    contrast = _contrast(forward, _over(albedo))

    n = _DRAWS * size  # pixels of each ground
    ground = np.tile(np.repeat(albedo, n, axis=0), (len(SSA), 1))  # (ssa, ground, pixel) in a row
    spread = np.repeat([[SIGMA, of_ssa] for of_ssa in SSA.values()], size * n, axis=0)
    prior = Prior(
        np.broadcast_to(vector.x(MEAN_AOD, 0.0), spread.shape), spread[:, :, None] ** 2 * np.eye(2)
    )
    x = prior.x_prior + spread * rng.standard_normal(spread.shape)
    states = _over(ground)
    seen = np.asarray(forward(jnp.asarray(x), states))
    noisy = seen + measurement(seen, BANDS).sigma * rng.standard_normal(seen.shape)
    found = retrieve_pixels(forward, measurement(noisy, BANDS), states, prior=prior).inversion

    def by_case(values: np.ndarray) -> np.ndarray:
        return np.swapaxes(values.reshape(len(SSA), size, n), 0, 1)

    depth, truth = (np.asarray(vector.values(jnp.asarray(z))["aod_550"]) for z in (found.x, x))
    depth, deviation, truth, freedom = (
        by_case(a)
        for a in (
            np.where(found.converged, depth, np.nan),
            sigmas(vector, found)[:, 0],
            truth,
            np.asarray(found.averaging_kernel[:, 0, 0]),
        )
    )
    rows = ("multiple", "ssa")
    variables: dict[str, tuple] = {
        "contrast_C02": ("multiple", contrast[:, BANDS.index("C02")], {"units": "1"}),
        "freedom_aod": (rows, freedom.mean(axis=-1), {"units": "1"}),
        "mean_sigma": (rows, deviation.mean(axis=-1), {"units": "1"}),
    }
    variables |= score_variables(depth, truth, deviation, rows)
    variables |= {
        "albedo": (("multiple", "band"), albedo, {"units": "1"}),
        "contrast": (("multiple", "band"), contrast, {"units": "1"}),
        "albedo_without_contrast": ("band", colour, {"units": "1"}),
    }
    coordinates = {"multiple": multiple, "ssa": list(SSA), "band": list(BANDS)}
    return xr.Dataset(variables, coordinates, {"rows": " ".join(rows)})


def _grey(albedo: np.ndarray) -> State:
    return _over(np.stack([albedo] * len(BANDS), axis=-1))


def _over(albedo: np.ndarray) -> State:
    """Columns with ash over grounds, (pixel, band)."""
    n = len(albedo)
    air = scenes.clear_air(n, {"ash": scenes.known_plume("ash", n, BANDS)})
    return scenes.with_albedo(State(air, {}, scenes.directions(n)), albedo, BANDS)


def _contrast(forward: ForwardModel, states: State) -> np.ndarray:
    """What ash of the mean optical depth adds to the reflectance factor, (pixel, band). [-]"""
    one = jnp.ones_like(states.geometry.solar_zenith)
    with_ash, without = (
        np.asarray(forward(forward.vector.x(depth * one, 0 * one), states))
        for depth in (MEAN_AOD, 1e-6)
    )
    return with_ash - without


def _without_contrast(forward: ForwardModel) -> np.ndarray:
    """Albedo of each band at which ash adds nothing, between those of a grid. [-]

    Contrast falls with albedo, from what ash scatters to what it hides.
    """
    contrast = _contrast(forward, _grey(_GRID))
    return np.array([np.interp(0.0, -by_band, _GRID) for by_band in contrast.T])


def draw_ash_colour(table: xr.Dataset, figure: "Figure") -> None:
    """Contrast by band, degrees of freedom and errors, against the multiple of the albedo."""
    figure.set_size_inches(15, 4.5)
    multiple = table["multiple"].values
    contrast, freedom, errors = figure.subplots(1, 3)
    for band, albedo in zip(BANDS, table["albedo_without_contrast"].values, strict=True):
        label = f"{band}: no contrast at {albedo:.2f}"
        contrast.plot(multiple, table["contrast"].sel(band=band), label=label)
    contrast.axhline(0, color="black", linewidth=0.5)
    contrast.set(
        ylabel="change of the reflectance factor", title=f"ash of optical depth {MEAN_AOD}"
    )
    for ssa, colour in zip(table["ssa"].values, ("tab:blue", "tab:orange"), strict=True):
        one = table.sel(ssa=ssa)
        freedom.plot(multiple, one["freedom_aod"], color=colour, label=f"ssa {ssa}")
        errors.plot(multiple, one["rmse"], color=colour, label=f"rmse, ssa {ssa}")
        words = f"mean posterior sigma, ssa {ssa}"
        errors.plot(multiple, one["mean_sigma"], "--", color=colour, label=words)
    freedom.set(ylabel="degrees of freedom of optical depth", ylim=(0, 1.05))
    freedom.set_title("told by the measurement")
    room = 1.6 * float(max(table["rmse"].max(), table["mean_sigma"].max()))  # for the legend
    errors.set(ylabel="error of optical depth", ylim=(0, room), title="retrieved optical depth")
    for panel in (contrast, freedom, errors):
        panel.axvline(1, color="grey", linestyle="--", linewidth=1)
        panel.set_xlabel("albedo of the ground by that without contrast")
        panel.legend()
