"""Fires from the result of a simulation: temperature, burning share and a black one's power.

A fire shines in C05, C06 and C07, by day and by night, and is measured there as radiance: what a
result calls so, sunlight and heat together. Pixels are attempted where they stand out of their
surroundings (`fire_detection`); whether the result says where it burns is not looked at. A band
that is saturated is a lower bound, and ``num_values`` tells how many bands are not.

What does not burn in a pixel is known in one of two ways. *Stored*: the ground's temperature and
albedo are those of the result, and the whole pixel is modelled. *Neighbours*: what the surrounding
pixels show on average is taken for what this one would show without fire, and their spread is part
of its error; modelled is no more than what the fire adds. The shift of the measurement

.. math:: L' = L - \\bar L + F(p = 0), \\qquad \\sigma'^2 = \\sigma_\\epsilon^2 + s^2

does so with the same forward model F, in which the fire has no share p. Of the ground's temperature
and albedo the result then has errors only as far as they change what the fire adds.
"""

from collections.abc import Sequence
from functools import partial
from typing import Any, Literal, get_args

import equinox as eqx
import jax
import numpy as np
import xarray as xr

from abi_operator import Fire, State
from abi_operator.bands import check_bands
from abi_operator.files import InputError
from abi_operator.instrument import Imager
from abi_operator.machine.speed import Kept
from abi_operator.nomenclature import SCENARIO
from abi_operator.radiance import FIRE_BANDS
from abi_operator.scene import states_of_result
from abi_operator.settings import streams_of_attributes

from .chunks import map_chunks
from .declarations import assumed_of_fire, fire
from .fire_detection import DETECTED, Surroundings, hottest_of
from .fire_pixels import codes_before, measured_light, surroundings_by_day_and_night
from .forward import ForwardModel, prepared
from .images import (
    check_noise,
    forward_model,
    how_made,
    images_of,
    in_one_row,
    retrieved_fields,
    solved_whole,
)
from .inverse import DEFAULT_MINIMISER, Minimiser
from .observation import (
    Observation,
    add_noise,
    distance_of,
    has_calibration_error,
    imager_of,
    measurement,
)
from .prior import Prior
from .product import make_product
from .results import ResultCode
from .state_vector import StateVector
from .usable_pixels import check_where

SCORE = "fire_detection_score"
"""Variable of the product: the score of `fire_detection` at every pixel."""

BACKGROUNDS = ("stored", "neighbours")
Background = Literal["stored", "neighbours"]
WhereOfFires = Literal["detected", "all"]
WHERE_OF_FIRES: tuple[WhereOfFires, ...] = get_args(WhereOfFires)
"""Where fires are retrieved, see `retrieve_fires`."""

_HEAT = ("temperature", "surface_temperature")


def retrieve_fires(
    dataset: xr.Dataset,
    *,
    bands: Sequence[str] = FIRE_BANDS,
    background: Background = "stored",
    where: WhereOfFires = "detected",
    threshold: float = DETECTED,
    noise: bool = False,
    seed: int = 0,
    prior: Prior | StateVector | None = None,
    assumed: StateVector | None = None,
    diagnostics: bool = False,
    num_streams: int | None = None,
    minimiser: Minimiser = DEFAULT_MINIMISER,
    attributes: dict[str, Any] | None = None,
) -> xr.Dataset:
    """Retrieve fires from the result of a simulation, pixel by pixel, in float64.

    Parameters
    ----------
    dataset
        A result with dimensions y and x, and time if there are several, with temperatures (one that
        was simulated with C07 has them).
    bands
        Bands to be used, of C05, C06 and C07. Where one is not finite it is left out.
    background
        One of `BACKGROUNDS`.
    where, threshold
        ``"detected"``: where the score of `fire_detection` reaches the threshold, and where the
        band that it looks at is missing the code is ``INVALID_INPUT``; ``"all"``: at every usable
        pixel, those without score, too.
    assumed
        What is not retrieved, for the diagnostics; None for `assumed_of_fire`.
    noise, seed, prior, diagnostics, num_streams, minimiser, attributes
        As of `retrieve_image`. Noise is drawn before fires are looked for.

    Returns
    -------
    xarray.Dataset
        As of `retrieve_image`, with ``fire_temperature``, ``fire_fraction``, ``fire_emitted_power``
        (of a black fire, see `declarations.emitted_power`) and the ``fire_detection_score`` of
        every pixel.

    Raises
    ------
    InputError
        Where the Dataset lacks a variable or a band, or has noise and more is to be added.
    ValueError
        Where a band is none in which a fire shines, background is none of `BACKGROUNDS`, or `where`
        none of `WHERE_OF_FIRES`.
    """
    bands, vector = check_bands(bands, FIRE_BANDS), fire()
    if background not in BACKGROUNDS:
        raise ValueError(f"background must be one of {', '.join(BACKGROUNDS)}; got {background!r}.")
    check_where(where, WHERE_OF_FIRES)
    _check(dataset, bands, vector.size, prior)
    check_noise(dataset, noise)
    num_streams = streams_of_attributes(dataset.attrs) if num_streams is None else num_streams
    with jax.enable_x64(True):
        forward = forward_model(dataset, vector, bands, num_streams)
        imager = imager_of(dataset)
        images = images_of(dataset)
        measured, limited = measured_light(images, bands, imager)
        if noise:
            measured = add_noise(measured, seed, imager, limited)
        measured, limited = (
            each.transpose("image", "band", "y", "x").values for each in (measured, limited)
        )
        around = [
            surroundings_by_day_and_night(image, values, bands, imager, threshold)
            for image, values in zip(images, measured, strict=True)
        ]
        hottest = hottest_of(bands)
        codes = np.stack(
            [
                codes_before(
                    image, values, found, threshold if where == "detected" else None, hottest
                )
                for image, values, found in zip(images, measured, around, strict=True)
            ]
        )
        attempted = codes == ResultCode.SUCCESS
        fields = {}
        if attempted.any():
            rows = zip(images, measured, limited, around, attempted, strict=True)
            parts = [_gathered(forward, imager, *row, background) for row in rows if row[-1].any()]
            observations, states = in_one_row(parts)
            exact = not noise and prior is None and background == "stored"
            fields, codes[attempted] = retrieved_fields(
                forward,
                observations,
                states,
                prior=prior,
                minimiser=minimiser,
                exact=exact and solved_whole(dataset, num_streams),
                diagnostics=diagnostics,
                excess=background == "neighbours",
                assumed=assumed_of_fire(bands) if assumed is None else assumed,
            )
    about = how_made(dataset, bands, num_streams, noise, seed, prior, vector.names) | {
        "background": background,
        "detection_threshold": threshold,
    }
    about |= attributes or {}
    product = make_product(dataset, codes, attempted, fields, (bands, vector.names), about)
    score = np.stack([found.score for found in around])
    words = "excess over the surroundings, in standard deviations of these and of the noise"
    product[SCORE] = (
        product["result_code"].dims,
        score if "time" in dataset.dims else score[0],
        {"units": "1", "long_name": words},
    )
    return product


def _check(dataset: xr.Dataset, bands: tuple[str, ...], num_unknowns: int, prior: object) -> None:
    """Raise `InputError` for what the Dataset lacks."""
    missing = [x for x in ("radiance", *SCENARIO, *_HEAT) if x not in dataset.variables]
    if missing:
        raise InputError(
            f"the result has no {', '.join(missing)}; simulate a scene with C07, and keep all of "
            "it (abi-operator simulate --bands all --emissivity ..., without --variables)."
        )
    lacking = sorted(set(bands) - set(dataset["band"].values.tolist()))
    if lacking:
        raise InputError(
            f"the result has no band {', '.join(lacking)}; simulate it, or choose other bands."
        )
    if prior is None and len(bands) < num_unknowns:
        raise InputError(
            f"{num_unknowns} unknowns need as many bands, or a prior; got {', '.join(bands)}."
        )


def _gathered(
    forward: ForwardModel,
    imager: Imager,
    image: xr.Dataset,
    measured: np.ndarray,
    limited: np.ndarray,
    around: Surroundings,
    chosen: np.ndarray,
    background: Background,
) -> tuple[Observation, State]:
    """Measurements and states of the pixels of one image that are attempted."""
    y, x = np.nonzero(chosen)
    columns = image.isel(y=xr.DataArray(y, dims="column"), x=xr.DataArray(x, dims="column"))
    states = with_fire(states_of_result(columns, forward.bands), 0.0)
    distance = np.full(len(y), distance_of(image))
    observed = measurement(
        measured[:, y, x].T,
        forward.bands,
        imager,
        calibration=has_calibration_error(image),
        sun_distance=distance,
        saturated=limited[:, y, x].T,
    )
    if background == "stored":
        return observed, states
    enough = prepared(forward, states)
    without = map_chunks(partial(_seen_chunk, enough), states, distance)
    shifted = observed.measured - around.mean[:, y, x].T + without
    sigma = np.hypot(observed.sigma, around.deviation[:, y, x].T)
    return Observation(shifted, sigma, observed.saturated, distance), states


@Kept
def _seen_chunk(forward: ForwardModel, states: State, distance: jax.Array) -> jax.Array:
    return forward.measured(states, distance)


def with_fire(states: State, fraction: float, temperature: float = 700.0) -> State:
    """States, columns leading, in all of which the same burns; what burnt there does no more.

    Parameters
    ----------
    states
        Columns, of which a fire is to be retrieved.
    fraction, temperature
        Of the fire [-], [K].
    """
    columns: Any = np.ones_like(np.asarray(states.geometry.solar_zenith))
    burning = Fire(fraction * columns, temperature * columns)
    return eqx.tree_at(lambda s: s.fire, states, burning, is_leaf=lambda leaf: leaf is None)
