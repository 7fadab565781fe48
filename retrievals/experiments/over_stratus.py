"""Smoke over stratus, against smoke over land.

A bright cloud below makes smoke visible by what it absorbs, where over dark ground it is seen by
what it scatters: optical depth and single-scattering albedo are told by other bands, and what is
not known of the cloud enters as what is not known of the ground does.
"""

from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from abi_operator import LiquidCloud, State

from ..declarations import plume, with_droplet_radius, with_optical_thickness
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

BELOW = ("land", "stratus")
KNOWN = ("as it is", "10 % errors")
"""What is below: the albedo of the land, or the optical thickness of the stratus."""
RELATIVE_ERROR = 0.1
MEAN_AOD, SIGMAS = 0.4, (0.7, 0.4)
"""Of the prior, from which the truth is drawn: optical depth, and x."""
QUANTITIES = ("aod_550", "ssa_shift")

_THICKNESS, _SPREAD = 10.0, 0.4  # of the stratus, and standard deviation of its logarithm [-]
_DROPLET_UM = 10.0  # effective radius [um]
_MASS_PATH, _NUMBER_PATH = 0.06, 5e10  # of what is made such a cloud [kg m-2], [m-2]
_CLOUDY = -2  # the layer that holds the stratus, from 0.45 to 1.26 km


@scenes.in_double_precision
def over_stratus(*, size: int = 20, seed: int = 0, num_streams: int = 8) -> xr.Dataset:
    """How well are optical depth and absorption of smoke retrieved over stratus, and over land, if
    what is below is known as it is, or with errors of 10 %?

    Parameters
    ----------
    size
        Rows and columns of the image.
    seed
        Of what is below, of smoke and of noise.
    num_streams
        Of the solver, for truth and retrieval.

    Returns
    -------
    xarray.Dataset
        Of `aod_550` and the shift of the logit of ssa (prefix ``ssa_shift_``) scores by ``below``
        and ``known``, and mean posterior standard deviations; degrees of freedom of both; truth,
        retrieval and standard deviation of every pixel.
    """
    rng = np.random.default_rng(seed)
    n, vector = size**2, plume("smoke", ssa=True)
    prior = Prior(np.asarray(vector.x(MEAN_AOD, 0.0)), np.diag(np.square(SIGMAS)))
    fields = np.stack([scenes.random_field(rng, size).ravel() for _ in SIGMAS], axis=-1)
    x = prior.x_prior + np.asarray(SIGMAS) * fields
    albedo = scenes.land_albedo(rng, size, BANDS).reshape(n, -1)
    sea = scenes.water_albedo(rng, size, BANDS).reshape(n, -1)
    thickness = _THICKNESS * np.exp(_SPREAD * scenes.random_field(rng, size, 30e3).ravel())

    def wrong(value: np.ndarray) -> np.ndarray:
        return value * (1 + RELATIVE_ERROR * rng.standard_normal(value.shape))

    nothing = np.zeros(n)
    true = (_state(albedo, nothing), _state(sea, thickness))
    believed = (_state(wrong(albedo), nothing), _state(sea, wrong(thickness)))
    both = jax.tree.map(lambda *parts: jnp.concatenate(parts), *true)
    forward = prepared(ForwardModel(vector, BANDS, num_streams, gases=()), both)
    seen = np.asarray(forward(jnp.asarray(np.concatenate([x, x])), both))
    noisy = seen + measurement(seen, BANDS).sigma * rng.standard_normal(seen.shape)
    states = jax.tree.map(lambda *parts: jnp.concatenate(parts), *true, *believed)
    observations = measurement(np.concatenate([noisy, noisy]), BANDS)
    found = retrieve_pixels(forward, observations, states, prior=prior).inversion

    def by_case(values: np.ndarray) -> np.ndarray:
        """From (known, below, pixel) in one row to (below, known, pixel)."""
        return np.swapaxes(values.reshape(len(KNOWN), len(BELOW), n), 0, 1)

    kernel = np.trace(found.averaging_kernel, axis1=1, axis2=2)
    freedom = by_case(kernel).mean(axis=-1)
    values, deviations = vector.values(jnp.asarray(found.x)), sigmas(vector, found)
    truth = vector.values(jnp.asarray(x))
    dims = ("below", "known")
    variables: dict[str, tuple] = {
        "degrees_of_freedom": (dims, freedom, {"units": "1", "long_name": "of both, at most 2"})
    }
    for i, name in enumerate(QUANTITIES):
        one = by_case(np.where(found.converged, np.asarray(values[name]), np.nan))
        sigma, right = by_case(deviations[:, i]), np.asarray(truth[name])
        prefix = "" if i == 0 else f"{name}_"
        chosen = score_variables(one, right, sigma, dims, prefix=prefix)
        wanted = ("num_pixels", "bias", "rmse", "coverage_68")[min(i, 1) :]
        variables |= {prefix + word: chosen[prefix + word] for word in wanted}
        variables[f"{prefix}mean_sigma"] = (dims, np.mean(sigma, axis=-1), {"units": "1"})
        variables[f"true_{name}"] = ("pixel", right, {"units": "1"})
        variables[name] = ((*dims, "pixel"), one, {"units": "1"})
        variables[f"{name}_sigma"] = ((*dims, "pixel"), sigma, {"units": "1"})
    return xr.Dataset(
        variables, {"below": list(BELOW), "known": list(KNOWN)}, {"rows": "below known"}
    )


def _state(albedo: np.ndarray, thickness: np.ndarray) -> State:
    """Columns with smoke over a ground, and stratus of an optical thickness between."""
    n = thickness.size
    layer = jnp.zeros((n, scenes.NUM_LAYERS)).at[:, _CLOUDY].set(1.0)
    any_cloud = LiquidCloud(_MASS_PATH * layer, _NUMBER_PATH * layer)
    cloud = with_droplet_radius(any_cloud, jnp.full(n, _DROPLET_UM))
    cloud = with_optical_thickness(cloud, jnp.asarray(thickness))
    air = scenes.clear_air(n, {"smoke": scenes.known_plume("smoke", n, BANDS)}, cloud)
    return scenes.with_albedo(State(air, {}, scenes.directions(n)), albedo, BANDS)


def draw_over_stratus(table: xr.Dataset, figure: "Figure") -> None:
    """Retrieved against true values, by what is below and by how well it is known."""
    figure.set_size_inches(16, 8)
    cases = [(below, known) for below in BELOW for known in KNOWN]
    axes = figure.subplots(len(QUANTITIES), len(cases))
    for row, name in zip(axes, QUANTITIES, strict=True):
        truth = table[f"true_{name}"].values
        for panel, (below, known) in zip(row, cases, strict=True):
            one = table.sel(below=below, known=known)
            retrieved, sigma = one[name].values, one[f"{name}_sigma"].values
            panel.errorbar(truth, retrieved, sigma, fmt=".", markersize=3, linewidth=0.5, alpha=0.6)
            ends = [truth.min(), truth.max()]
            panel.plot(ends, ends, color="black", linewidth=1)
            rmse = float(one["rmse" if name == "aod_550" else f"{name}_rmse"])
            panel.set(xlabel=f"true {name}", ylabel="retrieved")
            panel.set_title(f"over {below}, {known}: rmse {rmse:.3f}")
