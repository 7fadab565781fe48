"""Columns in chunks of one size."""

import numpy as np
import pytest

from abi_operator.scene.chunks import map_chunks


@pytest.mark.parametrize("num_columns", [1, 3, 4, 5, 9])
def test_chunks_have_one_size_and_results_the_right_one(num_columns):
    columns = {"a": np.arange(num_columns), "b": 2.0 * np.arange(2 * num_columns).reshape(-1, 2)}
    sizes = []

    def function(chunk):
        sizes.append({len(values) for values in chunk.values()})
        return {"sum": chunk["a"] + chunk["b"].sum(axis=1)}

    result = map_chunks(function, columns, num_columns, 4)
    np.testing.assert_array_equal(result["sum"], columns["a"] + columns["b"].sum(axis=1))
    assert sizes == [{4}] * (-(-num_columns // 4))
