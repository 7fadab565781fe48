"""Fires that saturate C07, looked for in C06 over bright and over dark ground.

A saturated band says that something burns, but no longer what, and how far that reaches; C06 does
not saturate and sees it beside the sunlight that the ground reflects. A fire is looked for as the
excess of C06 over what the operator makes of the ground without fire, in standard deviations of the
noise, so that it matters how well the albedo is known.
"""

from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from abi_operator import Atmosphere, State, standard_atmosphere
from abi_operator.instrument import IMAGER

from ..declarations import fire
from ..fire_detection import surroundings
from ..fires import with_fire
from ..forward import THERMAL, ForwardModel, prepared
from ..observation import ceiling, measurement
from ..scoring import Detection, detection
from . import scenes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BANDS = ("C06", THERMAL)
GROUNDS = ("bright", "dark")
KNOWN = ("as it is", "10 % errors", "its mean", "neighbours")
"""Albedo of the ground that the excess is counted from; or, instead, the pixels around."""
RELATIVE_ERROR = 0.1
BURNING = 0.08
"""Share of the pixels in which something burns, of the bright and of the dark ones. [-]"""
TEMPERATURE = (450.0, 600.0)
"""Of the fires; hotter ones stand out from any ground. [K]"""
BEYOND = (1.02, 1.5)
"""Size of a fire in that at which C07 saturates. [-]"""
FALSE_ALARM_RATE = 0.01
"""At which hits are counted. [-]"""

_ATMOSPHERE, _LEVELS = "midlatitude_summer", np.linspace(1, 0, 21) ** 1.5 * 40e3
_GROUND_TEMPERATURE, _SPREAD = 300.0, 2.0  # and its standard deviation [K]
_C07_ALBEDO = 0.05
_TRIAL = 0.01  # fraction at which the slope of C07's radiance is taken


@scenes.in_double_precision
def saturated_fires(*, size: int = 32, seed: int = 0, num_streams: int = 8) -> xr.Dataset:
    """How surely are fires that saturate C07 told in C06, over bright and dark ground, if albedo
    is known as it is, with errors of 10 %, as its mean, or by the pixels around?

    Parameters
    ----------
    size
        Rows and columns of the image.
    seed
        Of ground, fires and noise.
    num_streams
        Of the solver.

    Returns
    -------
    xarray.Dataset
        `roc_area`, `hit_rate` at a false alarm rate of 1 % and counts by ``ground`` (brighter or
        darker in C06 than half of the pixels) and ``known_albedo``; maps of what is seen, of what
        burns, and of the `excess`.
    """
    rng = np.random.default_rng(seed)
    num_pixels = size**2
    albedo = scenes.land_albedo(rng, size, BANDS[:1]).reshape(-1)
    warmth = _GROUND_TEMPERATURE + _SPREAD * scenes.random_field(rng, size).ravel()
    bright = albedo > np.median(albedo)
    burns = np.zeros(num_pixels, bool)
    for half in (np.flatnonzero(bright), np.flatnonzero(~bright)):
        burns[rng.choice(half, max(1, round(BURNING * half.size)), replace=False)] = True
    temperature = rng.uniform(*TEMPERATURE, num_pixels)
    beyond = rng.uniform(*BEYOND, num_pixels)
    wrong = albedo * (1 + RELATIVE_ERROR * rng.standard_normal(num_pixels))
    known = {
        "as it is": albedo,
        "10 % errors": wrong,
        "its mean": np.full_like(albedo, albedo.mean()),
    }

    states = with_fire(_ground(albedo, warmth), 0.0)
    forward = prepared(ForwardModel(fire(), BANDS, num_streams), states)

    def seen(fraction: np.ndarray | float, albedo: np.ndarray = albedo) -> np.ndarray:
        x = forward.vector.x(jnp.asarray(temperature), jnp.asarray(fraction + np.zeros(num_pixels)))
        return np.asarray(forward(x, with_fire(_ground(albedo, warmth), 0.0)))

    nothing = 1e-7  # which C06 and C07 do not see
    without = {name: seen(nothing, assumed) for name, assumed in known.items()}
    cold = without["as it is"][:, 1]
    slope = (seen(_TRIAL)[:, 1] - cold) / _TRIAL
    fraction = np.where(burns, np.minimum(beyond * (ceiling(THERMAL) - cold) / slope, 1.0), nothing)
    whole = seen(fraction)
    noisy = whole + measurement(whole, BANDS).sigma * rng.standard_normal(whole.shape)
    observation = measurement(noisy, BANDS)
    measured, sigma = (np.asarray(a)[:, 0] for a in (observation.measured, observation.sigma))
    excess = {name: (measured - expected[:, 0]) / sigma for name, expected in without.items()}
    around = surroundings(measured.reshape(1, size, size), BANDS[:1], IMAGER)
    excess["neighbours"] = around.score.ravel()
    saturated = np.asarray(observation.saturated)[:, 1]
    return _table(size, albedo, burns, measured, saturated, np.stack([excess[k] for k in KNOWN]))


def _ground(albedo: np.ndarray, warmth: np.ndarray) -> State:
    """Columns under a summer's air, by albedo in C06 and temperature of the ground."""
    n = albedo.size
    air: Atmosphere = jax.tree.map(
        lambda leaf: jnp.broadcast_to(leaf, (n, *jnp.shape(leaf))),
        standard_atmosphere(_ATMOSPHERE, _LEVELS),
    )
    grounds = {"C06": jnp.asarray(albedo), THERMAL: jnp.full(n, _C07_ALBEDO)}
    return State(air, grounds, scenes.directions(n), jnp.asarray(warmth))


def _table(
    size: int,
    albedo: np.ndarray,
    burns: np.ndarray,
    measured: np.ndarray,
    saturated: np.ndarray,
    excess: np.ndarray,
) -> xr.Dataset:
    bright = albedo > np.median(albedo)
    cases, image = ("ground", "known_albedo"), ("y", "x")
    found = [[_judged(score[rows], burns[rows]) for score in excess] for rows in (bright, ~bright)]
    words = {"hit_rate": f"share of fires told at a false alarm rate of {FALSE_ALARM_RATE:g}"}
    words |= {"roc_area": "area under the curve of hits against false alarms"}
    words |= {"num_true": "pixels that burn", "num_pixels": "pixels"}
    variables: dict[str, tuple] = {
        name: (cases, [[getattr(one, name) for one in row] for row in found], {"long_name": label})
        for name, label in words.items()
    }
    inside = [saturated[burns & rows].mean() for rows in (bright, ~bright)]
    maps = {"albedo": albedo, "burns": burns, "measured": measured, "saturated": saturated}
    variables |= {"share_saturated": ("ground", inside)}
    variables |= {name: (image, values.reshape(size, size)) for name, values in maps.items()}
    variables["excess"] = (("known_albedo", *image), excess.reshape(-1, size, size))
    coordinates = {"ground": list(GROUNDS), "known_albedo": list(KNOWN)}
    return xr.Dataset(variables, coordinates, {"rows": " ".join(cases)})


def _judged(score: np.ndarray, burns: np.ndarray) -> Detection:
    threshold = float(np.quantile(score[~burns], 1 - FALSE_ALARM_RATE))
    return detection(score, burns, threshold)


def draw_saturated_fires(table: xr.Dataset, figure: "Figure") -> None:
    """Ground and fires, what C06 sees, its excess by known albedo, and the curves of detection."""
    figure.set_size_inches(16, 8)
    axes = figure.subplots(2, 4)
    y, x = np.nonzero(table["burns"].values)
    for panel, name, label in (
        (axes[0, 0], "albedo", "albedo in C06; circles: fires"),
        (axes[0, 1], "measured", "reflectance factor of C06"),
    ):
        drawn = panel.imshow(table[name], origin="lower", cmap="Greys_r")
        panel.plot(x, y, "o", markersize=4, markerfacecolor="none", color="tab:red")
        panel.set_title(label)
        figure.colorbar(drawn, ax=panel)
    panels = (axes[0, 2], axes[0, 3], axes[1, 0], axes[1, 1])
    for panel, known in zip(panels, table["known_albedo"].values, strict=True):
        excess = table["excess"].sel(known_albedo=known)
        limit = float(np.nanpercentile(np.abs(excess), 95)) or 1.0
        drawn = panel.imshow(excess, origin="lower", cmap="RdBu_r", vmin=-limit, vmax=limit)
        panel.set_title(f"excess [sigma]: {known}")
        figure.colorbar(drawn, ax=panel)
    middle = float(table["albedo"].median())
    for panel, ground in zip(axes[1, 2:], table["ground"].values, strict=True):
        rows = (table["albedo"] > middle).values == (ground == "bright")
        for known in table["known_albedo"].values:
            score, burns = (
                table["excess"].sel(known_albedo=known).values[rows],
                table["burns"].values[rows],
            )
            levels = np.concatenate([[np.inf], np.sort(score)[::-1]])
            alarms, hits = (np.mean(score[k] >= levels[:, None], axis=1) for k in (~burns, burns))
            area = float(table["roc_area"].sel(ground=ground, known_albedo=known))
            panel.plot(alarms, hits, label=f"{known}: area {area:.3f}")
        panel.set(xlabel="false alarm rate", ylabel="hit rate", title=f"{ground} ground")
        panel.legend(loc="lower right")
