"""Chunks give what a whole would."""

import jax
import numpy as np
import pytest

from retrievals.chunks import map_chunks, meanwhile


@pytest.mark.parametrize("num_pixels", [1, 7, 8, 9, 37])
def test_chunks_and_their_padding_are_invisible(num_pixels):
    x = np.linspace(0, 1, num_pixels)
    table = {"a": x, "b": np.stack([x, 2 * x], axis=1)}
    function = jax.jit(lambda t, y: {"sum": t["b"].sum(axis=1) + y, "a": t["a"]})
    result = map_chunks(function, table, x, chunk=8)
    np.testing.assert_allclose(result["sum"], 4 * x, rtol=1e-15)
    np.testing.assert_array_equal(result["a"], x)


def test_workers_keep_the_precision_of_the_caller():
    with jax.enable_x64(True):
        result = map_chunks(jax.jit(lambda x: x * 2), np.arange(40.0), chunk=4)
    assert result.dtype == np.float64
    with jax.enable_x64(False):
        result = map_chunks(jax.jit(lambda x: x * 2), np.arange(40.0), chunk=4)
    assert result.dtype == np.float32


def test_what_runs_meanwhile_has_run_and_its_trouble_is_ours():
    found = []
    with jax.enable_x64(True), meanwhile(lambda: found.append(jax.numpy.arange(2.0).dtype)):
        pass
    assert found == [np.float64]
    with pytest.raises(ZeroDivisionError), meanwhile(lambda: 1 // 0):
        pass
