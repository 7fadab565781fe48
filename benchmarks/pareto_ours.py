"""This project's solver on the columns of `pareto_columns`, and the truth beside all solvers.

Calls are those of a script without any setting but float64: NumPy in, NumPy out, and no `jax.jit`
of the caller's. What a solver may skip is `error_budget` of `toa_brf`, a relative error of brf at
the 99th percentile that comes on top of what the streams leave.
"""

import inspect
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np
from pareto_columns import Columns

from abi_operator.solver import toa_brf, toa_radiance

# Of each door, by whether it emits.
CAN_SKIP = tuple(
    "error_budget" in inspect.signature(door).parameters for door in (toa_brf, toa_radiance)
)

# Streams, and the error that may be spent beside theirs, by workload and error to be met. Fixed on
# columns of seeds 100 to 104, none of which is timed (`pareto_streams`): at the 99th percentile W1
# leaves there 5e-3 to 8e-3 at 8 streams and 3e-4 to 6e-4 at 16, W2 4e-3 to 8e-3 at 8 and 1e-3 at
# 24, W3 3e-3 at 2 and 3e-4 at 4, W4 2e-3 to 4e-3 at 10 and 4e-4 at 16.
STREAMS = {
    "W1": {1e-2: (8, 3e-3), 1e-3: (16, 4e-4)},
    "W2": {1e-2: (8, 1e-3), 1e-3: (24, 1e-4)},
    "W3": {1e-2: (2, 9e-3), 1e-3: (4, 9e-4)},
    "W4": {1e-2: (10, 3e-3), 1e-3: (16, 4e-4)},
}
TRUE_STREAMS = 64
PEAKED = 1.0  # (2l + 1) chi_l at the 64th moment, of a layer that scatters: a peak
DARK = 0.01  # errors are relative to brf, or to this where brf is less


@dataclass(frozen=True)
class Part:
    """Columns of one call: their rows among all, and what turns a result into brf."""

    rows: np.ndarray
    emits: bool
    arguments: dict[str, np.ndarray]
    of_brf: np.ndarray | float  # radiance of a brf of 1


def parts_of(columns: Columns, num_streams, emission=True):
    """What is given to the solver; radiances and reflectances are two calls."""
    found = []
    emits = columns.emits & emission
    for kind in (False, True):
        rows = np.flatnonzero(emits == kind)
        if len(rows):
            own = columns.rows(rows)
            arguments, unit = own.arguments(num_streams, emits=kind), 1.0
            if kind:
                unit = own.solar_irradiance * own.mu0 / np.pi
            found.append(Part(rows, kind, arguments, unit))
    return found


def _call(part: Part, arguments, options):
    door = toa_radiance if part.emits else toa_brf
    known = options if CAN_SKIP[part.emits] else {"num_streams": options["num_streams"]}
    return door(**arguments, **known)


def value(parts, options):
    """Reflectances or radiances of each part, by plain calls."""
    return [np.asarray(_call(part, part.arguments, options)) for part in parts]


def gradient(parts, options):
    """The same, and the gradient of their sum in every argument; columns do not mix."""
    found = []
    for part in parts:

        def total(arguments, part=part):
            light = _call(part, arguments, options)
            return light.sum(), light

        (_, light), slopes = jax.value_and_grad(total, has_aux=True)(part.arguments)
        jax.tree.map(np.asarray, slopes)
        found.append(np.asarray(light))
    return found


def as_brf(parts, light):
    """brf of all columns in order: pi L / (mu0 F0) where they emit."""
    brf = np.empty(sum(len(part.rows) for part in parts))
    for part, x in zip(parts, light, strict=True):
        brf[part.rows] = x / part.of_brf
    return brf


def options_of(workload, budget, skipping) -> dict[str, Any]:
    """Options of the solver for an error that is to be met."""
    num_streams, spent = STREAMS[workload][budget]
    options = {"num_streams": num_streams}
    return options | {"error_budget": spent} if skipping and any(CAN_SKIP) else options


def truth(columns: Columns, emission=True, num_streams=TRUE_STREAMS):
    """brf by 64 streams: every layer and every mode."""
    parts = parts_of(columns, num_streams, emission)
    return as_brf(parts, value(parts, {"num_streams": num_streams}))


def without_correction(columns: Columns):
    """The same by delta-M alone, which knows the moments that it solves with and no others."""
    found = np.empty(columns.count)
    for part in parts_of(columns, TRUE_STREAMS, emission=False):
        given = {k: x for k, x in part.arguments.items() if k != "phase_function"}
        found[part.rows] = toa_brf(**given, num_streams=TRUE_STREAMS, single_scattering=None)
    return found


def peaked(columns: Columns):
    """Whether 64 streams leave a part of a column's phase functions to delta-M."""
    last = columns.moments(TRUE_STREAMS + 1)[..., -1]
    scatters = columns.tau * columns.ssa > 1e-4
    return ((2 * TRUE_STREAMS + 1) * last * scatters).max(axis=1) > PEAKED


def relative_error(brf, true_brf):
    return np.abs(brf - true_brf) / np.maximum(true_brf, DARK)
