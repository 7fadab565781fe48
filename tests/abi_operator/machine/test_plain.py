"""The off-switch of the operations of our own: without them the numbers are the same."""

from functools import cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from columns import SMALL, simple_columns, small_columns
from states import column

from abi_operator import brf
from abi_operator.machine import plain_jax
from abi_operator.machine.plain import is_plain
from abi_operator.solver import toa_brf

ROUNDING = 1e-13  # of the same operations, compiled in other pieces
MAPPED = 1e-11  # with the axis that is mapped first, where it is the last otherwise
OURS = "columns", "one_kernel", "slopes_times_tangents"


def with_gradient(function):
    def total(*arguments):
        values = function(*arguments)
        return jnp.sum(values), values

    return lambda *given: jax.grad(total, tuple(range(len(given))), has_aux=True)(*given)


def close(found, expected, rtol=ROUNDING):
    for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(a, b, rtol=rtol, atol=rtol * np.max(np.abs(b)))


def operations_of_ours(function, given):
    """Which are in a program, in the words of `jax.make_jaxpr`."""
    text = str(jax.make_jaxpr(function)(*given))
    return [name for name in OURS if f" {name}[" in text]


@pytest.mark.slow
@pytest.mark.parametrize("num_streams", [4, 8])
def test_plain_jax_gives_the_same_value_and_gradient(num_streams):
    given = simple_columns(count=3, num_layers=3, num_moments=num_streams + 2)
    how = {"num_streams": num_streams, "num_doublings": 6}
    solve = with_gradient(lambda *x: toa_brf(*x, **how))
    expected, value = solve(*given), toa_brf(*given, num_streams=num_streams)
    assert operations_of_ours(solve, given)
    with plain_jax():
        close(solve(*given), expected)
        close(toa_brf(*given, num_streams=num_streams), value)
        assert operations_of_ours(solve, given) == []
    assert operations_of_ours(solve, given)


mapped = jax.vmap(with_gradient(lambda *x: toa_brf(*x, **SMALL)))


def of_the_operator():
    """Two bands' slopes in the ground of one, and their values."""
    state = column(num_layers=2)

    def seen(albedo):
        changed = eqx.tree_at(lambda s: s.albedo["C01"], state, albedo)
        return brf(changed, ("C01", "C02"), num_streams=2, num_modes=1, num_doublings=2)

    return with_gradient(seen)(0.2)


@cache
def by_plain_jax():
    """What the tests below ask, in one block: JAX forgets what it has compiled at its ends."""
    given = small_columns()
    with plain_jax():
        none = toa_brf(*(x[:0] for x in given), num_streams=2)
        return jax.jit(mapped)(*given), none, of_the_operator()


def test_plain_jax_maps_columns_and_takes_none():
    found, none, _ = by_plain_jax()
    close(found, mapped(*small_columns()), MAPPED)
    assert none.shape == (0,)


def test_plain_jax_is_for_the_operator_too():
    """Whose bands then are solved without any of their rules."""
    *_, found = by_plain_jax()
    close(found, of_the_operator())


def test_the_switch_is_on_again_after_the_last_block_and_after_trouble(monkeypatch):
    """And what JAX has compiled is forgotten at the ends of the outermost block alone."""
    forgotten = []
    monkeypatch.setattr(jax, "clear_caches", lambda: forgotten.append(is_plain()))
    with plain_jax():
        with pytest.raises(ZeroDivisionError), plain_jax():
            assert 1 // 0
        assert is_plain()
    assert not is_plain()
    assert forgotten == [True, False]
