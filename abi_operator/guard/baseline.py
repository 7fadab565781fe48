"""Baselines as NetCDF files: values, Jacobians, the state, and with what they were made."""

import json
from datetime import UTC, datetime
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np
import xarray as xr

from .._version import __version__
from ..bands import BANDS
from ..files import InputError, output_folder
from ..files.netcdf import load_all, open_netcdf, require_values
from .comparison import (
    INPUT_TOLERANCE,
    JACOBIAN_TOLERANCE,
    OUTPUT_TOLERANCE,
    SMALLEST_ELASTICITY,
    SMALLEST_INPUT,
    VALUE_TOLERANCE,
)
from .evaluation import UNITS, Jacobians, Request
from .outputs import PIECEWISE_CONSTANT, Outputs

_NUMBERS = ("value", "jacobian", "state", "output_value", "output_slope")
_AXES = {
    "column": ("column",),
    "band": ("band",),
    "input": ("input",),
    "input_units": ("input",),
    "quantity": ("column", "band"),
    "value": ("column", "band"),
    "jacobian": ("column", "band", "input"),
    "state": ("column", "input"),
    "output": ("output",),
    "output_row": ("output_row",),
    "output_units": ("output",),
    "output_value": ("output_row", "output"),
    "output_slope": ("output_row", "output", "band"),
}

_TITLE = "Baseline of Jacobians of abi_operator"
_ADVICE = "give a file that 'abi-operator jacobian save' wrote"


class Baseline(NamedTuple):
    """What a file holds.

    Parameters
    ----------
    jacobians
        The evaluation.
    scenario
        What it is of: a name, or the function that returned the states.
    versions
        Of abi_operator, JAX and NumPy, by name.
    history
        One line for each time it was written, oldest first: when, by what, why.
    """

    jacobians: Jacobians
    scenario: str
    versions: dict[str, str]
    history: tuple[str, ...]


def versions() -> dict[str, str]:
    """Versions of what computes here."""
    return {"abi_operator": __version__, "jax": jax.__version__, "numpy": np.__version__}


def history_line(what: str) -> str:
    """A line of history: now, by these versions."""
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    by = ", ".join(f"{name} {version}" for name, version in versions().items())
    return f"{now} {what} ({by})"


def write_baseline(path: str | PathLike[str], baseline: Baseline) -> None:
    """Write a baseline; the file is there whole or as it was.

    Versions are those of what computes here, whatever `baseline` says.

    Parameters
    ----------
    path
        File to write or to replace.
    baseline
        What to write.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    of = baseline.jacobians
    numbers = {"zlib": True, "complevel": 9, "shuffle": True, "_FillValue": np.nan}
    dataset = xr.Dataset(
        {
            "quantity": (("column", "band"), of.quantity, _QUANTITY),
            "value": (("column", "band"), of.value, _VALUE),
            "jacobian": (("column", "band", "input"), of.jacobian, _JACOBIAN),
            "state": (("column", "input"), of.state, _STATE),
            "input_units": ("input", np.array(of.units, dtype=object), _INPUT_UNITS),
        },
        {
            "column": np.array(of.columns, dtype=object),
            "band": np.array(of.bands, dtype=object),
            "input": np.array(of.inputs, dtype=object),
        },
        {
            "title": _TITLE,
            "Conventions": "CF-1.11",
            "scenario": baseline.scenario,
            "dtype": "float64",
            "settings": json.dumps(of.settings),
            "requested_settings": json.dumps(
                {name: of.settings[name] for name in of.request.settings}
            ),
            "requested_bands": json.dumps(of.request.bands),
            "tolerances": json.dumps(_TOLERANCES),
            "history": "\n".join(baseline.history),
        }
        | {f"{name}_version": version for name, version in versions().items()},
    )
    if of.outputs is not None:
        dataset = dataset.assign(_variables(of.outputs)).assign_coords(_coordinates(of))
    target = Path(path).absolute()
    if target.is_dir():
        raise InputError(f"{path} is a folder; give the name of a file.")
    with output_folder(target.parent) as folder:
        encoding = {name: numbers for name, x in dataset.items() if x.dtype == np.float64}
        dataset.to_netcdf(folder / target.name, engine="netcdf4", encoding=encoding)


def read_baseline(path: str | PathLike[str]) -> Baseline:
    """Read a baseline.

    Parameters
    ----------
    path
        A file that `write_baseline` wrote.

    Raises
    ------
    InputError
        Where there is no such file, or it is not a baseline.
    """
    with open_netcdf(path, advice=_ADVICE) as dataset:
        load_all(dataset, path)
    _check_shapes(dataset, path)
    try:
        attributes = dataset.attrs
        bands = json.loads(attributes["requested_bands"])
        jacobians = Jacobians(
            *(tuple(str(x) for x in dataset[name].values) for name in ("column", "band", "input")),
            units=tuple(str(x) for x in dataset["input_units"].values),
            quantity=dataset["quantity"].values.astype(object),
            value=dataset["value"].values,
            jacobian=dataset["jacobian"].values,
            state=dataset["state"].values,
            request=Request(
                None if bands is None else tuple(bands),
                json.loads(attributes["requested_settings"]),
            ),
            settings=json.loads(attributes["settings"]),
            outputs=_outputs_in(dataset),
        )
        found = {name: str(attributes[f"{name}_version"]) for name in versions()}
        history = tuple(str(attributes["history"]).splitlines())
        scenario = str(attributes["scenario"])
    except KeyError as error:
        raise InputError(f"{path} is no baseline, {error} is missing; {_ADVICE}.") from error
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"{path} is no baseline ({error}); {_ADVICE}.") from error
    settings = jacobians.settings, jacobians.request.settings
    if not all(isinstance(each, dict) for each in settings):
        raise InputError(f"{path} has settings that are no names and values; {_ADVICE}.")
    if not set(jacobians.bands) <= set(BANDS):
        raise InputError(f"{path} holds bands that no baseline has; {_ADVICE}.")
    return Baseline(jacobians, scenario, found, history)


def _check_shapes(dataset: xr.Dataset, path: str | PathLike[str]) -> None:
    """Refuse arrays of other axes or types or of none, names twice, and infinite numbers.

    An infinite number would be within its own tolerance of any other.
    """
    for name, dims in _AXES.items():
        if name not in dataset:
            if name.startswith("output"):  # a file from before there were any
                continue
            raise InputError(f"{path} is no baseline, {name} is missing; {_ADVICE}.")
        values = dataset[name].values
        if dataset[name].dims != dims or (name in _NUMBERS) != (values.dtype == np.float64):
            raise InputError(
                f"{name} in {path} is {values.dtype} along {dataset[name].dims}; {_ADVICE}."
            )
        require_values(dataset[name], path)
        if name in _NUMBERS and np.isinf(values).any():
            raise InputError(f"{name} in {path} is infinite somewhere; {_ADVICE}.")
        if dims == (name,) and len(set(map(str, values))) < len(values):
            raise InputError(f"{name} in {path} names one thing twice; {_ADVICE}.")


def _variables(outputs: Outputs) -> dict[str, tuple[Any, ...]]:
    return {
        "output_units": ("output", np.array(outputs.units, dtype=object), _OUTPUT_UNITS),
        "output_value": (("output_row", "output"), outputs.value, _OUTPUT_VALUE),
        "output_slope": (("output_row", "output", "band"), outputs.slope, _OUTPUT_SLOPE),
    }


def _coordinates(of: Jacobians) -> dict[str, Any]:
    """Names of the outputs and of their rows, the columns and what is beside them."""
    assert of.outputs is not None
    return {
        "output": np.array(of.outputs.names, dtype=object),
        "output_row": np.array((*of.columns, *of.outputs.beside), dtype=object),
    }


def _outputs_in(dataset: xr.Dataset) -> Outputs | None:
    """The outputs of a file; None in one that was written before there were any."""
    if "output" not in dataset:
        return None
    names, units, rows = (
        tuple(str(x) for x in dataset[name].values)
        for name in ("output", "output_units", "output_row")
    )
    value, slope = (dataset[name].values for name in ("output_value", "output_slope"))
    return Outputs(names, units, rows[dataset.sizes["column"] :], value, slope)


_TOLERANCES = {
    "value": VALUE_TOLERANCE,
    "jacobian": JACOBIAN_TOLERANCE,
    "output": OUTPUT_TOLERANCE,
    "state": INPUT_TOLERANCE,
    "smallest_elasticity": SMALLEST_ELASTICITY,
    "smallest_input": SMALLEST_INPUT,
}
_OF_QUANTITY = ", ".join(f"{name} [{unit}]" for name, unit in UNITS.items())
_QUANTITY = {"long_name": "operator that the band is given to", "comment": _OF_QUANTITY}
_VALUE = {"long_name": "value of the quantity", "comment": f"units by quantity: {_OF_QUANTITY}"}
_JACOBIAN = {
    "long_name": "derivative of the value by the input",
    "comment": "units: those of the quantity over input_units; NaN where there is no such input",
}
_STATE = {"long_name": "the inputs", "comment": "units: input_units"}
_INPUT_UNITS = {"long_name": "units of the inputs"}
_OUTPUT_UNITS = {"long_name": "units of the outputs"}
_OUTPUT_VALUE = {
    "long_name": "what the instrument and products make of the values",
    "comment": "units: output_units; NaN where there is no such output",
}
_OUTPUT_SLOPE = {
    "long_name": "derivative of the output by the value of the band",
    "comment": "units: output_units over those of the quantity; NaN where there is none, and of "
    f"what is piecewise constant: {', '.join(PIECEWISE_CONSTANT)}",
}
