"""The way into a program, with one that takes no time to compile."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.machine.door import enter
from abi_operator.machine.slopes import slopes_by_reverse_mode

OWN_AXES = (1, 0, 0)  # a row of each column, a number, an integer


class Waves:
    """Two results of a column: a sum over its row, and a sine."""

    def __init__(self):
        self.traced = []

    @property
    def own_axes(self):
        return OWN_AXES

    def known(self, leaves, what):
        return self

    def unknown(self, what):
        return self

    def own_result(self, leaves):
        number = jax.ShapeDtypeStruct((), leaves[0].dtype)
        return {"sum": number, "sine": number}

    def widths(self, leaves, what):
        return 4, 16

    def tile(self, leaves, what):
        return 8

    @property
    def need(self):
        return None

    @property
    def at_once(self):
        return None

    def value(self, leaves):
        self.traced.append("value")
        return of_tile(leaves)

    def value_and_slopes(self, leaves, wanted):
        self.traced.append(wanted)
        return slopes_by_reverse_mode(of_tile, leaves, wanted)


def of_tile(leaves):
    """Of arrays with the batch last."""
    rows, x, power = leaves
    return plain(jnp.moveaxis(rows, -1, 0), x, power)


def plain(rows, x, power):
    """Of arrays with the batch's axes first."""
    weighted = rows * x[..., None] ** power[..., None].astype(rows.dtype)
    return {"sum": jnp.sum(weighted, axis=-1), "sine": jnp.sin(rows[..., 0] * x)}


def through_the_door(rows, x, power):
    return enter(Waves(), [rows, x, power])


RNG = np.random.default_rng(0)
GIVEN = RNG.uniform(1, 2, (5, 3)), RNG.uniform(1, 2, 5), np.array([1, 2, 3, 1, 2])
ONE = tuple(jnp.asarray(x[0]) for x in GIVEN)


def total(function):
    return lambda *x: sum(jnp.sum(y**2) for y in jax.tree.leaves(function(*x)))


TRANSFORMED = {
    "value": (lambda f: f, GIVEN),
    "mapped": (lambda f: jax.vmap(f), GIVEN),
    "mapped in the middle": (lambda f: jax.vmap(f, in_axes=(1, None, None)), None),
    "gradient": (lambda f: jax.grad(total(f), argnums=(0, 1)), GIVEN),
    "forward": (lambda f: jax.jacfwd(f, argnums=(0, 1)), ONE),
    "reverse": (lambda f: jax.jacrev(f, argnums=(0, 1)), ONE),
    "mapped Jacobian": (lambda f: jax.vmap(jax.jacrev(f, argnums=1)), GIVEN),
    "Jacobian of the mapped": (lambda f: jax.jacfwd(jax.vmap(f), argnums=1), GIVEN),
    "Hessian": (lambda f: jax.hessian(total(f), argnums=(0, 1)), ONE),
    "mapped Hessian": (lambda f: jax.vmap(jax.hessian(total(f), argnums=1)), GIVEN),
    "constants": (lambda f: jax.jacfwd(lambda t: f(*GIVEN)["sum"] * t), (2.0,)),
    "forward of a batch": (
        lambda f: lambda r, x, n: jax.jvp(lambda r: f(r, x, n), (r,), (r,)),
        GIVEN,
    ),
    "in what columns share": (
        lambda f: jax.grad(total(f), argnums=(0, 1)),
        (GIVEN[0], ONE[1], GIVEN[2]),
    ),
    "in what rows of columns share": (
        lambda f: jax.grad(total(f), argnums=(0, 1)),
        (GIVEN[0], GIVEN[1][:4, None], GIVEN[2]),
    ),
}


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("name", TRANSFORMED)
def test_every_transformation_is_that_of_the_function(name, compiled):
    transform = TRANSFORMED[name][0](through_the_door)
    found = (jax.jit(transform) if compiled else transform)(*arguments_of(name))
    for a, b in zip(*map(jax.tree.leaves, (found, expected(name))), strict=True):
        assert a.shape == b.shape
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-14)


def arguments_of(name):
    several = np.moveaxis(np.stack([GIVEN[0], 2 * GIVEN[0]]), 0, 1), *GIVEN[1:]
    return TRANSFORMED[name][1] or several


@cache
def expected(name):
    """What JAX itself makes of the function."""
    return jax.jit(TRANSFORMED[name][0](plain_of_arrays))(*arguments_of(name))


def plain_of_arrays(*given):
    return plain(*(jnp.asarray(x) for x in given))


def test_a_program_is_traced_once_whatever_is_around_it():
    program = Waves()

    def slopes(rows, x, power):
        return jax.vmap(jax.grad(lambda x: enter(program, [rows, x, power])["sum"].sum()))(x)

    def loop(rows, x, power):
        return jax.lax.fori_loop(0, 3, lambda _, y: y + 1e-3 * slopes(rows, y, power), x)

    jax.jit(lambda *given: loop(given[0][0], *given[1:]))(GIVEN[0], GIVEN[1], GIVEN[2][0])
    assert program.traced == [(False, True, False)]


def test_what_is_traced_has_a_name_and_shapes():
    (equation,) = jax.make_jaxpr(jax.vmap(through_the_door))(*GIVEN).eqns
    assert equation.primitive.name == "columns"
    assert [x.aval.shape for x in equation.outvars] == [(5,), (5,)]


class Read(Waves):
    """The same, of which another program tells something before slopes are found."""

    def known(self, leaves, what):
        if what != "value":
            assert np.isfinite(np.asarray(enter(Waves(), leaves)["sum"])).all()
        return self


@pytest.mark.parametrize("device", ["cpu", "gpu"])
def test_columns_with_values_are_read_where_others_are_traced(device, monkeypatch):
    """The derivative at a point that is known, of a change that is not, and the value there."""
    monkeypatch.setattr(jax, "default_backend", lambda: device)
    rows, x, power = (jnp.asarray(y)[:, None] for y in GIVEN)

    def function(rows):
        return enter(Read(), [rows, x, power])

    moved = jax.jit(lambda change: jax.jvp(function, (rows,), (change,)))(2 * rows)
    expected = jax.jvp(lambda rows: plain(rows, x, power), (rows,), (2 * rows,))
    for a, b in zip(*map(jax.tree.leaves, (moved, expected)), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12)


SHARED, MINE = jax.sharding.PartitionSpec(), jax.sharding.PartitionSpec("device")
ROWS, X, POWER = (jnp.asarray(y) for y in GIVEN)


def sums(rows, x):
    return through_the_door(rows, x, POWER)["sum"]


def all_in_all(rows, x):
    return jax.lax.psum(jnp.sum(sums(rows, x) ** 2), "device")


def along(change, x):
    """At a point that does not vary from one device to the next."""
    return jax.jvp(lambda rows: jnp.sum(sums(rows, X)), (ROWS,), (change,))[1]


def on_devices(function, of_rows, of_x, check_vma):
    mesh = jax.sharding.Mesh(np.asarray(jax.local_devices()[:1]), ("device",))
    how = {"mesh": mesh, "in_specs": (of_rows, of_x), "out_specs": SHARED}
    return jax.shard_map(function, check_vma=check_vma, **how)


CHECKED = {
    "value": on_devices(all_in_all, MINE, SHARED, True),
    "compiled": jax.jit(on_devices(all_in_all, SHARED, MINE, True)),
    "gradient": jax.grad(on_devices(all_in_all, MINE, SHARED, True), 1),
    "passed as shared": on_devices(sums, MINE, MINE, True),
    "change": on_devices(along, MINE, SHARED, True),
}


@pytest.mark.parametrize("name", CHECKED)
def test_columns_that_differ_by_device_are_refused_where_that_is_checked(name):
    with pytest.raises(ValueError, match=r"check_vma=True .* vary over \['device'\]"):
        CHECKED[name](ROWS, X)


def test_columns_on_devices_are_solved_where_nothing_is_checked_or_differs():
    gradient = jax.grad(lambda x: jnp.sum(plain(ROWS, x, POWER)["sum"] ** 2))(X)
    found = jax.grad(on_devices(all_in_all, MINE, MINE, False), 1)(ROWS, X)
    np.testing.assert_allclose(found, gradient, rtol=1e-12)
    found = on_devices(sums, SHARED, SHARED, True)(ROWS, X)
    np.testing.assert_allclose(found, plain(ROWS, X, POWER)["sum"], rtol=1e-12)
