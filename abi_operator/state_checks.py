"""What a state must be before it is solved: its shapes, and where they can be read its values."""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from ._numerics import converted
from .atmosphere import State
from .bands import check_bands
from .satellites import check_satellite, gas_fit_covers

_INF = float("inf")
_NOT_NEGATIVE = (0.0, _INF, "0 or more")
_POSITIVE = (np.nextafter(0.0, 1.0), _INF, "above 0")
_SHARE = (0.0, 1.0, "0 to 1")
_ZENITH = (0.0, np.pi, "0 to pi")
_ANY = (-_INF, _INF, "finite")

# Range of the fields that have the same one wherever they are: smallest and largest value, and how
# to say so. Every field is finite.
_RANGES: dict[str, tuple[float, float, str]] = {
    "pressure": _NOT_NEGATIVE,
    "temperature": _POSITIVE,
    "surface_temperature": _POSITIVE,
    "height": _ANY,
    "mass_path": _NOT_NEGATIVE,
    "number_path": _NOT_NEGATIVE,
    "vapour": _NOT_NEGATIVE,
    "ozone": _NOT_NEGATIVE,
    "carbon_dioxide": _SHARE,
    "methane": _SHARE,
    "nitrous_oxide": _SHARE,
    "base": _NOT_NEGATIVE,
    "top": _NOT_NEGATIVE,
    "extinction_550": _NOT_NEGATIVE,
    "brightness": _SHARE,
    "relative_extinction": _NOT_NEGATIVE,
    "ssa": _SHARE,
    "asymmetry": (-1.0, 1.0, "-1 to 1"),
    "effective_radius_um": _POSITIVE,
    "fraction": _SHARE,
    "albedo": _SHARE,
    "wind_speed": _NOT_NEGATIVE,
    "solar_zenith": _ZENITH,
    "view_zenith": _ZENITH,
    "relative_azimuth": _ANY,
}


def check_state(state: State) -> None:
    """Refuse a state that cannot be: every value in its range, levels in order, edges too.

    Values are read with NumPy, one column or a batch. `brf`, `reflectance_factor` and `radiance`
    call it where there are values to read; under `jax.jit` and in derivatives there are none, and
    nothing is checked. Angles below the horizon are allowed, see `quality_flags`; an anisotropic
    ground is judged by what it reflects, in the same flags.

    Raises
    ------
    ValueError
        Naming the field, the column (and layer or level) of the first value that is not allowed,
        the value and the allowed range.
    """
    num_axes = np.ndim(state.geometry.solar_zenith)
    for path, leaf in jax.tree_util.tree_leaves_with_path(state):
        low, high, words = _RANGES.get(_field(path), _ANY)
        x = np.asarray(leaf)
        bad = ~((x >= low) & (x <= high) & np.isfinite(x))
        _refuse(bad, x, f"state{jax.tree_util.keystr(path)}", f"{words}", num_axes)
    air = state.atmosphere
    steps = np.diff(np.asarray(air.pressure), axis=-1)
    _refuse(steps < 0, steps, "state.atmosphere.pressure, from level to level", _RISING, num_axes)
    steps = np.diff(np.asarray(air.height), axis=-1)
    _refuse(steps > 0, steps, "state.atmosphere.height, from level to level", _FALLING, num_axes)
    for name, plume in air.plumes.items():
        depth = np.asarray(plume.top) - np.asarray(plume.base)
        label = f"state.atmosphere.plumes[{name!r}], top - base"
        _refuse(depth <= 0, depth, label, "above 0", num_axes)


_RISING = "a change of 0 or more: levels are ordered from the top"
_FALLING = "a change of 0 or less: levels are ordered from the top"


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
    """Give all leaves one floating type, and check that they share the batch's shape.

    Fields of a ground that are the same in all columns may be single numbers; they are repeated.

    Returns
    -------
    The state, and the shape of the batch.
    """
    leaves = jax.tree.leaves(state)
    arrays = [x for x in leaves if hasattr(x, "dtype")]
    dtype = jax.dtypes.canonicalize_dtype(np.result_type(*(x.dtype for x in arrays), np.float16))
    batch = np.shape(state.geometry.solar_zenith)

    def cast(path: Any, x: Any) -> Any:
        x = converted(x, dtype)
        is_of_ground = len(path) > 2 and getattr(path[0], "name", None) == "albedo"
        if is_of_ground and x.ndim == 0:
            return jnp.broadcast_to(x, batch)
        if x.shape[: len(batch)] != batch:
            raise ValueError(
                f"state{jax.tree_util.keystr(path)} has shape {x.shape}, but solar_zenith has "
                f"{batch}: a batch of columns needs the same leading axes on every leaf."
            )
        return x

    return jax.tree_util.tree_map_with_path(cast, state), batch


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
