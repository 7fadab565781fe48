"""Priors that a user writes down: a TOML file with one table for each quantity."""

import dataclasses
import sys
import tomllib
from pathlib import Path

import jax.numpy as jnp

from abi_operator.files import InputError

from .quantities import Quantity
from .state_vector import StateVector

# An integer may be larger than any floating number.
_LARGEST = sys.float_info.max

DECLARED = "declared"
"""In place of a file: what the quantities' declarations say."""


def read_prior(path: str, vector: StateVector) -> StateVector:
    """A state vector whose declarations are those of a file.

    Each table of the file is named as a quantity and has its ``mean`` and ``sigma``, the standard
    deviation, in the unit of the quantity; at the mean, as x is not linear in it. What is not in
    the file is as it was declared::

        [aod_550]
        mean = 0.5
        sigma = 0.3

    Parameters
    ----------
    path
        Of the file, or ``"declared"``.
    vector
        What is retrieved.

    Raises
    ------
    InputError
        Where the file cannot be read, or says something else.
    """
    if path == DECLARED:
        return vector
    try:
        tables = tomllib.loads(Path(path).read_text())
    except (OSError, ValueError, RecursionError) as error:  # integers of any length, deep brackets
        raise InputError(f"the prior {path} cannot be read ({error}).") from error
    unknown = [name for name in tables if name not in vector.names]
    if unknown:
        raise InputError(
            f"the prior {path} has {', '.join(unknown)}; retrieved is {', '.join(vector.names)}."
        )
    quantities = tuple(
        _with(quantity, tables[quantity.name], path) if quantity.name in tables else quantity
        for quantity in vector.quantities
    )
    return dataclasses.replace(vector, quantities=quantities)


def _with(quantity: Quantity, table: object, path: str) -> Quantity:
    """A quantity with another prior."""
    name = quantity.name
    words = f"the prior {path}: [{name}] needs numbers mean and sigma, sigma above 0 and finite"
    if not isinstance(table, dict) or set(table) != {"mean", "sigma"}:
        raise InputError(f"{words}; got {table}.")
    mean, sigma = table["mean"], table["sigma"]
    numbers = all(type(x) in (int, float) for x in (mean, sigma))
    if not numbers or not 0 < sigma < _LARGEST or abs(mean) > _LARGEST:
        raise InputError(f"{words}; got {table}.")
    if not jnp.isfinite(quantity.transform.x(jnp.asarray(mean, float))):
        raise InputError(f"the prior {path}: {mean} is no possible mean of {name}.")
    return dataclasses.replace(quantity, mean=float(mean), sigma=float(sigma), sigma_in_units=True)
