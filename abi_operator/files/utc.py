"""Times as text."""

import re

import numpy as np

# NumPy takes 20071023 for a year, and years that nanoseconds cannot count for others that they can.
_DATE = re.compile(r"\d{4}-\d\d-\d\d")
_YEARS = 1678, 2261


def utc_time(text: str) -> np.datetime64:
    """Parse a time such as ``2007-10-23T18:00``; NaT where it is none, or beyond 1678 to 2261. [ns]

    Parameters
    ----------
    text
        A date and, after a T, a time, without a zone.
    """
    try:
        if _DATE.match(text) and _YEARS[0] <= int(text[:4]) <= _YEARS[1]:
            return np.datetime64(text, "ns")
    except ValueError:
        pass
    return np.datetime64("NaT", "ns")
