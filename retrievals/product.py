"""Retrievals of single pixels as an image: a Dataset with CF attributes."""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np
import xarray as xr
from jaxtyping import Array

from abi_operator import __version__

from .pixels import Retrieved
from .quality import aod_550_sigma
from .results import flag_attributes
from .state_vector import StateVector


class _Variable(NamedTuple):
    by_band: bool
    long_name: str
    dtype: type = np.float64


_VARIABLES = {
    "aod_550": _Variable(False, "retrieved optical depth of the plume at 550 nm"),
    "aod_550_sigma": _Variable(False, "posterior standard deviation of aod_550"),
    "ssa": _Variable(True, "retrieved single-scattering albedo of the plume"),
    "ssa_sigma": _Variable(True, "posterior standard deviation of ssa"),
    "degrees_of_freedom": _Variable(False, "degrees of freedom for signal"),
    "cost": _Variable(False, "sum of squared whitened residuals at the solution"),
    "num_steps": _Variable(False, "evaluations of the forward model, 0 where none", np.int16),
}


def pixel_fields(
    vector: StateVector, retrieved: Retrieved, ssa: Mapping[str, Array]
) -> dict[str, np.ndarray]:
    """Physical quantities of the pixels retrieved, (pixel,) or (band, pixel).

    Parameters
    ----------
    vector
        Meaning of x.
    retrieved
        Solutions.
    ssa
        By band, the single-scattering albedo of each pixel at which x[1] = 0. [-]
    """
    inversion = retrieved.inversion
    fields = {
        "aod_550": vector.aod_550(inversion.x),
        "aod_550_sigma": aod_550_sigma(vector, inversion),
        "degrees_of_freedom": np.trace(inversion.averaging_kernel, axis1=-2, axis2=-1),
        "cost": inversion.cost,
        "num_steps": inversion.num_steps,
    }
    if vector.retrieve_ssa:
        sigma = np.sqrt(inversion.covariance[:, 1, 1])
        fields["ssa"] = [vector.ssa(inversion.x, reference) for reference in ssa.values()]
        slopes = [vector.ssa_slope(inversion.x, reference) for reference in ssa.values()]
        fields["ssa_sigma"] = np.stack(slopes) * sigma
    return {name: np.asarray(values) for name, values in fields.items()}


def make_product(
    dataset: xr.Dataset,
    codes: np.ndarray,
    attempted: np.ndarray,
    fields: Mapping[str, np.ndarray],
    bands: tuple[str, ...],
    attributes: Mapping[str, str | int | float],
) -> xr.Dataset:
    """Put pixels back into the image.

    Parameters
    ----------
    dataset
        The result that was inverted, of which coordinates are kept.
    codes, attempted
        Result code of every pixel, and which of them `fields` holds; (time, y, x).
    fields
        As `pixel_fields` returns.
    bands
        Bands of the fields that have a band.
    attributes
        Global attributes: how the retrieval was made.
    """
    images = {}
    for name, values in fields.items():
        variable = _VARIABLES[name]
        empty = np.nan if variable.dtype is np.float64 else 0
        image = np.full(values.shape[:-1] + codes.shape, empty, variable.dtype)
        image[..., attempted] = values
        dims = ("band", "time", "y", "x") if variable.by_band else ("time", "y", "x")
        cf = {"units": "1", "long_name": variable.long_name, "ancillary_variables": "result_code"}
        images[name] = xr.DataArray(image, dims=dims, attrs=cf)
    about = {"long_name": "what became of the retrieval", **flag_attributes()}
    images["result_code"] = xr.DataArray(codes, dims=("time", "y", "x"), attrs=about)
    product = xr.Dataset(images)
    if "time" in dataset.dims:
        product = product.transpose("time", "band", "y", "x", missing_dims="ignore")
    else:
        product = product.isel(time=0)
    kept = {name: dataset[name] for name in ("time", "latitude", "longitude") if name in dataset}
    by_band = {"band": list(bands)} if "band" in product.dims else {}
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    about_file = {
        "Conventions": "CF-1.11",
        "title": "Smoke retrieved from synthetic imagery",
        "source": f"retrievals of abi_operator {__version__}",
        "history": f"{now} retrieved by abi_operator {__version__}",
    }
    return product.assign_coords(kept | by_band).assign_attrs(about_file | dict(attributes))
