"""Retrievals of single pixels as an image: a Dataset with CF attributes."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from abi_operator import State, __version__
from abi_operator.machine.speed import Kept

from .chunks import map_chunks
from .intervals import LEVELS, Intervals
from .optimal_estimation import Estimate
from .pixels import Retrieved
from .quality import sigmas
from .results import ResultCode, flag_attributes
from .state_vector import StateVector


class Field(NamedTuple):
    """A variable of the pixels retrieved, (*dims, pixel)."""

    values: np.ndarray
    units: str
    long_name: str
    dims: tuple[str, ...] = ()


def pixel_fields(
    vector: StateVector,
    bands: Sequence[str],
    retrieved: Retrieved,
    states: State,
    num_values: np.ndarray,
) -> dict[str, Field]:
    """Physical quantities of the pixels retrieved.

    Parameters
    ----------
    vector
        Meaning of x.
    bands
        Names of the bands, in the order in which a product has them.
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
                if isinstance(found, dict):
                    # JAX hands a dictionary back with its keys sorted, not in the product's order.
                    by_band = np.stack([found[band] for band in bands])
                    fields[name] = Field(by_band, item.units, words, ("band",))
                else:
                    fields[name] = Field(np.asarray(found), item.units, words)
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


def diagnostic_fields(
    vector: StateVector,
    x: np.ndarray,
    found: Estimate,
    assumed: StateVector | None,
) -> dict[str, Field]:
    """Diagnostics of the pixels retrieved: matrices of x, and errors in the units of quantities.

    Parameters
    ----------
    vector, x
        Meaning of x, and the solutions.
    found
        Their diagnostics.
    assumed
        What was assumed, of which there are errors.
    """
    square = ("element", "element_2")
    matrices = {
        "posterior_covariance": ("posterior covariance of x", square),
        "averaging_kernel": ("averaging kernel of x", square),
        "gain": ("gain of x, per measurement, in C07 per W m-2 sr-1 um-1", ("element", "band")),
        "residual": ("whitened departure of the forward model from the measurement", ("band",)),
    }
    fields = {
        name: Field(np.moveaxis(np.asarray(getattr(found, name)), 0, -1), "1", words, dims)
        for name, (words, dims) in matrices.items()
    }
    bits = "information content of the measurement, in bit"
    fields["information_content"] = Field(np.asarray(found.information_content), "1", bits)
    departure = "largest departure from a linear forward model within the posterior error"
    fields["nonlinearity"] = Field(np.asarray(found.nonlinearity), "1", departure)
    slopes = np.asarray(vector.slopes(jnp.asarray(x)))
    for i, quantity in enumerate(vector.quantities):
        name, units = quantity.name, quantity.units
        for part in ("noise", "smoothing"):
            variance = getattr(found, f"{part}_covariance")[:, i, i]
            error = slopes[:, i] * np.sqrt(variance)
            words = f"standard deviation of {name} due to {part}"
            fields[f"{name}_{part}_error"] = Field(error, units, words)
        for j, other in enumerate(() if assumed is None else assumed.quantities):
            error = slopes[:, i] * found.parameter_error[:, j, i]
            words = f"standard deviation of {name} due to the {other.long_name}"
            fields[f"{name}_error_due_to_{other.name}"] = Field(error, units, words)
    return fields


def interval_fields(vector: StateVector, found: Intervals) -> dict[str, Field]:
    """Bounds of the truth in the units of quantities.

    Parameters
    ----------
    vector
        Meaning of x.
    found
        Bounds of x.
    """
    by_level = [vector.values(jnp.asarray(found.bounds[:, level])) for level in range(len(LEVELS))]
    fields = {}
    for quantity in vector.quantities:
        values = np.stack([np.asarray(values[quantity.name]) for values in by_level])
        # NaN stays: of a pixel either all bounds are numbers or none is.
        for bound, ordered in zip(LEVELS, np.sort(values, axis=0), strict=True):
            side, share = bound.split("_")
            words = f"{side} bound of {quantity.name}, which lies between both with {share} %"
            fields[f"{quantity.name}_{bound}"] = Field(ordered, quantity.units, words)
    words = "points that count in the intervals, which are not given below 20"
    fields["interval_points"] = Field(np.asarray(found.effective_points), "1", words)
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
    names: tuple[tuple[str, ...], tuple[str, ...]],
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
    names
        Of bands, and of the elements of x, for the fields that have them.
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
        cf = {
            "units": field.units,
            "long_name": field.long_name,
            "ancillary_variables": "result_code",
        }
        images[name] = xr.DataArray(image, dims=(*field.dims, "time", "y", "x"), attrs=cf)
    about = {"long_name": "what became of the retrieval", **flag_attributes()}
    images["result_code"] = xr.DataArray(codes, dims=("time", "y", "x"), attrs=about)
    product = xr.Dataset(images)
    if "time" in dataset.dims:
        order = ("time", "element", "element_2", "band", "y", "x")
        product = product.transpose(*order, missing_dims="ignore")
    else:
        product = product.isel(time=0)
    kept = {name: dataset[name] for name in ("time", "latitude", "longitude") if name in dataset}
    bands, elements = names
    labels = {"band": bands, "element": elements, "element_2": elements}
    by_name = {dim: list(values) for dim, values in labels.items() if dim in product.dims}
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    about_file = {
        "Conventions": "CF-1.11",
        "source": f"retrievals of abi_operator {__version__}",
        "history": f"{now} retrieved by abi_operator {__version__}",
    }
    return product.assign_coords(kept | by_name).assign_attrs(about_file | dict(attributes))
