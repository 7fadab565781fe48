"""The inputs of a column: every floating number of a state, by name and with its unit."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..atmosphere import State

UNITS = {
    "pressure": "Pa",
    "height": "m",
    "temperature": "K",
    "surface_temperature": "K",
    "mass_path": "kg m-2",
    "number_path": "m-2",
    "vapour": "kg m-2",
    "ozone": "DU",
    "carbon_dioxide": "1",
    "methane": "1",
    "nitrous_oxide": "1",
    "base": "m",
    "top": "m",
    "extinction_550": "m-1",
    "aod_550": "1",
    "scale_height": "m",
    "brightness": "1",
    "relative_extinction": "1",
    "ssa": "1",
    "asymmetry": "1",
    "effective_radius_um": "um",
    "albedo": "1",
    "solar_zenith": "rad",
    "view_zenith": "rad",
    "relative_azimuth": "rad",
    "fraction": "1",
    "wind_speed": "m s-1",
}
"""Units by the name of a field. A field that is not here has that of the nearest one around it."""
UNKNOWN_UNIT = "unknown"


class Structure(NamedTuple):
    """Names of the inputs that columns of one structure have.

    Parameters
    ----------
    names
        Of every number, as ``atmosphere.pressure[3]`` or ``albedo.C01``.
    units
        Of every number.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]


def double_precision(state: State) -> State:
    """The same state with every leaf a float64 array."""
    return jax.tree.map(lambda x: jnp.asarray(np.asarray(x, np.float64)), state)


def one_by_one(states: State | Mapping[str, State]) -> dict[str, State]:
    """Columns by name, each without axes of a batch.

    Parameters
    ----------
    states
        Columns by name; or one column, or a batch with one leading axis, named by numbers from 0.

    Raises
    ------
    ValueError
        Where a column has axes of a batch, a batch more than one, or there is no column.
    """
    if isinstance(states, Mapping):
        columns = {str(name): double_precision(state) for name, state in states.items()}
    else:
        batch = double_precision(states)
        shape = batch.geometry.solar_zenith.shape
        if len(shape) > 1:
            raise ValueError(f"a batch of states has one leading axis; got {shape}.")
        if not shape:
            batch = jax.tree.map(lambda x: x[None], batch)
        count = batch.geometry.solar_zenith.shape[0]
        columns = {str(k): jax.tree.map(lambda x, k=k: x[k], batch) for k in range(count)}
    if not columns:
        raise ValueError("there is no state to evaluate; give at least one.")
    for name, state in columns.items():
        if state.geometry.solar_zenith.ndim:
            shape = state.geometry.solar_zenith.shape
            raise ValueError(f"the state {name!r} is a batch {shape}; name one column a state.")
    return columns


def same_structure(columns: Mapping[str, State]) -> list[list[str]]:
    """Names of the columns in groups that can be stacked: same classes, same sizes."""
    groups: dict[Any, list[str]] = {}
    for name, state in columns.items():
        leaves, tree = jax.tree.flatten(state)
        groups.setdefault((tree, tuple(x.shape for x in leaves)), []).append(name)
    return list(groups.values())


def structure(state: State) -> Structure:
    """Names and units of the inputs of one column, in the order of its leaves."""
    names, units = [], []
    for path, leaf in jax.tree_util.tree_leaves_with_path(state):
        keys = [_key(entry) for entry in path]
        unit = next((UNITS[key] for key in reversed(keys) if key in UNITS), UNKNOWN_UNIT)
        for index in np.ndindex(*leaf.shape):
            names.append(".".join(keys) + (f"[{', '.join(map(str, index))}]" if index else ""))
            units.append(unit)
    return Structure(tuple(names), tuple(units))


def as_matrix(tree: State, leading: Sequence[int]) -> np.ndarray:
    """All leaves side by side, behind axes that all of them share."""
    return np.concatenate(
        [np.asarray(x).reshape(*leading, -1) for x in jax.tree.leaves(tree)], axis=-1
    )


def field_of(name: str) -> str:
    """Name of the leaf that a number belongs to."""
    return name.partition("[")[0]


def _key(entry: Any) -> str:
    for attribute in ("name", "key", "idx"):
        if hasattr(entry, attribute):
            return str(getattr(entry, attribute))
    return str(entry)
