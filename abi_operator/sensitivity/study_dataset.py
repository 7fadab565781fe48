"""The maps of a sensitivity study: names, dimensions and words of all that was found."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from ..files.result import CONVENTIONS
from .derivatives import Sensitivity
from .inputs import Input
from .place import with_place
from .variance import SampledVariance, variance_parts


class SampledPixels(NamedTuple):
    """Variances by sampling, and of which of the pixels in a row they are."""

    pixels: np.ndarray
    variance: SampledVariance


def study_dataset(
    image: xr.Dataset,
    chosen: np.ndarray,
    names: tuple[Sequence[str], Sequence[Input]],
    found: Sensitivity,
    covariance: np.ndarray,
    sampled: SampledPixels | None,
    how: Mapping[str, Any],
) -> xr.Dataset:
    """Maps of what was found of some pixels of an image.

    Parameters
    ----------
    image, chosen
        A result, and which of its pixels were looked at (y, x).
    names
        What was looked at, and the inputs.
    found, covariance, sampled
        Of these pixels in a row; the covariance of the inputs; None where nothing was drawn.
    how
        Attributes that say how it was found.
    """
    of, inputs = names
    rows, entries = ("of", "y", "x"), ("of", "to", "y", "x")
    parts = variance_parts(found.jacobian, covariance)
    fields = {
        "value": (rows, found.value, "what is looked at"),
        "input": (("to", "y", "x"), found.inputs, "what is changed, as it is"),
        "jacobian": (entries, found.jacobian, "derivative"),
        "elasticity": (entries, found.elasticity, "relative change for a relative change"),
        "change_up": (entries, found.up, "change for one step up"),
        "change_down": (entries, found.down, "change for one step down"),
        "second_derivative": (entries, _diagonal(found.second), "second derivative"),
        "variance": (rows, parts.sum(axis=-1), "variance to first order"),
        "variance_part": (entries, parts, "part of the variance due to an input, to first order"),
    }
    if sampled is not None:
        chosen_again = sampled.pixels, len(found.value)
        by = sampled.variance
        more = {
            "sampled_variance": (rows, by.total, "variance by sampling"),
            "sampled_variance_error": (rows, by.total_error, "its standard error"),
            "sampled_linear": (rows, by.linear, "variance to first order of the same draws"),
            "sampled_part": (entries, by.parts, "part of the variance by sampling"),
            "sampled_part_error": (entries, by.parts_error, "its standard error"),
            "sample_count": (("y", "x"), by.draws, "draws that count"),
        }
        fields |= {
            name: (dims, _spread(values, *chosen_again), words)
            for name, (dims, values, words) in more.items()
        }
    variables = {
        name: (dims, _on_map(values, chosen), {"long_name": words})
        for name, (dims, values, words) in fields.items()
    }
    variables["step"] = (
        ("to",),
        np.array([one.step for one in inputs]),
        {"long_name": "finite step and standard deviation, in the unit of the input"},
    )
    variables["covariance"] = (("to", "with"), covariance, {"long_name": "of the inputs"})
    short = [one.name for one in inputs]
    coordinates = {
        "of": ("of", list(of), {"long_name": "what is looked at"}),
        "to": ("to", short, {"long_name": "what is changed"}),
        "with": ("with", short, {"long_name": "what is changed"}),
        "to_units": ("to", [one.units for one in inputs], {"long_name": "unit of the input"}),
        "to_name": ("to", [one.long_name for one in inputs], {"long_name": "the input in words"}),
    }
    result = xr.Dataset(variables, coordinates)
    result = with_place(result, image)
    return result.assign_attrs(
        {"Conventions": CONVENTIONS, "title": "Sensitivities of a scene's synthetic imagery", **how}
    )


def _on_map(values: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Of columns first to a map behind the other axes, NaN elsewhere."""
    field = np.full((*values.shape[1:], *chosen.shape), np.nan)
    field[..., chosen] = np.moveaxis(values, 0, -1)
    return field


def _spread(values: np.ndarray, pixels: np.ndarray, count: int) -> np.ndarray:
    """Of some columns to all of them, NaN for others."""
    full = np.full((count, *values.shape[1:]), np.nan)
    full[pixels] = values
    return full


def _diagonal(second: np.ndarray) -> np.ndarray:
    return np.diagonal(second, axis1=-2, axis2=-1)
