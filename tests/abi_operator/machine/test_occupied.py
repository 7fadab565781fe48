"""Rows that nothing is in are not computed; others have the values and slopes of all at once."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.machine import plain_jax
from abi_operator.machine.occupied import if_present, row_by_row

ROWS, COLUMNS = 5, 3
# Of one and of the other thing, in which rows of which columns.
THERE = np.zeros((2, ROWS, COLUMNS), bool)
THERE[0, 1, 2] = THERE[0, 4, :] = THERE[1, 4, 0] = True


def numbers(seed=0):
    rng = np.random.default_rng(seed)
    amounts = jnp.asarray(np.where(THERE, rng.uniform(0.5, 1, THERE.shape), 0))
    return amounts, jnp.asarray(rng.uniform(0.5, 2, (ROWS, COLUMNS))), jnp.asarray(0.3)


def mixed(amounts, row, shared, there=THERE):
    """What each row has everywhere, and of each thing where it is."""

    def of_rows(rows, present):
        own, first, second = rows
        found = shared * own
        for there, amount in zip(present, (first, second), strict=True):
            found = found + if_present(there, lambda x: x * jnp.exp(shared * own + x), amount)
        return found

    return row_by_row(of_rows, (row, *amounts), [jnp.asarray(x) for x in there])


def at_once(*given):
    with plain_jax():
        return mixed(*given)


def test_values_and_slopes_are_those_of_all_rows_at_once():
    given = numbers()
    np.testing.assert_allclose(mixed(*given), at_once(*given), rtol=1e-15)
    some = 1.0 * THERE.any(axis=2, keepdims=True)  # elsewhere nobody asks for slopes of nothing
    for transform in (jax.jacrev, jax.jacfwd):
        found, right = (transform(f, argnums=(0, 1, 2))(*given) for f in (mixed, at_once))
        np.testing.assert_allclose(found[0], right[0] * some, rtol=1e-14)
        for x, y in zip(found[1:], right[1:], strict=True):
            np.testing.assert_allclose(x, y, rtol=1e-14)


def test_second_derivatives():
    given = numbers()
    found, right = (
        jax.hessian(lambda x, f=f: jnp.sum(f(*given[:2], x)))(given[2]) for f in (mixed, at_once)
    )
    assert right != 0
    np.testing.assert_allclose(found, right, rtol=1e-14)


def undefined(there):
    """No number wherever it is computed."""

    def of_rows(rows, present):
        return if_present(present[0], lambda x: x * jnp.nan, rows)

    return row_by_row(of_rows, jnp.ones(there.shape), [there])


def test_empty_rows_are_not_computed():
    there = jnp.asarray(THERE[0])
    computed = np.isnan(np.asarray(undefined(there)))
    np.testing.assert_array_equal(computed, THERE[0].any(axis=1)[:, None].repeat(COLUMNS, axis=1))
    assert np.isnan(np.asarray(jax.jit(undefined)(there))).sum() == computed.sum()


@pytest.mark.parametrize("axis", [0, -1])
def test_columns_that_are_mapped_over_are_one_batch(axis):
    """They branch together, and not by choosing of two results."""
    mapped = jax.vmap(undefined, in_axes=axis, out_axes=axis)
    there = jnp.moveaxis(jnp.asarray(THERE[0]), -1, axis)
    found = jnp.moveaxis(mapped(there), axis, -1)
    np.testing.assert_array_equal(found, undefined(jnp.asarray(THERE[0])))
    assert " cond[" in str(jax.make_jaxpr(mapped)(there))


def test_what_is_everywhere_is_computed_everywhere():
    def of_rows(rows, present):
        assert present == [None]
        return if_present(present[0], jnp.exp, rows)

    np.testing.assert_allclose(row_by_row(of_rows, jnp.ones(ROWS), [None]), np.e, rtol=1e-15)
