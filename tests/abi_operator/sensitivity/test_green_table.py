"""A table of green against what it is made of."""

import numpy as np
import pytest

from abi_operator.products import derived_green
from abi_operator.sensitivity import green_table
from abi_operator.sensitivity.green_table import CELL


def test_a_full_table_of_a_straight_line_is_that_line():
    centres = [CELL * (np.arange(5) + first + 0.5) for first in (0, 3, 10)]
    samples = np.meshgrid(*centres, indexing="ij")
    table = green_table(*samples, derived_green(*samples))
    rng = np.random.default_rng(0)
    points = [rng.uniform(x[0], x[-1], 50) for x in centres]
    np.testing.assert_allclose(table(*points), derived_green(*points), atol=1e-12)
    beyond = table(*(x + 1 for x in points))
    corner = derived_green(*(x[-1] for x in centres))
    np.testing.assert_allclose(beyond, corner, atol=1e-12)


def test_cells_without_samples_have_those_of_the_nearest():
    values = np.array([0.1, 0.3])
    table = green_table(values, values, values, np.array([0.2, 0.6]))
    assert table.samples.sum() == 2
    assert set(np.unique(table.green)) == {0.2, 0.6}
    np.testing.assert_allclose(table(values, values, values), [0.2, 0.6])


def test_samples_are_needed():
    nothing = np.full(3, np.nan)
    with pytest.raises(ValueError, match="none of them is finite"):
        green_table(nothing, nothing, nothing, nothing)
