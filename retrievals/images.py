"""Retrievals from the result of a simulation: a Dataset in, a Dataset out."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import jax
import numpy as np
import xarray as xr

from abi_operator import State
from abi_operator.bands import check_bands
from abi_operator.files import InputError
from abi_operator.instrument import IMAGER
from abi_operator.nomenclature import PLUME, SCENARIO
from abi_operator.scene import gases_of, states_of_result
from abi_operator.settings import streams_of_attributes

from .forward import ForwardModel, prepared
from .intervals import posterior_intervals
from .inverse import DEFAULT_MINIMISER, Minimiser
from .observation import (
    Observation,
    add_noise,
    has_noise,
    imager_of,
    known_saturated,
    observe,
)
from .optimal_estimation import estimates
from .pixels import retrieve_pixels
from .prior import Prior
from .prior_in_words import prior_in_words
from .product import Field, diagnostic_fields, interval_fields, make_product, pixel_fields
from .results import ResultCode
from .smooth import Smoothness, retrieve_smooth, smoothness
from .state_vector import StateVector
from .usable_pixels import WHERE, Where, check_where, usable

REFLECTIVE = ("C01", "C02", "C03", "C04", "C05", "C06")
"""Bands of which a result can be retrieved from."""
# What a result says of its observation, for the product to say as well.
_OBSERVED = "satellite", "calibration_error", "quantised", "fire_saturation_temperature"


def retrieve_image(
    dataset: xr.Dataset,
    vector: StateVector,
    *,
    bands: Sequence[str],
    species: str | None = None,
    where: Where = "plume",
    noise: bool = False,
    seed: int = 0,
    prior: Prior | StateVector | None = None,
    assumed: StateVector | None = None,
    diagnostics: bool = False,
    num_streams: int | None = None,
    minimiser: Minimiser = DEFAULT_MINIMISER,
    smooth: float | None = None,
    attributes: dict[str, Any] | None = None,
) -> xr.Dataset:
    """Retrieve a state vector from the result of a simulation, pixel by pixel, in float64.

    Whatever is not retrieved (ground, cloud, air and its gases, height and spectrum of a plume) is
    known from the scenario in the result, but fires, whose bands do not count where one shines
    (`retrieve_fires`). Brightness of the plume serves as its mask; what is retrieved is not looked
    at.

    Parameters
    ----------
    dataset
        A result with dimensions y and x, and time if there are several; of `scene.simulate` or
        `files.read_result`.
    vector
        What to retrieve.
    bands
        Bands to be used, of C01 to C06. Where one is not finite it is left out.
    species
        Name of the plume that is retrieved, None if none is.
    where
        ``"plume"``: where the plume's brightness is above 0, or if none is retrieved at every
        usable pixel; ``"cloud"``: where there is cloud water; ``"all"``: at every usable pixel,
        where those without plume end as ``not_converged`` unless there is a prior. A `liquid_cloud`
        needs ``"cloud"``: where there is no water, there is no place for it.
    noise, seed
        Whether to add noise (`observation.add_noise`) to the reflectances, and its seed. Without
        noise a fit has to be exact; posterior errors are those that noise would cause.
    prior
        What is known of x beforehand, of all pixels; a state vector stands for what its quantities
        declare (``prior=vector``).
    assumed
        What is not retrieved, for the diagnostics: errors due to it, as it is declared.
    diagnostics
        Whether to add matrices and errors of `optimal_estimation` to the product.
    num_streams
        Streams of the solver; None for those of the simulation. With others no fit is exact, and
        each is judged by the noise.
    minimiser
        How, and when to end.
    smooth
        Correlation length of what is retrieved, by which each image is retrieved as a whole
        (`retrievals.smooth`) [pixel]; needs a prior. None for every pixel on its own.
    attributes
        Global attributes of the product beside those of its making.

    Returns
    -------
    xarray.Dataset
        ``result_code``, which has to be 0 where the rest is used; each quantity of the state
        vector, its posterior standard deviation ``_sigma`` and its value at a second solution
        ``_second``; what is derived of them; ``cost`` and its parts ``measurement_cost`` and
        ``prior_cost``, ``degrees_of_freedom``, ``num_values`` and ``num_steps``. As diagnostics
        ``averaging_kernel``, ``posterior_covariance`` and ``gain`` of x, ``residual``,
        ``information_content``, ``nonlinearity``, and of each quantity its ``_noise_error``,
        ``_smoothing_error`` and ``_error_due_to_`` what is assumed, and the bounds of its intervals
        (`retrievals.intervals`), ``_lower_68``, ``_upper_68``, ``_lower_95`` and ``_upper_95``.

    Raises
    ------
    InputError
        Where the Dataset lacks a variable or a band, or has noise and more is to be added.
    ValueError
        Where `where` is none of these; where smooth is not above 0, comes without prior or with
        diagnostics, which are of single pixels.
    """
    bands = check_bands(bands, REFLECTIVE)
    check_where(where, WHERE)
    if smooth is not None and (prior is None or diagnostics):
        raise ValueError(
            "smooth needs a prior, and has no diagnostics, which are of single pixels."
        )
    _check(dataset, bands, species, vector.size, prior)
    check_noise(dataset, noise)
    if num_streams is None:
        num_streams = streams_of_attributes(dataset.attrs)
    with jax.enable_x64(True):
        if noise:
            factor, limited = dataset["reflectance_factor"], known_saturated(dataset)
            noisy = add_noise(factor, seed, imager_of(dataset), limited)
            dataset = dataset.assign(reflectance_factor=noisy)
        images = images_of(dataset)
        codes = np.stack([usable(image, bands, species, where) for image in images])
        attempted = codes == ResultCode.SUCCESS
        fields = {}
        if attempted.any():
            observations, states = _gather(images, attempted, bands)
            fields, codes[attempted] = retrieved_fields(
                forward_model(dataset, vector, bands, num_streams),
                observations,
                states,
                prior=prior,
                minimiser=minimiser,
                exact=not noise and prior is None and solved_whole(dataset, num_streams),
                diagnostics=diagnostics,
                assumed=assumed,
                smooth=None if smooth is None else smoothness(attempted, smooth),
            )
    about = how_made(dataset, bands, num_streams, noise, seed, prior, vector.names)
    about |= {} if species is None else {"species": species}
    about |= {} if smooth is None else {"smooth_length_in_pixels": smooth}
    about |= attributes or {}
    return make_product(dataset, codes, attempted, fields, (bands, vector.names), about)


def retrieved_fields(
    forward: ForwardModel,
    observations: Observation,
    states: State,
    *,
    prior: Prior | StateVector | None,
    minimiser: Minimiser,
    exact: bool,
    diagnostics: bool,
    assumed: StateVector | None,
    smooth: Smoothness | None = None,
    excess: bool = False,
) -> tuple[dict[str, Field], np.ndarray]:
    """Variables of a product, of the pixels in one row, and their result codes.

    Parameters
    ----------
    forward
        The forward model, not yet `prepared`.
    observations, states
        What was measured and what is known of the pixels.
    exact
        As of `retrieve_pixels`.
    prior, minimiser, diagnostics, assumed
        As of `retrieve_image`.
    smooth
        How neighbours are alike; None for every pixel on its own.
    excess
        As of `estimates`.
    """
    vector, forward = forward.vector, prepared(forward, states)
    of_x = prior.prior(states) if isinstance(prior, StateVector) else prior
    if smooth is not None and of_x is not None:
        retrieved = retrieve_smooth(
            forward, observations, states, prior=of_x, smooth=smooth, minimiser=minimiser
        )
    else:
        retrieved = retrieve_pixels(
            forward, observations, states, prior=of_x, minimiser=minimiser, exact=exact
        )
    fields = pixel_fields(vector, forward.bands, retrieved, states, observations.num_values)
    if diagnostics:
        x = np.asarray(retrieved.inversion.x)
        found = estimates(forward, observations, states, x, of_x, assumed, excess=excess)
        fields |= diagnostic_fields(vector, x, found, assumed)
        within = posterior_intervals(forward, observations, states, x, found, of_x)
        fields |= interval_fields(vector, within)
    return fields, retrieved.codes


def forward_model(
    dataset: xr.Dataset, vector: StateVector, bands: tuple[str, ...], num_streams: int | None
) -> ForwardModel:
    """The operator as a result was simulated by it; streams are those of the result for None."""
    budget = dataset.attrs.get("error_budget")
    return ForwardModel(
        vector,
        bands,
        streams_of_attributes(dataset.attrs) if num_streams is None else num_streams,
        gases=gases_of(dataset),
        satellite=str(dataset.attrs.get("satellite", IMAGER.satellite)),
        error_budget=None if budget is None else float(budget),
    )


def solved_whole(dataset: xr.Dataset, num_streams: int | None = None) -> bool:
    """Whether a result has no error, of its making or its observation, so that a fit could be
    exact; not where columns have streams of their own, of which a retrieval has the most for all.

    Parameters
    ----------
    dataset
        The result.
    num_streams
        Streams of the model that is fitted: unless they are the result's no fit is exact. None for
        those of the result.
    """
    if num_streams not in (None, streams_of_attributes(dataset.attrs)):
        return False
    made_with_errors = {"error_budget", "streams_error"} & set(dataset.attrs)
    return not made_with_errors and not has_noise(dataset) and not imager_of(dataset).quantised


def check_noise(dataset: xr.Dataset, noise: bool) -> None:
    """Refuse to add noise to a result that has some: S_obs is that of noise drawn once."""
    if noise and has_noise(dataset):
        raise InputError(
            f"the result has noise ({dataset.attrs['noise']}); retrieve it without adding more."
        )


def how_made(
    dataset: xr.Dataset,
    bands: tuple[str, ...],
    num_streams: int,
    noise: bool,
    seed: int,
    prior: Prior | StateVector | None,
    names: tuple[str, ...],
) -> dict[str, Any]:
    """Attributes of a product that tell how it was made, and of which measurements.

    `names` are those of the elements of x.
    """
    own = str(dataset.attrs.get("noise", "none"))
    observed = {name: dataset.attrs[name] for name in _OBSERVED if name in dataset.attrs}
    return observed | {
        "bands": " ".join(bands),
        "num_streams": num_streams,
        "noise": f"added with seed {seed}" if noise else own,
        "prior": prior_in_words(prior, names),
    }


def _check(
    dataset: xr.Dataset,
    bands: tuple[str, ...],
    species: str | None,
    num_unknowns: int,
    prior: object,
) -> None:
    """Raise `InputError` for what the Dataset lacks."""
    of_plume = [] if species is None else [f"{species}_{name}" for name in PLUME]
    required = ("reflectance_factor", *SCENARIO, *of_plume)
    missing = [name for name in required if name not in dataset.variables]
    if missing:
        plume = "" if species is None else f" with a plume of {species}"
        option = "" if species is None else "with --plume, and "
        raise InputError(
            f"the result has no {', '.join(missing)}; simulate a scene{plume}, and "
            f"keep all of it (abi-operator simulate {option}without --variables)."
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


def images_of(dataset: xr.Dataset) -> list[xr.Dataset]:
    """The times of a Dataset."""
    if "time" not in dataset.dims:
        return [dataset]
    return [dataset.isel(time=time) for time in range(dataset.sizes["time"])]


def _gather(
    images: list[xr.Dataset], attempted: np.ndarray, bands: tuple[str, ...]
) -> tuple[Observation, State]:
    """Measurements and states of the pixels to be attempted, pixels of all times in one row."""
    parts = []
    for image, chosen in zip(images, attempted, strict=True):
        if chosen.any():
            y, x = (xr.DataArray(index, dims="column") for index in np.nonzero(chosen))
            columns = image.isel(y=y, x=x)
            # Where something burns the bands that it shines in are missing; elsewhere a scene's
            # reflectances are those of sunlight alone.
            states = replace(states_of_result(columns, bands), fire=None)
            parts.append((observe(columns, bands), states))
    return in_one_row(parts)


def in_one_row(parts: list[tuple[Observation, State]]) -> tuple[Observation, State]:
    """Measurements and states of the pixels of several images.

    Where the sun is low in one of them its path is that of a sphere in all, which is that of flat
    layers where it is not (`Geometry`): one kind of state, and not two.
    """
    low = any(states.geometry.spherical for _, states in parts)
    alike = [
        (seen, replace(states, geometry=replace(states.geometry, spherical=low)))
        for seen, states in parts
    ]
    return jax.tree.map(lambda *arrays: np.concatenate(arrays), *alike)
