"""How properties are looked for: numbers that hypothesis draws, the same in every run."""

import numpy as np
from hypothesis import settings, strategies

# Nothing is kept on disk, and no example has a deadline: the first one compiles.
REPEATABLE = settings(derandomize=True, database=None, deadline=None, max_examples=20)


def among(low, high, *special):
    """A number of a range, or one of those at which formulas break."""
    between = strategies.floats(low, high, allow_nan=False)
    return strategies.one_of(strategies.sampled_from([low, high, *special]), between)


def powers(low, high, *special):
    """A power of ten, or a special number."""
    between = strategies.floats(low, high).map(lambda x: 10.0**x)
    return strategies.one_of(strategies.sampled_from([0.0, *special]), between)


def array(numbers, count):
    """So many of these, of which one program is compiled."""
    return strategies.lists(numbers, min_size=count, max_size=count).map(np.array)


def all_finite(tree):
    """Whether all numbers of a list of arrays are."""
    return all(np.isfinite(np.asarray(x)).all() for x in tree)
