"""The off-switch of the operations of our own: without them the numbers are the same."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from columns import SMALL, simple_columns, small_columns
from heard import Heard
from states import column

from abi_operator import brf
from abi_operator.machine import chunks, plain_jax
from abi_operator.machine.chunks import map_chunks
from abi_operator.machine.listening import listening
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


def test_plain_jax_maps_columns():
    given = small_columns()
    solve = jax.vmap(with_gradient(lambda *x: toa_brf(*x, **SMALL)))
    expected = solve(*given)
    with plain_jax():
        close(jax.jit(solve)(*given), expected, MAPPED)
        none = [x[:0] for x in given]
        assert toa_brf(*none, num_streams=2).shape == (0,)


@pytest.mark.slow
def test_plain_jax_is_for_the_operator_too():
    """Whose bands then are solved without any of their rules, mapped over columns or of none."""
    state = column(num_layers=2)
    varied = (
        lambda s: s.albedo["C01"],
        lambda s: s.atmosphere.plumes["smoke"].extinction_550,
        lambda s: s.geometry.solar_zenith,
        lambda s: s.geometry.view_zenith,
    )

    def seen(*given):
        changed = eqx.tree_at(lambda s: [read(s) for read in varied], state, given)
        return brf(changed, ("C01", "C02"), num_streams=2, num_modes=1, num_doublings=2)

    solve = jax.vmap(with_gradient(seen))
    given = [np.array([0.9, 1.0, 1.1]) * np.asarray(read(state)) for read in varied]
    expected = solve(*given)
    with plain_jax():
        close(jax.jit(solve)(*given), expected, MAPPED)


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


def test_a_program_that_was_thrown_away_is_compiled_by_one_thread_again(monkeypatch):
    """Which is what a listener is told of, and others wait for."""
    monkeypatch.setattr(jax, "clear_caches", lambda: None)  # other tests' programs
    monkeypatch.setattr(chunks, "_compiled", set())
    call = lambda x: jnp.asarray(x[0]), "thrown away", [np.ones(9)], [True], (9,), (4,)
    before, after = Heard(), Heard()
    with listening(before):
        map_chunks(*call)
    with plain_jax():
        pass
    with listening(after):
        map_chunks(*call)
    assert before.compiled == after.compiled == [True, False]
