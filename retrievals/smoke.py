"""Optical depth of smoke from reflectances, and if wished its single-scattering albedo."""

from collections.abc import Sequence
from typing import Literal

import jax
import numpy as np
import xarray as xr

from abi_operator import State
from abi_operator.bands import GRASSO2013, check_bands
from abi_operator.files import InputError
from abi_operator.nomenclature import PLUME, SCENARIO
from abi_operator.scene import column_states, gases_of

from .forward import ForwardModel, plume_by_band, prepared
from .inverse import DEFAULT_MINIMISER, Minimiser
from .observation import Observation, add_noise, observe, usable
from .pixels import retrieve_pixels
from .product import make_product, pixel_fields
from .results import ResultCode
from .state_vector import Prior, StateVector

BANDS = ("C01", "C02", "C03")
"""Bands that are used by default: in C06, smoke is hardly seen."""

_SPECIES = "smoke"
_REQUIRED = ("reflectance_factor", *SCENARIO, *(f"{_SPECIES}_{name}" for name in PLUME))


def retrieve_smoke(
    dataset: xr.Dataset,
    *,
    bands: Sequence[str] = BANDS,
    retrieve_ssa: bool = False,
    where: Literal["plume", "all"] = "plume",
    noise: bool = False,
    seed: int = 0,
    prior: Prior | None = None,
    aod_limit: float = 10.0,
    num_streams: int | None = None,
    minimiser: Minimiser = DEFAULT_MINIMISER,
) -> xr.Dataset:
    """Retrieve smoke from the result of a simulation, each pixel on its own, in float64.

    Ground, cloud, air and its gases, height and spectrum of the smoke are known from the scenario
    in the result; its brightness serves as plume mask, and its optical depth is not looked at.

    Parameters
    ----------
    dataset
        A result with dimensions y and x, and time if there are several; of `scene.simulate` or
        `files.read_result`.
    bands
        Bands to be used.
    retrieve_ssa
        Whether single-scattering albedo is unknown too, by one shift of its logit in all bands.
    where
        ``"plume"``: where the plume's brightness is above 0; ``"all"``: at every usable pixel,
        where those without smoke end as ``not_converged`` unless there is a prior.
    noise, seed
        Whether to add noise (`observation.noise_sigma`) to the reflectances, and its seed. Without
        noise a fit has to be exact; posterior errors are those that noise would cause.
    prior
        What is known of x (`StateVector`) beforehand.
    aod_limit
        Optical depths from here on are out of reach. [-]
    num_streams
        Streams of the solver; None for those of the simulation.
    minimiser
        When to end.

    Returns
    -------
    xarray.Dataset
        ``result_code``, which has to be 0 where the rest is used; ``aod_550`` and its posterior
        standard deviation ``aod_550_sigma``, ``cost``, ``degrees_of_freedom`` and ``num_steps``;
        ``ssa`` by band and ``ssa_sigma`` if retrieved.

    Raises
    ------
    InputError
        Where the Dataset lacks a variable or a band.
    """
    bands = check_bands(bands, GRASSO2013)
    vector = StateVector(retrieve_ssa, aod_limit)
    _check(dataset, bands, vector)
    if num_streams is None:
        num_streams = int(dataset.attrs.get("num_streams", 8))
    if noise:
        noisy = add_noise(dataset["reflectance_factor"], seed)
        dataset = dataset.assign(reflectance_factor=noisy)
    images = _images(dataset)
    codes = np.stack([usable(image, bands, _SPECIES, where) for image in images])
    attempted = codes == ResultCode.SUCCESS
    fields = {}
    if attempted.any():
        with jax.enable_x64(True):
            observations, states = _gather(images, attempted, bands)
            forward = ForwardModel(
                vector, bands, num_streams, species=_SPECIES, gases=gases_of(dataset)
            )
            retrieved = retrieve_pixels(
                prepared(forward, states),
                observations,
                states,
                prior=prior,
                minimiser=minimiser,
                exact=not noise and prior is None,
            )
            fields = pixel_fields(vector, retrieved, plume_by_band(states, _SPECIES).ssa)
        codes[attempted] = retrieved.codes
    attributes = {
        "bands": " ".join(bands),
        "num_streams": num_streams,
        "aod_limit": aod_limit,
        "noise": f"added with seed {seed}" if noise else "none",
        "prior": "none" if prior is None else "normal distribution",
    }
    return make_product(dataset, codes, attempted, fields, bands, attributes)


def _check(dataset: xr.Dataset, bands: tuple[str, ...], vector: StateVector) -> None:
    """Raise `InputError` for what the Dataset lacks."""
    missing = [name for name in _REQUIRED if name not in dataset.variables]
    if missing:
        raise InputError(
            f"the result has no {', '.join(missing)}; simulate a scene with a plume of smoke, and "
            "keep all of it (abi-operator simulate with --plume, and without --variables)."
        )
    lacking = sorted(set(bands) - set(dataset["band"].values.tolist()))
    if lacking:
        raise InputError(
            f"the result has no band {', '.join(lacking)}; simulate it, or choose other bands."
        )
    if len(bands) < vector.size:
        raise InputError(f"{vector.size} unknowns need as many bands; got {', '.join(bands)}.")


def _images(dataset: xr.Dataset) -> list[xr.Dataset]:
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
            parts.append((observe(columns, bands), column_states(columns, bands)))
    return jax.tree.map(lambda *arrays: np.concatenate(arrays), *parts)
