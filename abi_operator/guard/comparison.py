r"""What moved between two evaluations, each entry against its own tolerance.

The elasticity of an entry, :math:`|K x|`, is by how much the quantity changes when the input
changes by its own size; in it inputs of all units can be compared. An entry of the Jacobian may
move by

.. math:: 10^{-5} \max(|K|,\; 10^{-6} E / |x|), \qquad E = \max_j |K_j x_j|,

where j runs over all inputs of that column and band: five digits, but no less than 1e-11 of what
the band's most important input does. Where :math:`|x|` is less than 1e-3 of the largest number of
the same field in all columns, that stands for it (1, in the field's unit, where all are 0), so that
a derivative by what is absent has a finite tolerance. A value may move by 1e-12 of itself or of E,
a number of the state by 1e-12 of the largest of its field: values and states have to be float64
throughout, which the Jacobian's five digits would not show. An output of the instrument or of a
product may move by 1e-10 of itself, as it is a difference of values at times, but no less than of
1e-3 of the largest of its name; its slopes by the bands' values as entries of the Jacobian, against
the largest of them.

All are far above rounding: `tests/abi_operator/guard/test_spread.py` measures how far entries
scatter over threads and batches.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .evaluation import Jacobians
from .inputs import field_of
from .outputs import Outputs, in_common

JACOBIAN_TOLERANCE = 1e-5
"""Of an entry of the Jacobian. [-]"""
SMALLEST_ELASTICITY = 1e-6
"""Elasticity below which entries are no longer compared digit by digit, of the largest. [-]"""
SMALLEST_INPUT = 1e-3
"""Size that an input is taken for at least, of the largest number of its field. [-]"""
VALUE_TOLERANCE = 1e-12
"""Of a value. [-]"""
OUTPUT_TOLERANCE = 1e-10
"""Of an output. [-]"""
INPUT_TOLERANCE = 1e-12
"""Of a number of the state. [-]"""


class Moved(NamedTuple):
    """One entry that moved by more than its tolerance.

    Parameters
    ----------
    column, band, entry
        Where: the band is empty for a number of the state and for an output; the entry is an
        input, ``"value"`` for the slope of an output by the band's value, or empty for the value
        itself.
    quantity
        ``"state"``, ``"brf"``, ``"radiance"`` or the name of an output.
    stored, now, tolerance
        In the units of the entry.
    """

    column: str
    band: str
    entry: str
    quantity: str
    stored: float
    now: float
    tolerance: float

    @property
    def excess(self) -> float:
        """Change in tolerances; infinite where only one of the two is a number. [-]"""
        change = abs(self.now - self.stored)
        if not np.isfinite(change) or self.tolerance == 0:
            return np.inf
        return change / self.tolerance


class Comparison(NamedTuple):
    """What moved.

    Parameters
    ----------
    changed
        Settings, columns, bands and inputs that are not the same, in sentences.
    moved
        Numbers that moved, those of the state first, then the largest excess first.
    num_compared
        How many numbers both evaluations have.
    to_keep
        What is not in the file yet, as it is from before, in sentences: nothing that moved.
    """

    changed: list[str]
    moved: list[Moved]
    num_compared: int
    to_keep: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.changed or self.moved)


def compare(stored: Jacobians, now: Jacobians) -> Comparison:
    """Compare what is common to two evaluations, and say what is not.

    Parameters
    ----------
    stored
        Evaluation from which the tolerances are, too.
    now
        Evaluation of the code as it is.
    """
    changed = _changed(stored, now)
    new = select(now, stored.columns, stored.bands, stored.inputs)
    columns, bands, inputs = new.columns, new.bands, new.inputs
    old = select(stored, columns, bands, inputs)
    on_state, on_value, on_jacobian = _tolerances(old)
    moved = []
    for i, k in np.argwhere(_beyond(old.state, new.state, on_state)):
        numbers = old.state[i, k], new.state[i, k], on_state[k]
        moved.append(Moved(columns[i], "", inputs[k], "state", *map(float, numbers)))
    rest = []
    for i, b in np.argwhere(_beyond(old.value, new.value, on_value)):
        numbers = old.value[i, b], new.value[i, b], on_value[i, b]
        rest.append(Moved(columns[i], bands[b], "", str(old.quantity[i, b]), *map(float, numbers)))
    for i, b, k in np.argwhere(_beyond(old.jacobian, new.jacobian, on_jacobian)):
        numbers = old.jacobian[i, b, k], new.jacobian[i, b, k], on_jacobian[i, b, k]
        quantity = str(old.quantity[i, b])
        rest.append(Moved(columns[i], bands[b], inputs[k], quantity, *map(float, numbers)))
    for i, b in np.argwhere(old.quantity != new.quantity):
        changed.append(
            f"{bands[b]} of column {columns[i]!r} is {new.quantity[i, b] or 'absent'}, "
            f"was {old.quantity[i, b] or 'absent'}."
        )
    numbers, to_keep = [old.state, old.value, old.jacobian], ()
    if old.outputs is not None and new.outputs is not None:
        both = in_common(old.outputs, new.outputs)
        rest += _moved_outputs(*both, (*columns, *both[0].beside), bands)
        numbers += both[0].value, both[0].slope
    elif new.outputs is not None:
        to_keep = (
            f"{len(new.outputs.names)} outputs are not in the file yet; accept to keep them.",
        )
    rest.sort(key=lambda entry: -entry.excess)
    compared = sum(np.count_nonzero(~np.isnan(x)) for x in numbers)
    return Comparison(changed, moved + rest, int(compared), to_keep)


def select(
    of: Jacobians, columns: Sequence[str], bands: Sequence[str], inputs: Sequence[str]
) -> Jacobians:
    """The part of an evaluation with these names, in their order; those it lacks are left out."""
    pairs = (of.columns, columns), (of.bands, bands), (of.inputs, inputs)
    places = [{name: place for place, name in enumerate(own)} for own, _ in pairs]
    i, b, k = (
        [place[name] for name in wanted if name in place]
        for place, (_, wanted) in zip(places, pairs, strict=True)
    )
    return of._replace(
        columns=tuple(of.columns[x] for x in i),
        bands=tuple(of.bands[x] for x in b),
        inputs=tuple(of.inputs[x] for x in k),
        units=tuple(of.units[x] for x in k),
        quantity=of.quantity[np.ix_(i, b)],
        value=of.value[np.ix_(i, b)],
        jacobian=of.jacobian[np.ix_(i, b, k)],
        state=of.state[np.ix_(i, k)],
        outputs=None if of.outputs is None else of.outputs.part(i, b),
    )


def excess(stored: Jacobians, now: Jacobians) -> float:
    """Largest change of a value, an entry of the Jacobian or an output, in tolerances. [-]

    Parameters
    ----------
    stored, now
        Evaluations of the same columns, bands and inputs.
    """
    _, on_value, on_jacobian = _tolerances(stored)
    largest = 0.0
    pairs = [(stored.value, now.value, on_value), (stored.jacobian, now.jacobian, on_jacobian)]
    if stored.outputs is not None and now.outputs is not None:
        old, new = in_common(stored.outputs, now.outputs)
        pairs += zip(
            (old.value, old.slope), (new.value, new.slope), _output_tolerances(old), strict=True
        )
    for old, new, tolerance in pairs:
        change = np.abs(new - old)
        differs = change > 0
        if np.any(np.isnan(old) != np.isnan(new)) or np.any(tolerance[differs] == 0):
            return np.inf
        largest = max(largest, np.max(change[differs] / tolerance[differs], initial=0.0))
    return float(largest)


def _tolerances(stored: Jacobians) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tolerances of the state, by input alone, of values and of the Jacobian."""
    sizes = np.abs(stored.state)
    fields: dict[str, list[int]] = {}
    for k, name in enumerate(stored.inputs):
        fields.setdefault(field_of(name), []).append(k)
    largest = np.zeros(len(stored.inputs))
    for members in fields.values():
        numbers = sizes[:, members]
        largest[members] = np.max(numbers[~np.isnan(numbers)], initial=0.0)
    floor = np.where(largest > 0, SMALLEST_INPUT * largest, 1.0)
    elasticities = np.abs(stored.jacobian * stored.state[:, None, :])
    greatest = np.max(np.where(np.isnan(elasticities), 0.0, elasticities), axis=-1, initial=0.0)
    least = SMALLEST_ELASTICITY * greatest[..., None] / np.maximum(sizes, floor)[:, None, :]
    return (
        INPUT_TOLERANCE * largest,
        VALUE_TOLERANCE * np.maximum(np.abs(stored.value), greatest),
        JACOBIAN_TOLERANCE * np.maximum(np.abs(stored.jacobian), least),
    )


def _output_tolerances(stored: Outputs) -> tuple[np.ndarray, np.ndarray]:
    """Tolerances of the outputs' values and of their slopes."""
    sizes, steepness = np.nan_to_num(np.abs(stored.value)), np.nan_to_num(np.abs(stored.slope))
    largest = np.max(sizes, axis=0, initial=0.0)
    floor = np.where(largest > 0, SMALLEST_INPUT * largest, 1.0)
    steepest = np.max(steepness, axis=-1, keepdims=True, initial=0.0)
    return (
        OUTPUT_TOLERANCE * np.maximum(sizes, floor),
        JACOBIAN_TOLERANCE * np.maximum(steepness, SMALLEST_ELASTICITY * steepest),
    )


def _moved_outputs(
    old: Outputs, new: Outputs, rows: tuple[str, ...], bands: tuple[str, ...]
) -> list[Moved]:
    on_value, on_slope = _output_tolerances(old)
    moved = []
    for i, k in np.argwhere(_beyond(old.value, new.value, on_value)):
        numbers = old.value[i, k], new.value[i, k], on_value[i, k]
        moved.append(Moved(rows[i], "", "", old.names[k], *map(float, numbers)))
    for i, k, b in np.argwhere(_beyond(old.slope, new.slope, on_slope)):
        numbers = old.slope[i, k, b], new.slope[i, k, b], on_slope[i, k, b]
        moved.append(Moved(rows[i], bands[b], "value", old.names[k], *map(float, numbers)))
    return moved


def _beyond(old: np.ndarray, new: np.ndarray, tolerance: np.ndarray) -> np.ndarray:
    """Where numbers moved; NaN is what is not there, and what is there in one alone has moved."""
    return (np.abs(new - old) > tolerance) | (np.isnan(old) != np.isnan(new))


def _changed(stored: Jacobians, now: Jacobians) -> list[str]:
    changed = []
    for name in sorted(stored.settings.keys() | now.settings.keys()):
        # A setting that is younger than the baseline is None where nobody asks for it.
        old, new = stored.settings.get(name), now.settings.get(name)
        if old != new:
            changed.append(f"setting {name} is {new}, was {old}.")
    names = [
        ("column", stored.columns, now.columns),
        ("band", stored.bands, now.bands),
        ("input", stored.inputs, now.inputs),
    ]
    units = [("input", stored.inputs, stored.units, now.inputs, now.units)]
    if stored.outputs is not None and now.outputs is not None:
        old, new = stored.outputs, now.outputs
        names += [("output", old.names, new.names), ("row of outputs", old.beside, new.beside)]
        units.append(("output", old.names, old.units, new.names, new.units))
    elif stored.outputs is not None:
        changed.append("outputs are gone.")
    for what, old, new in names:
        gone = [name for name in old if name not in set(new)]
        added = [name for name in new if name not in set(old)]
        changed += [f"{what} {name} is gone." for name in gone]
        changed += [f"{what} {name} is new." for name in added]
    for what, old, old_units, new, new_units in units:
        now_in = dict(zip(new, new_units, strict=True))
        for name, unit in zip(old, old_units, strict=True):
            if now_in.get(name, unit) != unit:
                changed.append(f"{what} {name} is in {now_in[name]}, was in {unit}.")
    return changed
