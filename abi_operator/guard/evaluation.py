"""Values and Jacobians of all bands with respect to every input of a few columns."""

import inspect
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..atmosphere import Plume, State
from ..bands import BANDS, check_bands
from ..machine.compiler import SOON_COMPILED
from ..radiance import FIRE_BANDS, THERMAL, radiance
from ..reflectance import brf
from ..state_checks import check_state
from .inputs import as_matrix, one_by_one, same_structure, structure
from .outputs import Outputs, outputs_of
from .seen import Seen

NUM_DOUBLINGS = 8
"""Doublings of the solver, a static setting of what is compiled: at 8 streams right to 1e-12 for
layers of an optical depth up to 6000."""

QUANTITIES = {"brf": brf, "radiance": radiance}
"""The operators that are guarded."""
UNITS = {"brf": "1", "radiance": "W m-2 sr-1 um-1"}


class Request(NamedTuple):
    """What was asked for; all the rest are defaults.

    Parameters
    ----------
    bands
        Bands to evaluate, of those that a column is specified for; None for all of `BANDS`.
    settings
        Arguments of the operators by name (``num_streams``, ``gases``, ``satellite``).
    """

    bands: tuple[str, ...] | None = None
    settings: Mapping[str, Any] = {}


class Jacobians(NamedTuple):
    """Values and Jacobians of columns, in NumPy and float64.

    Parameters
    ----------
    columns, bands, inputs
        Names along the axes of the arrays.
    units
        Of the inputs.
    quantity
        ``"brf"`` or ``"radiance"``, the operator that a band of a column was given to; empty where
        the column is not specified for the band. Axes column, band.
    value
        [-] or [W m-2 sr-1 um-1]; NaN where there is none. Axes column, band.
    jacobian
        Derivative of the value by an input; NaN where a column has no such input. Axes column,
        band, input.
    state
        The inputs themselves, NaN where a column has no such. Axes column, input.
    request
        What was asked for.
    settings
        Every setting of the operators, asked for or default.
    outputs
        What the instrument and products make of the values; None in a file from before.
    """

    columns: tuple[str, ...]
    bands: tuple[str, ...]
    inputs: tuple[str, ...]
    units: tuple[str, ...]
    quantity: np.ndarray
    value: np.ndarray
    jacobian: np.ndarray
    state: np.ndarray
    request: Request
    settings: dict[str, Any]
    outputs: Outputs | None = None


def evaluate(
    states: State | Mapping[str, State],
    bands: Sequence[str] | None = None,
    **settings: Any,
) -> Jacobians:
    """Evaluate the operator, its whole Jacobian and outputs, in float64 whatever JAX is set to.

    Bands in which the state emits (C07; C05 and C06 too where there is a fire) are evaluated by
    `radiance`, all others by `brf`. Derivatives are in reverse mode, since there are more inputs
    than bands. Columns of the same structure are one batch.

    Parameters
    ----------
    states
        Columns by name, or a batch with one leading axis.
    bands
        None for all that a column is specified for. A column that is not specified for one of
        them goes without.
    settings
        Arguments of `brf` and `radiance`, in place of their defaults. That of `num_doublings` is
        `NUM_DOUBLINGS`.

    Raises
    ------
    ValueError
        Where a setting or a band is unknown, no state is specified for a band, a state is not one
        column, or the operator refuses it.
    """
    request = Request(None if bands is None else check_bands(tuple(bands)), settings)
    complete = resolved(settings)
    with jax.enable_x64(True):
        columns = one_by_one(states)
        found: dict[str, dict[str, Any]] = {}
        for names in same_structure(columns):
            batch = jax.tree.map(lambda *x: jnp.stack(x), *(columns[name] for name in names))
            found |= _of_batch(names, batch, request)
    for band in request.bands or ():
        if not any(band in of["bands"] for of in found.values()):
            raise ValueError(
                f"no state is specified for {band}: it needs an albedo, the optics of plumes and, "
                "in C07, temperatures."
            )
    aligned = _aligned(list(columns), found, request, complete)
    with jax.enable_x64(True):
        return aligned._replace(outputs=outputs_of(seen_in(aligned), complete["satellite"]))


def seen_in(of: Jacobians) -> Seen:
    """What outputs are made of: values by band, and angles, which are among the inputs."""
    angles = (
        of.state[:, of.inputs.index(f"geometry.{name}")]
        for name in ("solar_zenith", "view_zenith", "relative_azimuth")
    )
    return Seen(
        {band: jnp.asarray(of.value[:, k]) for k, band in enumerate(of.bands)},
        {band: of.quantity[:, k] != "radiance" for k, band in enumerate(of.bands)},
        *angles,
    )


def resolved(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Every setting of the operators: those given, and defaults of the code as it is.

    A default that two operators do not share is a dictionary with that of each.
    """
    by_operator: dict[str, dict[str, Any]] = {}
    for quantity, operator in QUANTITIES.items():
        for name, parameter in inspect.signature(operator).parameters.items():
            if parameter.kind is inspect.Parameter.KEYWORD_ONLY:
                by_operator.setdefault(name, {})[quantity] = _plain(parameter.default)
    unknown = [name for name in settings if name not in by_operator]
    if unknown:
        raise ValueError(f"settings {unknown} are not known; choose from {list(by_operator)}.")
    defaults: dict[str, Any] = {}
    for name, of_each in by_operator.items():
        first, *others = of_each.values()
        defaults[name] = of_each if any(x != first for x in others) else first
    defaults["num_doublings"] = NUM_DOUBLINGS
    return {name: _plain(value) for name, value in (defaults | dict(settings)).items()}


def quantity_of(state: State, band: str) -> str:
    """Which operator a band is given to."""
    emitting = THERMAL if state.fire is None else FIRE_BANDS
    return "radiance" if band in emitting else "brf"


def specified_bands(state: State) -> tuple[str, ...]:
    """Bands of `BANDS` that a column holds all that is needed of."""
    air = state.atmosphere
    held = set(state.albedo)
    for plume in air.plumes.values():
        if isinstance(plume, Plume):
            held &= set(plume.ssa)
    if air.background is not None:
        held &= set(air.background.ssa)
    if air.temperature is None or state.surface_temperature is None:
        held -= set(THERMAL)
    return tuple(band for band in BANDS if band in held)


def values_and_jacobian(
    states: State, quantity: str, bands: tuple[str, ...], settings: tuple[tuple[str, Any], ...]
) -> tuple[jax.Array, State]:
    """Values of a batch, axes column band, and their derivatives, axes band column first."""
    operator = QUANTITIES[quantity]
    known = inspect.signature(operator).parameters
    given = {"num_doublings": NUM_DOUBLINGS} | dict(settings)
    given = {name: value for name, value in given.items() if name in known}
    value, pull_back = jax.vjp(lambda s: operator(s, bands, **given), states)
    # A band's cotangent is 1 in all columns at once: none depends on another's state.
    one_band = jnp.broadcast_to(jnp.eye(len(bands))[:, None, :], (len(bands), *value.shape))
    return value, jax.lax.map(lambda cotangent: pull_back(cotangent)[0], one_band)


# The programs run for milliseconds and are compiled for a minute.
_compiled = jax.jit(values_and_jacobian, static_argnums=(1, 2, 3), compiler_options=SOON_COMPILED)


def _of_batch(names: Sequence[str], batch: State, request: Request) -> dict[str, dict[str, Any]]:
    """By column: names and units of its inputs, their values, and what each band gave."""
    check_state(batch)
    one = jax.tree.map(lambda x: x[0], batch)
    bands = specified_bands(one)
    if request.bands is not None:
        bands = tuple(band for band in bands if band in request.bands)
    settings = tuple(sorted((name, _hashable(x)) for name, x in request.settings.items()))
    numbers = as_matrix(batch, [len(names)])
    found = {
        name: {"inputs": structure(one), "state": row, "bands": {}}
        for name, row in zip(names, numbers, strict=True)
    }
    for quantity in QUANTITIES:
        group = tuple(band for band in bands if quantity_of(one, band) == quantity)
        if not group:
            continue
        value, derivatives = _compiled(batch, quantity, group, settings)
        jacobian = as_matrix(derivatives, [len(group), len(names)])
        for i, name in enumerate(names):
            for k, band in enumerate(group):
                entry = quantity, float(value[i, k]), jacobian[k, i]
                found[name]["bands"][band] = entry
    return found


def _aligned(
    columns: list[str],
    found: Mapping[str, Mapping[str, Any]],
    request: Request,
    settings: dict[str, Any],
) -> Jacobians:
    """Arrays over all columns, with the inputs that any of them has."""
    units: dict[str, str] = {}
    for name in columns:
        units |= dict(zip(*found[name]["inputs"], strict=True))
    inputs = tuple(units)
    bands = tuple(b for b in BANDS if any(b in found[name]["bands"] for name in columns))
    place = {name: k for k, name in enumerate(inputs)}
    shape = len(columns), len(bands)
    quantity = np.full(shape, "", dtype=object)
    value, jacobian = np.full(shape, np.nan), np.full((*shape, len(inputs)), np.nan)
    state = np.full((len(columns), len(inputs)), np.nan)
    for i, name in enumerate(columns):
        here = [place[entry] for entry in found[name]["inputs"].names]
        state[i, here] = found[name]["state"]
        for k, band in enumerate(bands):
            if band in found[name]["bands"]:
                quantity[i, k], value[i, k], jacobian[i, k, here] = found[name]["bands"][band]
    return Jacobians(
        tuple(columns),
        bands,
        inputs,
        tuple(units.values()),
        quantity,
        value,
        jacobian,
        state,
        request,
        settings,
    )


def _plain(value: Any) -> Any:
    """A setting as JSON has it."""
    if isinstance(value, tuple | list):
        return [_plain(x) for x in value]
    return value.item() if isinstance(value, np.generic) else value


def _hashable(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
