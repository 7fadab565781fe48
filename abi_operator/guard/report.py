"""A table of what moved, for people."""

from collections.abc import Sequence

from .comparison import Comparison, Moved
from .inputs import field_of

NUM_ROWS = 40
"""Rows of the table, and sentences above it, of which the rest is counted."""

_HEADER = ("column", "band", "entry", "stored", "now", "change", "tolerance", "moved")


def report(comparison: Comparison, num_rows: int | None = NUM_ROWS) -> str:
    """What moved, in sentences and a table of one row for each field of a column and band.

    A row shows the entry of the field that moved furthest in tolerances, and in its last place how
    many entries of the field moved.

    Parameters
    ----------
    comparison
        What moved.
    num_rows
        Rows to show at most; None for all.
    """
    if not comparison:
        nothing = f"nothing moved in {comparison.num_compared} numbers."
        return "\n".join([nothing, *comparison.to_keep])
    lines = _shortened(comparison.changed, num_rows, "changes")
    rows = _rows(comparison.moved)
    table = [_HEADER, *_shortened(rows, num_rows, "")]
    if comparison.moved:
        widths = [max(map(len, cells)) for cells in zip(*table, strict=True)]
        lines += [_line(row, widths) for row in table]
        if len(table) <= len(rows):
            lines.append(f"... and {len(rows) + 1 - len(table)} more rows.")
        count = f"{len(comparison.moved)} of {comparison.num_compared} numbers"
        lines.append(f"{count} moved by more than their tolerance.")
    lines += comparison.to_keep
    return "\n".join(lines)


def _shortened(items: Sequence, num_rows: int | None, what: str) -> list:
    """The first of many; what is left out is counted if it has a name."""
    if num_rows is None or len(items) <= num_rows:
        return list(items)
    note = [f"... and {len(items) - num_rows} more {what}."] if what else []
    return [*items[:num_rows], *note]


def _rows(moved: Sequence[Moved]) -> list[tuple[str, ...]]:
    groups: dict[tuple[str, ...], list[Moved]] = {}
    for entry in moved:
        key = entry.column, entry.band, entry.quantity, field_of(entry.entry)
        groups.setdefault(key, []).append(entry)
    rows = []
    for entries in groups.values():
        worst = max(entries, key=lambda entry: entry.excess)
        what = worst.entry if worst.quantity == "state" else worst.quantity
        if worst.entry and worst.quantity != "state":
            what = f"d {worst.quantity} / d {worst.entry}"
        numbers = f"{worst.stored:.10g}", f"{worst.now:.10g}"
        change = f"{worst.now - worst.stored:+.2e}", f"{worst.tolerance:.1e}"
        rows.append((worst.column, worst.band, what, *numbers, *change, str(len(entries))))
    return rows


def _line(row: Sequence[str], widths: Sequence[int]) -> str:
    """Names to the left, numbers to the right."""
    cells = [
        cell.ljust(width) if place < 3 else cell.rjust(width)
        for place, (cell, width) in enumerate(zip(row, widths, strict=True))
    ]
    return "  ".join(cells).rstrip()
