"""Products of small matrices and sums over their entries, whatever operations they come in."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.machine.algebra import Entry, product, product_alone
from abi_operator.machine.rows import are_few, in_rows

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


@pytest.mark.parametrize("batch", [(), (BATCH,), (64,)])
def test_entries_are_the_same_in_long_rows_and_in_their_own(batch):
    """Of one column, of few and of many; with numbers of a column and of all, with rows that all
    share, with an entry of a stack, and with None."""

    @in_rows
    def function(numbers, x, y, z):
        height, factor = numbers
        moved = x - height * y
        return moved if z is None else moved + z, factor * moved

    rng = np.random.default_rng(4)
    border, diagonal, ratio, height = (
        jnp.asarray(rng.uniform(-1, 1, (*own, *batch))) for own in [(3, 2), (2,), (2,), ()]
    )
    stack = Entry(jnp.stack([0 * border.ravel(), border.ravel()]), jnp.array(1), border.shape)
    assert are_few(border) == (batch != (64,))
    given = [stack, diagonal], [ratio, ratio]
    for more in (None, [border, diagonal]):
        found = function((height, 2.0), *given, more)
        expected = [x - height * ratio for x in (border, diagonal)]
        plus = [0, 0] if more is None else more
        for (first, second), x, z in zip(found, expected, plus, strict=True):
            np.testing.assert_allclose(first, x + z, rtol=0, atol=1e-15)
            np.testing.assert_allclose(second, 2 * x, rtol=0, atol=1e-15)

    def total(height):
        return sum(x.sum() for x, _ in function((height, 2.0), *given, None))

    slope = -sum((0 * x + ratio).reshape(-1, *batch).sum(axis=0) for x in (border, diagonal))
    np.testing.assert_allclose(jax.grad(total)(height), slope, rtol=0, atol=1e-14)
