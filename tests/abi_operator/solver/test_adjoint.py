"""The written-out derivative of the modes against forward mode through their plain program."""

from functools import cache, partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from surfaces import Bowl
from tiles import value_and_slopes_by_forward_mode

from abi_operator.machine.algebra import Rows
from abi_operator.solver import toa_brf
from abi_operator.solver.gradient.layer import climb
from abi_operator.solver.gradient.mode_sum import (
    How,
    ModeSum,
    mode_sum,
    reflectance_and_gradient,
)
from abi_operator.solver.gradient.room import Keeper
from abi_operator.solver.method.adding import emitting_ground
from abi_operator.solver.method.azimuth import (
    Directions,
    emitting_mean,
    higher_modes,
    legendre_tables,
    weighted_moments,
)
from abi_operator.solver.method.bordered import Bordered
from abi_operator.solver.method.delta_m import ScaledLayers
from abi_operator.solver.method.doublings import Doublings, layer_doublings
from abi_operator.solver.method.ground import isotropic, lambertian, reflecting
from abi_operator.solver.skipping.plan import LayersOfModes

# Both ways sum some 1e4 products, in different orders; relative to a column's largest slope.
AGREE = 1e-11
# Central differences of step h err by h^2 / 6 times a third derivative and by rounding / h.
STEP, DIFFERENCES_AGREE = 1e-5, 1e-6


def columns(num_streams, batch=4, num_layers=4, dtype=float):
    """Random layers, one of them empty, under a sun whose secant differs by layer."""
    rng = np.random.default_rng(num_streams)
    tau = 10 ** rng.uniform(-3, 1.5, (num_layers, batch))
    tau[1] = 0
    ssa = rng.uniform(0.5, 1, (num_layers, batch))
    g = rng.uniform(0.2, 0.85, (num_layers, 1, batch))
    cosines = rng.uniform(0.2, 0.95, (2, batch))
    values = {
        "tau": tau,
        "ssa": ssa,
        "coalbedo": 1 - ssa,
        "moments": g ** np.arange(num_streams)[:, None],
        "cosines": cosines,
        "sun_secants": rng.uniform(0.9, 1.1, tau.shape) / cosines[0],
        "ground": rng.uniform(0.1, 0.8, batch),
        "azimuth": rng.uniform(0.1, 3, batch),
    }
    return {name: jnp.asarray(value, dtype) for name, value in values.items()}


def grounds(x, num_streams, general):
    if not general:
        return lambertian(x["ground"], x["cosines"], num_streams), None
    surface = Bowl(x["ground"], 0.5 * jnp.ones_like(x["ground"]))
    every = [reflecting(surface, m, x["cosines"], num_streams) for m in range(num_streams)]
    return every[0], jax.tree.map(lambda *parts: jnp.stack(parts), *every[1:])


def scaled(x):
    return ScaledLayers(x["tau"], x["ssa"], x["coalbedo"], x["moments"], x["ssa"])


def doublings(x, most):
    secants = jnp.stack([x["sun_secants"], jnp.broadcast_to(1 / x["cosines"][1], x["tau"].shape)])
    return layer_doublings(x["tau"], secants, x["moments"].shape[1], most)


def plain(x, num_streams, general, *, num_doublings, single_scattering):
    """Sum over the modes by the program that has no derivative of its own."""
    tables = legendre_tables(num_streams, num_streams, x["cosines"])
    shared = scaled(x), tables, Directions(x["cosines"], x["sun_secants"])
    mean, others = grounds(x, num_streams, general)
    how = {"doublings": doublings(x, num_doublings), "single_scattering": single_scattering}
    one, zero = isotropic(num_streams, x["cosines"]), jnp.zeros_like(x["ground"])
    emission = emitting_ground(mean, one, zero, zero)
    top, _ = emitting_mean(*shared, mean, emission, one, None, **how)
    return (top.reflection() + higher_modes(*shared, others, x["azimuth"][None], **how))[0]


@partial(jax.jit, static_argnums=(1, 2))
def as_modes(x, num_streams, general):
    """The same problem as the modes see it."""
    even, odd = weighted_moments(scaled(x))
    m = jnp.arange(num_streams, dtype=x["tau"].dtype)[:, None]
    sign = jnp.where(m == 0, 1, 2 * (-1) ** m)
    tables = legendre_tables(num_streams, num_streams, x["cosines"])
    return ModeSum(
        layers=LayersOfModes(x["tau"], x["coalbedo"], x["sun_secants"], (even, odd)),
        view_secants=1 / x["cosines"][1:],
        beams=tables.beams,
        **dict(zip(("ground", "grounds"), grounds(x, num_streams, general), strict=True)),
        weights=(sign * jnp.cos(m * x["azimuth"]))[:, None],
    )


def summed(x, num_streams, general, *, num_doublings, single_scattering):
    number = doublings(x, num_doublings)
    how = How(single_scattering, None, num_doublings)
    return mode_sum(as_modes(x, num_streams, general), number, how)[0]


def value_and_slopes(function, x, *args, **how):
    return _compiled(function, args, tuple(how.items()))(x)


@cache
def _compiled(function, args, how):
    @jax.jit
    def run(x):
        value, pull_back = jax.vjp(lambda x: function(x, *args, **dict(how)), x)
        return value, pull_back(jnp.ones_like(value))[0]

    return run


SUM = jax.jit(mode_sum, static_argnums=2)
BOTH = jax.jit(reflectance_and_gradient, static_argnums=2)


@pytest.mark.parametrize(
    ("num_streams", "num_doublings", "single_scattering", "general"),
    [
        (2, 1, True, True),
        pytest.param(2, 0, True, True, marks=pytest.mark.slow),
        pytest.param(2, 1, False, False, marks=pytest.mark.slow),
        pytest.param(4, 3, False, False, marks=pytest.mark.slow),
        pytest.param(4, 3, True, True, marks=pytest.mark.slow),
        pytest.param(6, 3, False, False, marks=pytest.mark.slow),
        pytest.param(8, 3, True, False, marks=pytest.mark.slow),
        pytest.param(8, 1, False, True, marks=pytest.mark.slow),
    ],
)
def test_equals_forward_mode(num_streams, num_doublings, single_scattering, general):
    x = columns(num_streams)
    how = {"num_doublings": num_doublings, "single_scattering": single_scattering}
    through_plain = partial(plain, **how)
    expected, slopes = value_and_slopes_by_forward_mode(through_plain, num_streams, general)(x)
    value, ours = value_and_slopes(summed, x, num_streams, general, **how)
    np.testing.assert_allclose(value, expected, rtol=AGREE)
    largest = np.max(
        [np.abs(s).reshape(-1, s.shape[-1]).max(axis=0) for s in slopes.values()], axis=0
    )
    for name, slope in slopes.items():
        error = np.abs(ours[name] - slope) / largest
        assert error.max() < AGREE, name


def test_value_and_gradient_come_together():
    """The gradient's pass up gives the value, and the gradient has the inputs' structure."""
    x = columns(2)
    inputs = as_modes(x, 2, True)
    how = How(False, None, 1)
    value, gradient = BOTH(inputs, doublings(x, 1), how)
    np.testing.assert_allclose(value, SUM(inputs, doublings(x, 1), how)[0], rtol=AGREE)
    assert jax.tree.map(jnp.shape, gradient) == jax.tree.map(jnp.shape, inputs)


@pytest.mark.parametrize("general", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_one_mode_alone(general):
    x = columns(2)
    inputs = as_modes(x, 2, general)
    if general:
        inputs = inputs._replace(grounds=jax.tree.map(lambda x: x[:0], inputs.grounds))
    beams = tuple(table[:1] for table in inputs.beams)
    inputs = inputs._replace(beams=beams, weights=inputs.weights[:1])
    how = How(True, None, 1)
    value, gradient = BOTH(inputs, doublings(x, 1), how)
    np.testing.assert_allclose(value, SUM(inputs, doublings(x, 1), how)[0], rtol=AGREE)
    np.testing.assert_allclose(gradient.weights[0, 0] * inputs.weights[0, 0], value, rtol=AGREE)


@pytest.mark.parametrize("num_streams", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_one_layer_alone(num_streams):
    """It takes kernels of its own, in more than one tile; an empty layer below changes nothing."""
    *layer, albedo, mu0, mu, azimuth = solver_arguments(100)
    below = 0 * layer[0], *layer[1:]
    two = [np.concatenate(x, axis=1) for x in zip(layer, below, strict=True)]
    others = albedo, mu0, mu, azimuth

    def total(*arguments):
        return jnp.sum(toa_brf(*arguments, num_streams=num_streams, num_doublings=1))

    both = jax.value_and_grad(total, argnums=tuple(range(7)))
    value, slopes = jax.jit(both)(*layer, *others)
    expected, wanted = both(*(jnp.asarray(x) for x in (*two, *others)))
    np.testing.assert_allclose(value, expected, rtol=AGREE)
    for slope, right in zip(slopes, wanted, strict=True):
        right = right[:, :1] if slope.ndim > 1 else right
        np.testing.assert_allclose(slope, right, rtol=0, atol=AGREE * np.abs(right).max())


def solver_arguments(count):
    """One layer a column, another in each."""
    rng = np.random.default_rng(5)
    tau, ssa = 10 ** rng.uniform(-2, 1, (count, 1)), rng.uniform(0.5, 1, (count, 1))
    moments = rng.uniform(0.2, 0.8, (count, 1, 1)) ** np.arange(5)
    cosines = rng.uniform(0.2, 0.95, (2, count))
    return tau, ssa, moments, rng.uniform(0, 0.8, count), *cosines, rng.uniform(0, np.pi, count)


def test_constants_cost_nothing():
    """A tangent in the thickness alone leaves no slope of the moments in the program."""
    x = columns(2)
    inputs, once, how = as_modes(x, 2, True), doublings(x, 1), How(False, None, 1)

    def of_thickness(tau):
        layers = inputs.layers._replace(tau=tau)
        return mode_sum(inputs._replace(layers=layers), once, how)[0]

    tangent = jnp.ones_like(x["tau"])
    change = jax.jit(lambda tau: jax.jvp(of_thickness, (tau,), (tangent,))[1])(x["tau"])
    slopes = BOTH(inputs, once, how)[1]
    np.testing.assert_allclose(change, jnp.sum(slopes.layers.tau, axis=0), rtol=AGREE)


@pytest.mark.parametrize("num_streams", [2, 4, 6, 12])
def test_room_is_what_a_layer_keeps(num_streams):
    """It is written down, as to trace a layer for it would take longer than all the rest."""
    n = num_streams // 2
    like = jnp.zeros((3, 5))

    def climbed(matrix, tau):
        light, doublings = (None, None), Doublings(None, 1)
        _, _, *kept = climb(
            matrix, *light, matrix, matrix, tau, doublings, None, lambda _, new, k: new
        )
        return [
            jax.tree.map(
                lambda x: x.joined() if isinstance(x, Rows) else x,
                part,
                is_leaf=lambda x: isinstance(x, Rows),
            )
            for part in kept
        ]

    shapes = (n, n, 5), (n, 2, 5), (2, 5), (1, 5)
    kept = jax.eval_shape(climbed, Bordered(*map(jnp.zeros, shapes)), jnp.zeros(5))
    found = Keeper(like, n, 1).shapes
    for ours, traced in zip(found[:2], kept, strict=True):
        assert jax.tree.structure(ours) == jax.tree.structure(traced)
        assert jax.tree.leaves(ours) == jax.tree.leaves(traced)


@pytest.mark.slow  # of the solver that this serves it is in `test_gradients`
@pytest.mark.parametrize("order", ["forward", "reverse"])
def test_second_derivatives(order):
    """Change of the gradient along a direction in all inputs, against its differences."""
    x = columns(2, batch=2, num_layers=2)
    x["tau"] = jnp.asarray([[0.3, 1.0], [0.1, 0.7]])
    rng = np.random.default_rng(0)
    direction = {name: jnp.asarray(rng.normal(size=v.shape)) * 0.1 for name, v in x.items()}
    how = {"num_doublings": 0, "single_scattering": True}

    def gradient(x):
        return jax.grad(lambda x: jnp.sum(summed(x, 2, False, **how)))(x)

    def along(x):
        slopes = gradient(x)
        return sum(jnp.sum(slopes[name] * direction[name]) for name in x)

    def moved(step):
        return jax.tree.map(lambda v, d: v + step * d, x, direction)

    if order == "forward":
        second = jax.jit(lambda x: jax.jvp(gradient, (x,), (direction,))[1])(x)
    else:
        second = jax.jit(jax.grad(along))(x)
    ahead, behind = jax.jit(gradient)(moved(STEP)), jax.jit(gradient)(moved(-STEP))
    for name in x:
        difference = (ahead[name] - behind[name]) / (2 * STEP)
        scale = np.abs(difference).max() + 1
        np.testing.assert_allclose(
            second[name], difference, atol=DIFFERENCES_AGREE * scale, err_msg=name
        )


@pytest.mark.slow
def test_single_precision():
    """Finite everywhere, empty layers included, and as accurate as the type allows."""
    how = {"num_doublings": 1, "single_scattering": True}
    x = columns(2)
    _, expected = value_and_slopes(summed, x, 2, True, **how)
    single = {name: value.astype(jnp.float32) for name, value in x.items()}
    value, slopes = value_and_slopes(summed, single, 2, True, **how)
    assert value.dtype == jnp.float32
    for name, slope in slopes.items():
        assert slope.dtype == jnp.float32
        assert np.isfinite(slope).all(), name
        np.testing.assert_allclose(slope, expected[name], atol=3e-4 * np.abs(expected[name]).max())
