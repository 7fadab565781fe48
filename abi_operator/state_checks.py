"""What a state must be before it is solved: its shapes, and where they can be read its values."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from .atmosphere import State
from .bands import check_bands
from .machine.algebra import converted
from .ranges import FINITE, STATE
from .satellites import check_satellite, gas_fit_covers
from .solver.column import common_type

# Pressure at the ground where there is air: far from what the same air has in hPa. [Pa]
_GROUND_PRESSURE = 2e3, 1.2e5
# Pressure at the ground up to which a column is meant to have next to no air. [Pa]
_NEXT_TO_NONE = 50.0
# Height by which pressure falls to 1 / e, between the uppermost level with pressure and the ground;
# that of air is 6 to 9 km. [m]
_SCALE_HEIGHT = 5e2, 1e5
# Ratio of pressures from which it is judged. [-]
_SMALLEST_RATIO = 1.05


def check_state(state: State) -> None:
    """Refuse a state that cannot be: values in their ranges (`ranges.STATE`), levels in order.

    Values are read with NumPy, one column or a batch. `brf`, `reflectance_factor` and `radiance`
    call it where there are values to read; under `jax.jit` and in derivatives there are none, and
    nothing is checked. Angles below the horizon are allowed, see `quality_flags`; how much an
    anisotropic ground reflects is judged in the same flags. Values in another unit are refused
    where they are no longer those of air: pressure in hPa, heights in km, angles in degrees; and so
    is mass of particles without a number of them, which would be no cloud at all.

    Parameters
    ----------
    state
        A state whose leaves are arrays in memory.

    Raises
    ------
    ValueError
        Naming the field, the column (and layer or level) of the first value that is not allowed,
        the value and the allowed range.
    """
    num_axes = np.ndim(state.geometry.solar_zenith)
    for path, leaf in jax.tree_util.tree_leaves_with_path(state):
        allowed = STATE.get(_field(path), FINITE)
        x = np.asarray(leaf)
        _refuse(~allowed.holds(x), x, f"state{jax.tree_util.keystr(path)}", allowed.words, num_axes)
    air = state.atmosphere
    steps = np.diff(np.asarray(air.pressure), axis=-1)
    _refuse(steps < 0, steps, "state.atmosphere.pressure, from level to level", _RISING, num_axes)
    steps = np.diff(np.asarray(air.height), axis=-1)
    _refuse(steps > 0, steps, "state.atmosphere.height, from level to level", _FALLING, num_axes)
    _check_units(np.asarray(air.pressure), np.asarray(air.height), num_axes)
    clouds = {"liquid": air.liquid} | {
        f"hydrometeors[{name!r}]": x for name, x in air.hydrometeors.items()
    }
    for name, cloud in clouds.items():
        number = np.asarray(cloud.number_path)
        without = (np.asarray(cloud.mass_path) > 0) & ~(number > 0)
        label = f"state.atmosphere.{name}.number_path, where there is mass,"
        _refuse(without, np.broadcast_to(number, without.shape), label, "above 0", num_axes)
    for name, plume in air.plumes.items():
        depth = np.asarray(plume.top) - np.asarray(plume.base)
        label = f"state.atmosphere.plumes[{name!r}], top - base"
        _refuse(depth <= 0, depth, label, "above 0", num_axes)


_RISING = "a change of 0 or more: levels are ordered from the top"
_FALLING = "a change of 0 or less: levels are ordered from the top"


def _check_units(pressure: np.ndarray, height: np.ndarray, num_axes: int) -> None:
    """Refuse levels whose pressure or height is in another unit than Pa and m."""
    ground = pressure[..., -1]
    low, high = _GROUND_PRESSURE
    bad = (ground > _NEXT_TO_NONE) & ~((ground >= low) & (ground <= high))
    allowed = f"{low:g} to {high:g} Pa, or {_NEXT_TO_NONE:g} at most (pressure is in Pa)"
    _refuse(bad, ground, "state.atmosphere.pressure at the ground", allowed, num_axes)
    first = np.argmax(pressure > 0, axis=-1, keepdims=True)
    top, top_height = (np.take_along_axis(x, first, axis=-1)[..., 0] for x in (pressure, height))
    judged = ground > _SMALLEST_RATIO * top
    ratio = np.where(judged, ground, np.e) / np.where(judged, top, 1.0)
    scale_height = (top_height - height[..., -1]) / np.log(ratio)
    low, high = _SCALE_HEIGHT
    bad = judged & ~((scale_height >= low) & (scale_height <= high))
    label = "state.atmosphere: the height in which pressure falls to 1 / e"
    allowed = f"{low:g} to {high:g} m (height is in m)"
    _refuse(bad, scale_height, label, allowed, num_axes)


def is_concrete(tree: Any) -> bool:
    """Whether all values can be read: not under `jax.jit`, `jax.vmap` or a derivative."""
    return not any(isinstance(x, Tracer) for x in jax.tree.leaves(tree))


def checked_bands(
    state: State, bands: Sequence[str], gases: Sequence[str], satellite: str
) -> tuple[str, ...]:
    """Bands as a tuple, or `ValueError` for one that cannot be simulated of this state."""
    bands = check_bands(bands)
    check_satellite(satellite)
    for name in bands:
        if name not in state.albedo:
            raise ValueError(f"state.albedo has no {name!r}; it holds {list(state.albedo)}.")
        if gases and state.atmosphere.gases is not None and not gas_fit_covers(satellite, name):
            raise ValueError(
                f"the gas absorption of {name} is not that of {satellite}; leave the gases out "
                "with gases=()."
            )
    return bands


def uniform(state: State) -> tuple[State, tuple[int, ...]]:
    """Give all leaves one floating type, and check shapes: of the batch, of levels and of layers.

    Fields of a ground that are the same in all columns may be single numbers; they are repeated.

    Returns
    -------
    The state, and the shape of the batch.
    """
    leaves = jax.tree.leaves(state)

    def labels() -> list[str]:
        paths = jax.tree_util.tree_leaves_with_path(state)
        return [f"state{jax.tree_util.keystr(path)}" for path, _ in paths]

    dtype = common_type(leaves, labels)
    batch = np.shape(state.geometry.solar_zenith)
    num_levels = _num_levels(state, len(batch))

    def cast(path: Any, x: Any) -> Any:
        _refuse_list(path)
        x = converted(x, dtype)
        is_of_ground = len(path) > 2 and getattr(path[0], "name", None) == "albedo"
        if is_of_ground and x.ndim == 0:
            return jnp.broadcast_to(x, batch)
        if x.shape[: len(batch)] != batch:
            raise ValueError(
                f"state{jax.tree_util.keystr(path)} has shape {x.shape}, but solar_zenith has "
                f"{batch}: a batch of columns needs the same leading axes on every leaf."
            )
        _check_own_shape(path, x.shape[len(batch) :], num_levels)
        return x

    return jax.tree_util.tree_map_with_path(cast, state), batch


_AT_LEVELS = ("pressure", "height", "temperature")
_IN_LAYERS = ("mass_path", "number_path", "vapour", "ozone")


def _num_levels(state: State, num_axes: int) -> int:
    """Number of levels, two or more, or `ValueError`."""
    pressure = state.atmosphere.pressure
    if isinstance(pressure, list | tuple):
        raise _list_error(".atmosphere.pressure")
    shape = np.shape(pressure)
    if len(shape) != num_axes + 1 or shape[-1] < 2:
        raise ValueError(
            f"state.atmosphere.pressure has shape {shape}; it needs the {num_axes} axes of the "
            "batch and one of two levels or more."
        )
    return shape[-1]


def _check_own_shape(path: Any, shape: tuple[int, ...], num_levels: int) -> None:
    """Refuse a leaf whose axes of one column are not what its field has.

    Fields of a ground's own are its own business.
    """
    in_air = path[0].name == "atmosphere"
    if path[0].name == "albedo" and len(path) > 2:
        return
    expected, words = (), "one number a column"
    if in_air and _field(path) in _AT_LEVELS:
        expected, words = (num_levels,), f"{num_levels} levels, as pressure has"
    elif in_air and _field(path) in _IN_LAYERS:
        expected = (num_levels - 1,)
        words = f"{num_levels - 1} layers, as pressure has {num_levels} levels"
    if shape != expected:
        raise ValueError(
            f"state{jax.tree_util.keystr(path)} has the shape {shape} in a column; it needs "
            f"{words}, shape {expected}."
        )


def _refuse_list(path: Any) -> None:
    """Refuse a field that is a list or a tuple, in which JAX sees many leaves."""
    inside = path[2:3] if path[0].name == "albedo" else path
    for k, key in enumerate(path):
        if isinstance(key, jax.tree_util.SequenceKey) and key in inside:
            raise _list_error(jax.tree_util.keystr(path[:k]))


def _list_error(label: str) -> ValueError:
    return ValueError(f"state{label} is a list or a tuple; it must be one array: jnp.asarray(...).")


def _field(path: Any) -> str:
    """Name by which a leaf has a range: of its field, or of the field whose bands it is one of."""
    names = [key.name for key in path if hasattr(key, "name")]
    return names[-1]


def _refuse(bad: np.ndarray, x: np.ndarray, label: str, allowed: str, num_axes: int) -> None:
    if not np.any(bad):
        return
    index = tuple(int(i) for i in np.unravel_index(np.argmax(bad), bad.shape))
    column, inside = index[:num_axes], index[num_axes:]
    where = "".join(
        f" of {name} {part[0] if len(part) == 1 else part}"
        for name, part in (("entry", inside), ("column", column))
        if part
    )
    more = int(np.count_nonzero(bad)) - 1
    others = f" (and {more} more)" if more else ""
    raise ValueError(f"{label}{where} is {x[index]}{others}; allowed is {allowed}.")
