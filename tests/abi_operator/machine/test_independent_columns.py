"""One gradient behind every derivative of columns: against JAX's own, on a program of a few lines.

It goes through the door as the solver does, which itself is here at few streams; the rest of its
derivatives is in `test_gradients`.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from columns import SMALL, small_columns
from jaxtyping import Array

from abi_operator.machine.door import enter
from abi_operator.machine.slopes import chosen, slopes_by_copies, slopes_by_reverse_mode
from abi_operator.solver import toa_brf, toa_radiance

COUNT, TILE = 10, 4
# The same operations, summed in another order.
ROUNDING, REAL_ROUNDING = 1e-13, 1e-11
BOTH_MODES = 1e-14  # a hundred products, the very same in both


class Ground(eqx.Module):
    albedo: Array
    kind: str = eqx.field(static=True, default="grey")


def program(columns):
    """Two results, of two entries and of one, and an integer that has no derivative."""
    absorbed = jnp.sin(columns["tau"]) * columns["ground"].albedo
    below = jnp.sum(np.arange(1.0, 4.0)[:, None] * absorbed, axis=0)
    first = jnp.stack([below**2, jnp.sum(absorbed**3, axis=0)])
    power = columns["power"].astype(below.dtype)
    return first * jnp.exp(columns["ground"].albedo), below**power


def gradient(columns):
    """What may be written by hand."""
    fixed = {"power": columns["power"], "missing": None}
    floating = {k: columns[k] for k in ("tau", "ground")}
    result = program(columns)

    def column(one, power):
        pick = jax.tree.map(lambda x: x[..., None], one) | {"power": power[None]}
        return jnp.concatenate([x.ravel() for x in program(pick)])

    slopes = jax.vmap(jax.jacrev(column), in_axes=-1, out_axes=-1)(floating, fixed["power"])
    return result, {**slopes, **fixed}


class Program(NamedTuple):
    """A `machine.program.Program` of what is written for a tile of columns."""

    of_columns: Callable
    gradient: Callable | None
    structure: Any
    own_axes: tuple[int, ...]

    def known(self, leaves, what):
        return self

    def unknown(self, what):
        return self

    def own_result(self, leaves):
        dtype = leaves[0].dtype
        return jax.ShapeDtypeStruct((2,), dtype), jax.ShapeDtypeStruct((), dtype)

    def widths(self, leaves, what):
        return TILE, 2 * TILE

    def tile(self, leaves, what):
        return TILE

    @property
    def need(self):
        return None

    @property
    def at_once(self):
        return None

    def value(self, leaves):
        return self.of_columns(jax.tree.unflatten(self.structure, leaves))

    def value_and_slopes(self, leaves, wanted):
        if self.gradient is None:
            return slopes_by_reverse_mode(self.value, leaves, wanted)
        result, slopes = self.gradient(jax.tree.unflatten(self.structure, leaves))
        return result, chosen(self.structure.flatten_up_to(slopes), wanted)


def through_the_door(of_columns, gradient=None):
    """Of columns with their batch last, as what is behind the door."""

    def solve(columns):
        leaves, structure = jax.tree.flatten(columns)
        own_axes = tuple(x.ndim - 1 for x in leaves)
        first = [jnp.moveaxis(x, -1, 0) for x in leaves]
        found = enter(Program(of_columns, gradient, structure, own_axes), first)
        return jax.tree.map(lambda x: jnp.moveaxis(x, 0, -1), found)

    return solve


def columns(count=COUNT, seed=0):
    rng = np.random.default_rng(seed)
    tau, albedo = rng.uniform(0.5, 2, (3, count)), rng.uniform(0.5, 1, count)
    return {"tau": jnp.asarray(tau), "ground": Ground(jnp.asarray(albedo))}


def function(solve):
    """Of the floating leaves alone; of one column without batch axis where they have none."""

    def of_floating(floating):
        batch = floating["ground"].albedo.shape
        whole = floating if batch else jax.tree.map(lambda x: x[..., None], floating)
        count = whole["ground"].albedo.size
        powers = jnp.arange(count) % 3 + 1 if batch else jnp.asarray([2])
        found = solve({**whole, "power": powers, "missing": None})
        return found if batch else jax.tree.map(lambda x: x[..., 0], found)

    return of_floating


BY_REVERSE = function(through_the_door(program))
BY_HAND = function(through_the_door(program, gradient))
PLAIN = function(program)


def total(f):
    return lambda x: sum(jnp.sum(y) for y in jax.tree.leaves(f(x)))


def batch_first(x):
    return jax.tree.map(lambda leaf: jnp.moveaxis(leaf, -1, 0), x)


def close(found, expected, rtol=ROUNDING):
    for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(a, b, rtol=rtol, atol=rtol * np.abs(b).max())


def forward(f):
    return lambda x: jax.jvp(f, (x,), (columns(len(x["ground"].albedo), seed=1),))


def backward(f):
    return lambda x: jax.vjp(f, x)[1](jax.tree.map(jnp.cos, PLAIN(x)))


@pytest.mark.parametrize("f", [BY_REVERSE, BY_HAND], ids=["default", "given gradient"])
@pytest.mark.parametrize("transform", [lambda f: f, forward, backward, jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize(("count", "compiled"), [(3, False), (COUNT, True)])
def test_first_derivatives_are_those_of_the_plain_program(f, compiled, transform, count):
    """In one tile, and in three of which the last is not full."""
    found = jax.jit(transform(f)) if compiled else transform(f)
    close(found(columns(count)), plain(transform, count))


@cache
def plain(transform, count):
    """What the plain program gives: the same for each way to a gradient."""
    return jax.jit(transform(PLAIN))(columns(count))


@pytest.mark.parametrize(
    ("f", "outer", "inner"),
    [
        (BY_REVERSE, jax.jacfwd, jax.jacfwd),
        (BY_REVERSE, jax.jacrev, jax.jacrev),
        (BY_HAND, jax.jacfwd, jax.jacrev),
        (BY_HAND, jax.jacrev, jax.jacfwd),
        pytest.param(BY_REVERSE, jax.jacfwd, jax.jacrev, marks=pytest.mark.slow),
        pytest.param(BY_REVERSE, jax.jacrev, jax.jacfwd, marks=pytest.mark.slow),
        pytest.param(BY_HAND, jax.jacfwd, jax.jacfwd, marks=pytest.mark.slow),
        pytest.param(BY_HAND, jax.jacrev, jax.jacrev, marks=pytest.mark.slow),
    ],
)
def test_second_derivatives_are_those_of_the_plain_program(f, outer, inner):
    """By reverse mode or with a given gradient."""
    found = jax.jit(outer(inner(f)))(columns())
    close(found, plain_twice(outer, inner))


@cache
def plain_twice(outer, inner):
    return jax.jit(outer(inner(PLAIN)))(columns())


MAPPED = {
    "vmap": jax.vmap,
    "vmap of grad": lambda f: jax.vmap(jax.grad(total(f))),
    "grad of vmap": lambda f: jax.grad(total(jax.vmap(f))),
    "vmap of jacfwd": lambda f: jax.vmap(jax.jacfwd(f)),
    "vmap of jacrev": lambda f: jax.vmap(jax.jacrev(f)),
    "jacfwd of vmap": lambda f: jax.jacfwd(jax.vmap(f)),
    "jacrev of vmap": lambda f: jax.jacrev(jax.vmap(f)),
    "vmap of jvp": lambda f: jax.vmap(lambda x: jax.jvp(f, (x,), (jax.tree.map(jnp.cos, x),))),
    "vmap of hessian": lambda f: jax.vmap(jax.hessian(f)),
    "hessian of vmap": lambda f: jax.hessian(total(jax.vmap(f))),
    "vmap of jacrev of jacrev": lambda f: jax.vmap(jax.jacrev(jax.jacrev(f))),
}


# With a gradient given by hand the rule of mapping is the same; all of these are behind `slow`.
GIVEN = "vmap of jacrev", "vmap of jvp", "hessian of vmap"


@pytest.mark.parametrize(
    ("f", "name"),
    [
        *((BY_REVERSE, name) for name in MAPPED),
        *((BY_HAND, name) for name in GIVEN),
        *(pytest.param(BY_HAND, x, marks=pytest.mark.slow) for x in MAPPED if x not in GIVEN),
    ],
)
def test_one_column_mapped(f, name):
    given = batch_first(columns())
    close(jax.jit(MAPPED[name](f))(given), plain_mapped(name))


@cache
def plain_mapped(name):
    return jax.jit(MAPPED[name](PLAIN))(batch_first(columns()))


def descend(f):
    """Some steps downhill, more of them for some columns than for others."""

    def advance(carry):
        x, count = carry
        return jax.tree.map(lambda a, b: a - 0.01 * b, x, jax.grad(total(f))(x)), count + 1

    def solve(x):
        limit = 3 + 4 * x["ground"].albedo
        return jax.lax.while_loop(lambda carry: carry[1] < limit, advance, (x, 0))[0]

    return solve


def descend_in_a_scan(f):
    def advance(x, _):
        return jax.tree.map(lambda a, b: a - 0.01 * b, x, jax.grad(total(f))(x)), None

    return lambda x: jax.lax.scan(advance, x, None, length=3)[0]


@pytest.mark.parametrize("loop", [descend, descend_in_a_scan])
def test_mapped_in_a_loop(loop):
    given = batch_first(columns())
    close(jax.jit(jax.vmap(loop(BY_REVERSE)))(given), jax.jit(jax.vmap(loop(PLAIN)))(given))


def test_a_loop_of_gradients_has_a_derivative():
    given = batch_first(columns())
    slopes = [
        jax.jit(jax.grad(total(jax.vmap(descend_in_a_scan(f)))))(given) for f in (BY_REVERSE, PLAIN)
    ]
    close(*slopes)


def test_mapped_twice_and_a_batch_mapped_in_some_leaves():
    twice = jax.tree.map(lambda x: x.reshape(2, 5, *x.shape[1:]), batch_first(columns()))
    found, expected = (jax.jit(jax.vmap(jax.vmap(f)))(twice) for f in (BY_REVERSE, PLAIN))
    close(found, expected)
    given = columns()
    several = {"tau": jnp.stack([given["tau"], 2 * given["tau"]]), "ground": given["ground"]}
    axes = ({"tau": 0, "ground": None},)
    for transform in (lambda f: f, jax.jacfwd, jax.jacrev):
        found, expected = (
            jax.jit(jax.vmap(transform(f), in_axes=axes))(several) for f in (BY_REVERSE, PLAIN)
        )
        close(found, expected)


def test_both_modes_take_the_same_gradient():
    x, tangent = columns(), columns(seed=1)
    result, slope = jax.jit(lambda x, t: jax.jvp(BY_REVERSE, (x,), (t,)))(x, tangent)
    cotangent = jax.tree.map(np.cos, result)
    pulled = jax.jit(lambda x, c: jax.vjp(BY_REVERSE, x)[1](c)[0])(x, cotangent)

    def product(a, b):
        pairs = zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True)
        return sum(jnp.sum(u * v) for u, v in pairs)

    np.testing.assert_allclose(product(slope, cotangent), product(pulled, tangent), rtol=BOTH_MODES)
    close(jax.jacfwd(BY_REVERSE)(x), jax.jacrev(BY_REVERSE)(x), rtol=0)


@pytest.mark.parametrize("mapped", [False, True])
@pytest.mark.parametrize("jacobian", [jax.jacfwd, jax.jacrev])
def test_a_jacobian_computes_the_gradient_once(jacobian, mapped):
    """Many tangents of few columns: the program runs at the size of the columns, not of both."""
    sizes = []

    def watched(tile):
        sizes.append(tile["tau"].size)
        return program(tile)

    f = function(through_the_door(watched))
    given = batch_first(columns()) if mapped else columns()
    jax.jit(jax.vmap(jacobian(f)) if mapped else jacobian(f)).lower(given)
    assert sizes == [TILE * columns()["tau"].shape[0]]


def test_what_is_not_perturbed_is_not_differentiated():
    """The sine needs its cosine only where the optical depth is perturbed."""
    given = columns()

    def of_ground(albedo):
        return BY_REVERSE({**given, "ground": Ground(albedo)})

    def of_tau(tau):
        return BY_REVERSE({**given, "tau": tau})

    assert "cosine" in jax.jit(jax.jacfwd(of_tau)).lower(given["tau"]).as_text()
    for jacobian in (jax.jacfwd, jax.jacrev):
        text = jax.jit(jacobian(of_ground)).lower(given["ground"].albedo).as_text()
        assert "cosine" not in text


def test_a_copy_for_each_row_gives_the_same_slopes():
    """Where a row can be made of its own copy, all slopes come of one pull."""
    a, b = (jnp.asarray(x) for x in np.random.default_rng(3).uniform(1, 2, (2, 3, COUNT)))

    def rows(leaves):
        a, b = leaves
        return jnp.stack([jnp.sum(a * b, axis=0), jnp.sum(a**2 * b, axis=0)])

    def of_copies(leaves):
        (first, second), b = leaves
        return jnp.stack([rows([first, b])[0], rows([second, b])[1]])

    found = slopes_by_copies(of_copies, [a, b], [True, False], 2)
    close(found, slopes_by_reverse_mode(rows, [a, b], [True, False]))


def test_integers_take_their_empty_tangents():
    given, tangent = columns(), columns(seed=1)
    solve = through_the_door(program)
    power = jnp.arange(COUNT) % 3 + 1
    none = np.zeros(COUNT, jax.dtypes.float0)
    whole = {**given, "power": power, "missing": None}
    found = jax.jvp(solve, (whole,), ({**tangent, "power": none, "missing": None},))
    close(found, jax.jvp(PLAIN, (given,), (tangent,)))
    still = jax.tree.map(jnp.zeros_like, tangent)
    slopes = jax.jvp(solve, (whole,), ({**still, "power": none, "missing": None},))[1]
    close(slopes, jax.tree.map(jnp.zeros_like, slopes))


def solver_columns(count):
    return [jnp.asarray(x) for x in small_columns(count)]


@pytest.mark.slow  # `test_gradients` maps the solver's Jacobians
@pytest.mark.parametrize("several", [False, True])
def test_solver_mapped_is_the_batch_in_value_and_gradient(several):
    """With one view and with two: compiled as a whole of more columns than a tile has, and as the
    batch in chunks.
    """
    given = solver_columns(100)
    if several:
        given[5:] = [jnp.stack([x, x / 2], axis=1) for x in given[5:]]

    def total(*arguments):
        values = toa_brf(*arguments, multiple_views=several, **SMALL)
        return jnp.sum(values), values

    both = jax.grad(total, argnums=tuple(range(len(given))), has_aux=True)
    mapped, values = jax.jit(jax.vmap(both))(*given)
    batch, expected = both(*given)
    np.testing.assert_allclose(values, expected, rtol=ROUNDING)
    close(mapped, batch, rtol=REAL_ROUNDING)


@pytest.mark.slow
def test_slopes_choose_their_doublings():
    """From the thickest layer, where columns can be read: as with a number that suffices."""
    given = solver_columns(3)
    options = {name: x for name, x in SMALL.items() if name != "num_doublings"}
    slopes = [
        jax.grad(
            lambda *x, n=number: jnp.sum(toa_brf(*x, num_doublings=n, **options)), tuple(range(7))
        )(*given)
        for number in (None, 14)
    ]
    close(*slopes, rtol=REAL_ROUNDING)


@pytest.mark.slow
def test_sunlight_and_emission_together():
    given = solver_columns(3)
    rng = np.random.default_rng(4)
    sources = [jnp.asarray(rng.uniform(1, 2, shape)) for shape in (3, (3, 3), 3)]

    def radiance(irradiance, planck, emitted):
        value = toa_radiance(
            *given, solar_irradiance=irradiance, planck_levels=planck, surface_emission=emitted,
            **SMALL,
        )  # fmt: skip
        return value, value

    (ahead, value), (back, _) = (
        jacobian(radiance, argnums=(0, 1, 2), has_aux=True)(*sources)
        for jacobian in (jax.jacfwd, jax.jacrev)
    )
    close(ahead, back, rtol=BOTH_MODES)
    # Linear in the sources: Euler's theorem.
    sums = [
        np.sum(np.asarray(slope) * np.asarray(x), axis=tuple(range(1, slope.ndim)))
        for slope, x in zip(ahead, sources, strict=True)
    ]
    np.testing.assert_allclose(sum(sums), value, rtol=REAL_ROUNDING)
