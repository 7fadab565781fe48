"""Retrievals of single pixels as an image: a Dataset with CF attributes."""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import NamedTuple

import jax
import numpy as np
import xarray as xr

from abi_operator import State, __version__
from abi_operator.machine.speed import Kept

from .chunks import map_chunks
from .pixels import Retrieved
from .quality import sigmas
from .results import ResultCode, flag_attributes
from .state_vector import StateVector


class Field(NamedTuple):
    """A variable of the pixels retrieved: (pixel,), or (band, pixel)."""

    values: np.ndarray
    units: str
    long_name: str


def pixel_fields(
    vector: StateVector, retrieved: Retrieved, states: State, num_values: np.ndarray
) -> dict[str, Field]:
    """Physical quantities of the pixels retrieved.

    Parameters
    ----------
    vector
        Meaning of x.
    retrieved
        Solutions.
    states
        What was known of the pixels.
    num_values
        Number of measurements of each pixel.
    """
    inversion, fields = retrieved.inversion, {}
    errors = sigmas(vector, inversion)
    values, others = vector.values(inversion.x), vector.values(retrieved.other.x)
    several = retrieved.codes == ResultCode.MULTIPLE_SOLUTIONS
    for i, quantity in enumerate(vector.quantities):
        name, words = quantity.name, quantity.long_name
        fields[name] = Field(np.asarray(values[name]), quantity.units, f"retrieved {words}")
        fields[f"{name}_sigma"] = Field(errors[:, i], quantity.units, _posterior(name))
        second = np.where(several, others[name], np.nan)
        fields[f"{name}_second"] = Field(
            second, quantity.units, f"{name} of the second solution where there are multiple ones"
        )
    if vector.derived:
        reported = map_chunks(
            lambda *chunk: _report_chunk(vector, *chunk), inversion.x, states, inversion.covariance
        )
        for item in vector.derived:
            for name, words in (
                (item.name, f"retrieved {item.long_name}"),
                (f"{item.name}_sigma", _posterior(item.name)),
            ):
                found = reported[name]
                by_band = np.stack(list(found.values())) if isinstance(found, dict) else found
                fields[name] = Field(by_band, item.units, words)
    freedom = np.trace(inversion.averaging_kernel, axis1=-2, axis2=-1)
    cost = "sum of squared whitened residuals at the solution"
    fields["degrees_of_freedom"] = Field(freedom, "1", "degrees of freedom for signal")
    fields["cost"] = Field(np.asarray(inversion.cost), "1", cost)
    for name, words in (("measurement_cost", "measurements"), ("prior_cost", "the prior")):
        fields[name] = Field(np.asarray(getattr(inversion, name)), "1", f"{cost}, of {words}")
    counted = "measurements that count, neither missing nor saturated"
    fields["num_values"] = Field(num_values.astype(np.int16), "1", counted)
    steps = np.asarray(inversion.num_steps).astype(np.int16)
    fields["num_steps"] = Field(steps, "1", "evaluations of the forward model, 0 where none")
    return fields


def _posterior(name: str) -> str:
    return f"posterior standard deviation of {name}"


@Kept
def _report_chunk(
    vector: StateVector, x: jax.Array, states: State, covariance: jax.Array
) -> dict[str, jax.Array | dict[str, jax.Array]]:
    return jax.vmap(vector.report)(x, states, covariance)


def make_product(
    dataset: xr.Dataset,
    codes: np.ndarray,
    attempted: np.ndarray,
    fields: Mapping[str, Field],
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
    for name, field in fields.items():
        floating = np.issubdtype(field.values.dtype, np.floating)
        image = np.full(
            field.values.shape[:-1] + codes.shape, np.nan if floating else 0, field.values.dtype
        )
        image[..., attempted] = field.values
        dims = ("band", "time", "y", "x") if field.values.ndim > 1 else ("time", "y", "x")
        cf = {
            "units": field.units,
            "long_name": field.long_name,
            "ancillary_variables": "result_code",
        }
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
        "source": f"retrievals of abi_operator {__version__}",
        "history": f"{now} retrieved by abi_operator {__version__}",
    }
    return product.assign_coords(kept | by_band).assign_attrs(about_file | dict(attributes))
