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
throughout, which the Jacobian's five digits would not show.

All are far above rounding: `tests/abi_operator/guard/test_spread.py` measures how far entries
scatter over threads and batches.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .evaluation import Jacobians
from .inputs import field_of

JACOBIAN_TOLERANCE = 1e-5
"""Of an entry of the Jacobian. [-]"""
SMALLEST_ELASTICITY = 1e-6
"""Elasticity below which entries are no longer compared digit by digit, of the largest. [-]"""
SMALLEST_INPUT = 1e-3
"""Size that an input is taken for at least, of the largest number of its field. [-]"""
VALUE_TOLERANCE = 1e-12
"""Of a value. [-]"""
INPUT_TOLERANCE = 1e-12
"""Of a number of the state. [-]"""


class Moved(NamedTuple):
    """One entry that moved by more than its tolerance.

    Parameters
    ----------
    column, band, entry
        Where: the band is empty for a number of the state; the entry is an input, or empty for
        the value itself.
    quantity
        ``"state"``, ``"brf"`` or ``"radiance"``.
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
    """

    changed: list[str]
    moved: list[Moved]
    num_compared: int

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
    rest.sort(key=lambda entry: -entry.excess)
    compared = sum(np.count_nonzero(~np.isnan(x)) for x in (old.state, old.value, old.jacobian))
    return Comparison(changed, moved + rest, int(compared))


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
    )


def excess(stored: Jacobians, now: Jacobians) -> float:
    """Largest change of a value or an entry of the Jacobian, in tolerances. [-]

    Parameters
    ----------
    stored, now
        Evaluations of the same columns, bands and inputs.
    """
    _, on_value, on_jacobian = _tolerances(stored)
    largest = 0.0
    for old, new, tolerance in (
        (stored.value, now.value, on_value),
        (stored.jacobian, now.jacobian, on_jacobian),
    ):
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
    for what, old, new in (
        ("column", stored.columns, now.columns),
        ("band", stored.bands, now.bands),
        ("input", stored.inputs, now.inputs),
    ):
        gone = [name for name in old if name not in set(new)]
        added = [name for name in new if name not in set(old)]
        changed += [f"{what} {name} is gone." for name in gone]
        changed += [f"{what} {name} is new." for name in added]
    units = dict(zip(now.inputs, now.units, strict=True))
    for name, unit in zip(stored.inputs, stored.units, strict=True):
        if units.get(name, unit) != unit:
            changed.append(f"input {name} is in {units[name]}, was in {unit}.")
    return changed
