"""Layers that stay, solved once, against the whole column at once."""

import jax
import jax.numpy as jnp
import numpy as np
import plume_between_layers
import pytest
from columns import STANDARD, standard_columns
from surfaces import Bowl

from abi_operator.solver import surroundings, toa_brf

# Two ways through the same algebra.
SAME = 1e-12
SAME_IN_SINGLE = 2e-5
FIRST, LAST = 2, 4  # of the layers that change
STREAMS = {"num_streams": STANDARD["num_streams"]}
FEW = {"num_streams": 2}


def parts(columns, first=FIRST, last=LAST):
    """Layers that stay, and those that change."""
    stay = [np.delete(x, np.s_[first:last], axis=1) for x in columns[:3]]
    return stay, [x[:, first:last] for x in columns[:3]]


def around(columns, first=FIRST, last=LAST, **how):
    stay, _ = parts(columns, first, last)
    return surroundings(*stay, *columns[3:], num_above=first, **STREAMS | how)


def test_equals_the_whole_column():
    columns = standard_columns()
    _, changing = parts(columns)
    np.testing.assert_allclose(
        around(columns).brf(*changing), toa_brf(*columns, **STREAMS), rtol=SAME
    )


@pytest.mark.parametrize(("first", "last"), [(0, 2), (3, 5)], ids=["on top", "at the ground"])
def test_layers_need_not_lie_between(first, last):
    columns = standard_columns()
    _, changing = parts(columns, first, last)
    found = around(columns, first, last, **FEW).brf(*changing)
    np.testing.assert_allclose(found, toa_brf(*columns, **FEW), rtol=SAME)


def test_slopes_are_those_of_the_whole_column():
    """Forward and reverse, in every argument."""
    columns, rng = standard_columns(), np.random.default_rng(8)
    names = ("tau", "ssa", "moments", "secant", "phase_function")
    whole = dict(zip(names, columns[:3], strict=False))
    whole |= {name: rng.uniform(1.1, 3, columns[0].shape) for name in names[3:]}
    changing = {name: x[:, FIRST:LAST] for name, x in whole.items()}
    stay = {name: np.delete(x, np.s_[FIRST:LAST], axis=1) for name, x in whole.items()}
    given = dict(zip(("albedo", "mu0", "mu", "relative_azimuth"), columns[3:], strict=True))
    solved = surroundings(**stay, **given, num_above=FIRST, **STREAMS)
    found = jax.grad(lambda x: jnp.sum(solved.brf(**x)))(changing)
    of_all = jax.grad(lambda x: jnp.sum(toa_brf(**x, **given, **STREAMS)))(whole)
    for name in names:
        expected = np.asarray(of_all[name])[:, FIRST:LAST]
        scale = np.abs(of_all[name]).max()
        assert scale > 0
        np.testing.assert_allclose(found[name], expected, rtol=1e-9, atol=SAME * scale)
    along = {name: np.cos(np.arange(x.size)).reshape(x.shape) for name, x in changing.items()}
    _, forward = jax.jvp(lambda x: jnp.sum(solved.brf(**x)), (changing,), (along,))
    reverse = sum(jnp.vdot(found[name], along[name]) for name in names)
    np.testing.assert_allclose(forward, reverse, rtol=SAME)


def test_what_is_kept_does_not_grow_with_layers():
    """m (2 n^2 + 4 n + 4) numbers and nine more."""
    modes, nodes = STREAMS["num_streams"], STREAMS["num_streams"] // 2
    count = around(standard_columns()).numbers.shape[-1]
    assert count == modes * (2 * nodes**2 + 4 * nodes + 4) + 9


def test_over_any_ground_under_a_sun_of_its_own_in_each_layer():
    """A surface, secants, phase functions of one's own; no scaling; modes with what is scattered
    once."""
    columns = list(standard_columns())
    rng = np.random.default_rng(8)
    columns[3] = Bowl(jnp.asarray(rng.uniform(0.1, 0.6, 4)), jnp.asarray(rng.uniform(0, 0.8, 4)))
    own = {
        "secant": rng.uniform(1.1, 3, columns[0].shape),
        "phase_function": rng.uniform(0.2, 3, columns[0].shape),
    }
    stay, changing = ({k: x[:, some] for k, x in own.items()} for some in ([0, 1, 4], [2, 3]))
    _, layers = parts(columns)
    how = FEW | {"delta_m": False}
    found = around(columns, **stay, **how).brf(*layers, **changing)
    np.testing.assert_allclose(found, toa_brf(*columns, **own, **how), rtol=SAME)


@pytest.mark.slow
def test_single_scattering_may_be_left_to_the_streams():
    columns, how = standard_columns(), {"single_scattering": None, "num_modes": 3} | STREAMS
    _, changing = parts(columns)
    found = around(columns, **how).brf(*changing)
    np.testing.assert_allclose(found, toa_brf(*columns, **how), rtol=SAME)


@pytest.mark.slow
def test_any_number_of_layers_goes_between():
    """None but an empty one, and those of another column as well."""
    columns = standard_columns()
    stay, changing = parts(columns)
    solved = around(columns, **FEW)
    empty = [np.zeros_like(changing[0][:, :1]), *(x[:, :1] for x in changing[1:])]
    bare = toa_brf(*stay, *columns[3:], **FEW)
    np.testing.assert_allclose(solved.brf(*empty), bare, rtol=SAME)
    more = [np.concatenate([x, x[:, ::-1]], axis=1) for x in changing]
    both = [np.insert(s, [FIRST] * 4, m, axis=1) for s, m in zip(stay, more, strict=True)]
    expected = toa_brf(*both, *columns[3:], **FEW)
    np.testing.assert_allclose(solved.brf(*more), expected, rtol=SAME)


def test_inside_of_everything():
    columns = standard_columns()
    _, changing = parts(columns)
    solved = around(columns, **FEW)
    expected = solved.brf(*changing)
    inside = jax.jit(lambda solved, *x: solved.brf(*x))(solved, *changing)
    mapped = jax.vmap(lambda solved, *x: solved.brf(*x))(solved, *changing)
    np.testing.assert_allclose(inside, expected, rtol=SAME)
    np.testing.assert_allclose(mapped, expected, rtol=SAME)


def test_a_budget_is_one_of_the_whole_reflectance():
    columns, error_budget = standard_columns(), 1e-3
    _, changing = parts(columns)
    solved, whole = around(columns), toa_brf(*columns, **STREAMS)
    off = np.abs(solved.brf(*changing, error_budget=error_budget) - whole)
    off = off / np.maximum(whole, 0.01)
    assert 0 < off.max() < error_budget


def test_settings_are_those_of_what_stays():
    """Unless they are named again: doublings that do not suffice, and values unchecked."""
    columns = standard_columns()
    _, changing = parts(columns)
    how = {"num_doublings": 0, "check_values": False}
    solved = around(columns, **how, **FEW)
    thick = 1e2 * changing[0], *changing[1:]
    few = solved.brf(*thick)
    np.testing.assert_array_equal(few, solved.brf(*thick, **how))
    assert np.abs(few - solved.brf(*thick, num_doublings=8)).max() > 1e-5
    with pytest.raises(ValueError, match="tau"):
        solved.brf(-thick[0], *thick[1:], check_values=True)
    solved.brf(-thick[0], *thick[1:])


@pytest.mark.float32
def test_in_single_precision():
    columns = [np.asarray(x, np.float32) for x in standard_columns()]
    _, changing = parts(columns)
    solved = around(columns)
    found = solved.brf(*changing)
    assert solved.numbers.dtype == found.dtype == jnp.float32
    np.testing.assert_allclose(found, toa_brf(*columns, **STREAMS), rtol=SAME_IN_SINGLE)


def test_what_stays_has_no_derivative():
    columns = standard_columns()
    stay, changing = parts(columns)

    def of_albedo(albedo):
        solved = surroundings(*stay, albedo, *columns[4:], num_above=FIRST, **STREAMS)
        return jnp.sum(solved.brf(*changing))

    with pytest.raises(TypeError, match="no derivative in what stays"):
        jax.grad(of_albedo)(columns[3])


def test_what_is_wrong_is_named():
    columns = standard_columns()
    stay, changing = parts(columns)
    solved = around(columns)
    with pytest.raises(ValueError, match="num_above must be 0 to 3.*got 4"):
        surroundings(*stay, *columns[3:], num_above=4, **STREAMS)
    by_secant = {"secant": np.full(stay[0].shape, 1.5)}
    alike = [np.ones(1), np.ones(1), stay[2][:, :1]]  # for all layers
    with pytest.raises(ValueError, match="num_above must be 0 to 3.*got 4"):
        surroundings(*alike, *columns[3:], num_above=4, **by_secant, **STREAMS)
    with pytest.raises(ValueError, match="one view: multiple_views must be False"):
        surroundings(*stay, *columns[3:], num_above=2, multiple_views=True, **STREAMS)
    with pytest.raises(ValueError, match="albedo"):
        surroundings(*stay, columns[3] + 1, *columns[4:], num_above=2, **STREAMS)
    with pytest.raises(ValueError, match="ssa"):
        solved.brf(changing[0], changing[1] + 1, changing[2])


def test_a_plume_between_layers_is_found():
    """The example, and that what it fits is the column."""
    found, seen = plume_between_layers.study(num_streams=2)
    np.testing.assert_allclose(found, plume_between_layers.TRUTH, rtol=1e-4)
    whole = plume_between_layers.whole(plume_between_layers.TRUTH, num_streams=2)
    np.testing.assert_allclose(seen, whole, rtol=SAME)
