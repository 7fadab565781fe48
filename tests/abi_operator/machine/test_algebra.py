"""Products of small matrices, whatever operations they come in."""

import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.machine.algebra import product, product_alone

ROWS, COLUMNS, BATCH = 3, 2, 5
EPS = {np.float64: 1e-15, np.float32: 1e-6}


@pytest.mark.parametrize("dtype", EPS)
@pytest.mark.parametrize("batch", [BATCH, 1])
@pytest.mark.parametrize("multiply", [product, product_alone])
def test_products_are_those_of_numpy(multiply, batch, dtype):
    """Of sums of all lengths that are written out, and one more; all columns may share a factor."""
    rng = np.random.default_rng(3)
    for inner in range(1, 18):
        a = rng.uniform(-1, 1, (ROWS, inner, BATCH)).astype(dtype)
        b = rng.uniform(-1, 1, (inner, COLUMNS, batch)).astype(dtype)
        exact = np.einsum("ikn,kjn->ijn", a, b * np.ones(BATCH), dtype=np.float64)
        found = multiply(jnp.asarray(a), jnp.asarray(b))
        assert found.dtype == dtype
        np.testing.assert_allclose(found, exact, rtol=0, atol=inner * EPS[dtype])
