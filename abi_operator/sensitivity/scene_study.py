"""Sensitivities on a scene: the result of a simulation in, maps out."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..atmosphere import Fire, State
from ..files import InputError
from ..plume_edges import moves_plume_edges
from ..radiance import FIRE_BANDS, WARMEST_WITHOUT_FIRE
from ..scene import gases_of, species_of, states_of_result, sun_path_of
from ..scene.angles import sun_distance
from ..settings import Settings, streams_of_attributes
from .declarations import declared
from .derivatives import Function, Sensitivity, sensitivity
from .inputs import Input, changed
from .outputs import FIRE_CONTRAST, bands_of, check_outputs, output_function
from .result_checks import DARK, check_result, of_columns
from .study_dataset import SampledPixels, study_dataset
from .variance import check_once, covariance_of, sampled_variance

STANDARD_TEMPERATURE = 288.15
"""Of ground and air where a result has none and a fire is added: what they give off themselves is
some 1e-4 of sunlight in C06. [K]"""
DEFAULT_FIRE = Fire(0.04, 800.0)  # pyright: ignore[reportArgumentType]
"""One cell of 400 m in a pixel of 2 km."""


class Sampling(NamedTuple):
    """How the variance is checked by draws.

    Parameters
    ----------
    num_samples
        Draws a pixel; 0 for no check.
    num_pixels
        Pixels that are checked, chosen by the seed.
    seed
        Of the draws.
    """

    num_samples: int = 256
    num_pixels: int = 64
    seed: int = 0


def sensitivity_study(
    image: xr.Dataset,
    of: Sequence[str],
    to: Sequence[str | Input],
    *,
    species: str | None = None,
    where: Literal["plume", "all"] = "plume",
    sigma: Mapping[str, float] | None = None,
    correlations: Mapping[tuple[str, str], float] | None = None,
    fire: Fire = DEFAULT_FIRE,
    second_order: bool = True,
    sampling: Sampling | None = None,
) -> xr.Dataset:
    """Sensitivities of a scene's image to what is in the scene, in float64.

    Where an edge of a plume is changed, columns have levels that go with it (`with_plume_edges`);
    where the sun is moved, its path is that of where it is moved to.

    Parameters
    ----------
    image
        Result of a simulation at one time, all of it.
    of
        What is looked at, as `outputs.check_outputs` takes it.
    to
        What is changed: names as `declarations.declared` takes them, or inputs of your own.
    species
        Name of the plume; None for the one that the scene has, if it has one.
    where
        ``"plume"``: pixels in the plume, all of a scene without; ``"all"``: all that the sun
        shines on.
    sigma
        Steps and standard deviations by name, in place of the declared ones.
    correlations
        Between inputs, by pairs of names. [-]
    fire
        What burns in every pixel where the contrast of a fire is looked at, in C05 and C06 beside
        it as well. Without that contrast what the scene itself has of fires shines there.
    second_order, sampling
        Whether second derivatives are wanted, and the check of the variance (None: as it is by
        default).

    Returns
    -------
    xarray.Dataset
        Along ``of``, ``to``, y and x: ``jacobian``, ``elasticity``, ``change_up``,
        ``change_down``, ``second_derivative``, ``variance_part``, ``sampled_part`` and its
        standard error ``sampled_part_error``; along ``of``, y and x ``value``, ``variance``,
        ``sampled_variance``, ``sampled_variance_error`` and ``sampled_linear``; ``step`` along
        ``to``. NaN where a
        pixel is not looked at, or may not be changed so.

    Raises
    ------
    InputError
        Where the result lacks something, a name is unknown or given twice, or one sample is to tell
        a variance.
    """
    sampling = sampling or Sampling()
    try:
        if sampling.num_samples == 1:
            raise ValueError("a variance needs 2 samples or more, or 0 for no check; got 1.")
        of = check_outputs(of)
        check_once("output", of)
        species = _species(image, species)
        check_result(image, of_columns(image), bands_of(of))
        inputs = [_input(one, species, sigma or {}) for one in to]
        unknown = sorted(set(sigma or {}) - {one.name for one in inputs})
        if unknown:
            raise ValueError(f"sigma of {', '.join(unknown)} is given, which nothing hangs on.")
        with jax.enable_x64(True):
            covariance = covariance_of(inputs, correlations)
            chosen = chosen_pixels(image, species, where)
            states = _under_a_moving_sun(image, states_of(image, chosen, of, fire), inputs)
            how = settings_of_result(image)
            first = jax.tree.map(lambda leaf: leaf[:1], states)
            if moves_plume_edges(lambda x: changed(first, inputs, x[None]), len(inputs)):
                how = how._replace(plume_edges=True)
            function = output_function(of, how, sun_distance_of(image))
            found = sensitivity(function, states, inputs, second_order=second_order)
            sampled = _sampled(function, states, inputs, found, covariance, sampling)
    except ValueError as error:
        raise InputError(str(error)) from None
    said = _said_of_result(image) | {"where": where}
    said |= {} if species is None else {"species": species}
    said |= {"fire": _in_words(fire)} if FIRE_CONTRAST in of else {}
    said |= {} if sampled is None else {"samples": sampling.num_samples, "seed": sampling.seed}
    return study_dataset(image, chosen, (of, inputs), found, covariance, sampled, said)


def _said_of_result(image: xr.Dataset) -> dict[str, Any]:
    """How a result was simulated, in its own attributes."""
    names = "satellite", "gases", "num_streams", "streams_error", "sun_path"
    return {name: image.attrs[name] for name in names if name in image.attrs}


def _in_words(fire: Fire) -> str:
    return f"{float(fire.fraction):g} of each pixel at {float(fire.temperature):g} K"


def _under_a_moving_sun(image: xr.Dataset, states: State, inputs: Sequence[Input]) -> State:
    """States whose sun has a sphere's layers at hand where a step of an input moves it.

    A result's columns have them only where the sun is low as they are, and a step may lower it.
    """
    geometry, count = states.geometry, states.geometry.solar_zenith.shape[0]
    steps = jnp.tile(jnp.array([one.step for one in inputs]), (count, 1))
    moved = np.asarray(changed(states, inputs, steps).geometry.solar_zenith)
    if sun_path_of(image) != "spherical" or (moved == np.asarray(geometry.solar_zenith)).all():
        return states
    return replace(states, geometry=replace(geometry, spherical=True))


def _sampled(
    function: Function,
    states: State,
    inputs: Sequence[Input],
    found: Sensitivity,
    covariance: np.ndarray,
    sampling: Sampling,
) -> SampledPixels | None:
    if not sampling.num_samples:
        return None
    rng = np.random.default_rng(sampling.seed)
    count = len(found.value)
    pixels = np.sort(rng.choice(count, min(sampling.num_pixels, count), replace=False))
    some = jax.tree.map(lambda x: x[pixels], states)
    how = {"num_samples": sampling.num_samples, "seed": sampling.seed}
    jacobian = found.jacobian[pixels]
    return SampledPixels(
        pixels, sampled_variance(function, some, inputs, jacobian, covariance, **how)
    )


def _input(one: str | Input, species: str | None, sigma: Mapping[str, float]) -> Input:
    found = declared(one, species) if isinstance(one, str) else one
    return found.stepping(sigma[found.name]) if found.name in sigma else found


def _species(image: xr.Dataset, species: str | None) -> str | None:
    there = species_of(image)
    if species is not None and species not in there:
        raise ValueError(
            f"the result has no plume of {species} (plumes: {', '.join(there) or 'none'})."
        )
    if species is None and len(there) > 1:
        raise ValueError(f"the result has plumes of {', '.join(there)}; say which is meant.")
    return species if species is not None else next(iter(there), None)


def chosen_pixels(image: xr.Dataset, species: str | None, where: str) -> np.ndarray:
    """Pixels that are looked at (y, x); an `InputError` where there is none."""
    if where not in ("plume", "all"):
        raise InputError(f"pixels are those of 'plume' or 'all'; got {where!r}.")
    chosen = (image["quality_flag"].values & DARK) == 0
    if where == "plume" and species is not None:
        chosen &= image[f"{species}_brightness"].values > 0
    if not chosen.any():
        raise InputError("there is no pixel to look at: the sun shines on none of those chosen.")
    return chosen


def states_of(image: xr.Dataset, chosen: np.ndarray, of: Sequence[str], fire: Fire) -> State:
    """Columns of pixels (y, x), with temperatures and a fire where what shines is looked at.

    Where the contrast of a fire is, that burns in every column; elsewhere the scene's own fires do,
    or none does over a ground that shines without, as lava, which a fire without a share tells.
    """
    y, x = (xr.DataArray(index, dims="column") for index in np.nonzero(chosen))
    bands = bands_of(of)
    states = states_of_result(image.isel(y=y, x=x), bands)
    if not set(bands) & set(FIRE_BANDS):
        return states
    count = int(chosen.sum())
    burning, air, ground = states.fire, states.atmosphere, states.surface_temperature
    if FIRE_CONTRAST in of:
        burning = jax.tree.map(lambda value: np.full(count, float(value)), fire)
    elif burning is None and ground is not None and np.max(ground) > WARMEST_WITHOUT_FIRE:
        nothing: Any = np.zeros(count), np.full(count, float(DEFAULT_FIRE.temperature))
        burning = Fire(*nothing)
    if burning is None:
        return states
    if air.temperature is None:
        warm: Any = np.full_like(air.pressure, STANDARD_TEMPERATURE)
        air = replace(air, temperature=warm)
    if ground is None:
        ground = np.asarray(air.temperature)[:, -1]
    return replace(states, atmosphere=air, surface_temperature=ground, fire=burning)


def settings_of_result(image: xr.Dataset) -> Settings:
    """How a result was simulated, but for the error that it was allowed."""
    return Settings(
        satellite=str(image.attrs.get("satellite", "GOES-16")),
        gases=gases_of(image),
        num_streams=streams_of_attributes(image.attrs),
    )


def sun_distance_of(image: xr.Dataset) -> float:
    """Distance of the sun at the time of a result, 1 where it has none. [AU]"""
    return sun_distance(image["time"].values) if "time" in image.variables else 1.0
