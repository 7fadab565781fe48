"""Float32 against float64 on columns nobody chose, both given the same float32 numbers."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from columns import hard_columns, simple_columns
from random_columns import random_columns

from abi_operator.solver import sufficient_doublings, toa_albedo, toa_brf

INPUTS = ("tau", "ssa", "moments", "albedo", "mu0", "mu", "relative_azimuth")
SEED = 19770701
# Matrices of order 1 round at 6e-8, some thousand times, mostly with random sign; a BRF below the
# floor is a small difference of them and is judged against the floor.
FLOOR = 1e-3
VALUE_P99, VALUE_P999 = 1e-4, 1e-3
# Gradients: largest error of an input over that input's largest derivative, but over 1e-3 of the
# column's BRF where no derivative is larger; as above, a BRF below the floor counts as the floor.
# "unfloored" figures are without that: nothing is left of a column of 1e-17.
GRADIENT_FLOOR, GRADIENT_P99 = 1e-3, 1e-3
CHUNK = 250


def chunks(seed, count):
    """At least `count` columns rounded to float32, as many at a time as fit the memory twice."""
    rng = np.random.default_rng(seed)
    for _ in range(math.ceil(count / CHUNK)):
        yield [np.asarray(x, np.float32) for x in random_columns(rng, CHUNK)]


def doublings(num_streams):
    return sufficient_doublings(200, 0.02, num_streams)


def as_double(columns):
    return [np.asarray(x, np.float64) for x in columns]


def report(title, errors):
    p50, p99, p999 = np.percentile(errors, [50, 99, 99.9])
    print(f"{title}: p50 {p50:.1e} p99 {p99:.1e} p99.9 {p999:.1e} max {np.max(errors):.1e}")
    return p99, p999


def assert_values(seed, count, num_streams, single_scattering):
    options = {
        "num_streams": num_streams,
        "num_doublings": doublings(num_streams),
        "single_scattering": single_scattering,
    }
    errors = []
    for columns in chunks(seed, count):
        single = toa_brf(*columns, **options)
        assert single.dtype == jnp.float32
        with jax.enable_x64(True):
            double = np.asarray(toa_brf(*as_double(columns), **options))
        assert double.dtype == np.float64
        errors.append(abs(np.asarray(single) - double) / np.maximum(abs(double), FLOOR))
    errors = np.concatenate(errors)
    title = f"seed {seed}, {errors.size} columns, {num_streams} streams, {single_scattering}"
    p99, p999 = report(title, errors)
    assert p99 <= VALUE_P99
    assert p999 <= VALUE_P999


def assert_gradients(seed, count, num_streams, single_scattering):
    def summed(*arguments):
        values = toa_brf(
            *arguments,
            num_streams=num_streams,
            num_doublings=doublings(num_streams),
            single_scattering=single_scattering,
        )
        return jnp.sum(values), values

    derivative = jax.jit(jax.grad(summed, argnums=tuple(range(len(INPUTS))), has_aux=True))
    errors = []
    for columns in chunks(seed, count):
        single, _ = derivative(*columns)
        with jax.enable_x64(True):
            double, value = derivative(*as_double(columns))
            value = np.asarray(value)
        errors.append([])
        for name, s, d in zip(INPUTS, single, double, strict=True):
            assert s.dtype == jnp.float32
            s, d = (np.asarray(x, np.float64).reshape(value.size, -1) for x in (s, d))
            assert np.isfinite(s).all(), name
            for counts_as in (np.maximum(abs(value), FLOOR), abs(value)):
                scale = np.maximum(abs(d).max(axis=1), GRADIENT_FLOOR * counts_as)
                errors[-1].append(abs(s - d).max(axis=1) / scale)
    errors = np.concatenate(errors, axis=1)
    errors, unfloored = errors[0::2], errors[1::2]
    print(f"\nseed {seed}, {errors.shape[1]} columns, {num_streams} streams, {single_scattering}")
    for name, of_input, bare in zip(INPUTS, errors, unfloored, strict=True):
        p99, _ = report(f"gradient in {name}", of_input)
        report("    unfloored", bare)
        assert p99 <= GRADIENT_P99, name


@pytest.mark.float32
@pytest.mark.parametrize(
    ("num_streams", "single_scattering"), [(2, "tms"), (4, None), (8, "tms"), (8, None), (16, None)]
)
def test_values(num_streams, single_scattering):
    assert_values(SEED + num_streams, 250, num_streams, single_scattering)


@pytest.mark.float32
@pytest.mark.parametrize("single_scattering", ["tms", None])
def test_gradients(single_scattering):
    assert_gradients(SEED, 250, 4, single_scattering)


@pytest.mark.float32
def test_gradients_are_finite_at_every_hard_place():
    names, columns = hard_columns(num_moments=9)
    columns = [np.asarray(x, np.float32) for x in columns]
    derivative = jax.grad(
        lambda *a: jnp.sum(toa_brf(*a, num_streams=4, num_doublings=13)), argnums=tuple(range(7))
    )
    for name, gradient in zip(INPUTS, derivative(*columns), strict=True):
        finite = np.isfinite(np.reshape(gradient, (len(names), -1))).all(axis=1)
        assert finite.all(), f"{name}: {[n for n, ok in zip(names, finite, strict=True) if not ok]}"


def conservative_columns(depth, count=64, layers=16, num_streams=4):
    """Nothing is absorbed in them, nor by the ground."""
    rng = np.random.default_rng(3)
    tau = depth * rng.dirichlet(np.ones(layers), count)
    moments = rng.uniform(0, 0.8, (count, layers, 1)) ** np.arange(num_streams + 1)
    mu0, mu = rng.uniform(0.05, 1, (2, count))
    columns = tau, np.ones_like(tau), moments, np.ones(count), mu0, mu, rng.uniform(0, np.pi, count)
    return [np.asarray(x, np.float32) for x in columns]


@pytest.mark.float32
@pytest.mark.parametrize(
    ("depth", "right"), [(10, 1e-5), (1e3, 1e-5), (1e5, 1e-5), (9.9e5, 2e-5), (3e7, None)]
)
def test_depth_without_absorption_is_right_or_refused(depth, right):
    """Rounding weighs as much in any; where it is all, there is no number.

    It is some 2e-7 of one column, whose reflectance is 0.02 to 0.03, what its terms leave.
    """
    columns = conservative_columns(depth)
    single = np.asarray(toa_brf(*columns, num_streams=4))
    assert single.dtype == np.float32
    if right is None:
        assert np.isnan(single).all()
        return
    with jax.enable_x64(True):
        double = np.asarray(toa_brf(*as_double(columns), num_streams=4))
    error = np.sort(abs(single / double - 1))
    assert error[-1] < right and error[-2] < 2e-6


@pytest.mark.float32
@pytest.mark.parametrize(("num_streams", "right"), [(4, 1e-4), (6, 1e-4), (8, 3e-4)])
def test_depth_weighs_nothing_in_what_scatters_backwards(num_streams, right):
    """Whose reflectances leave a difference of larger numbers, thin layers or deep."""
    _, _, _, *beside = conservative_columns(1.0, num_streams=num_streams)
    moments = np.broadcast_to(
        np.float32(-0.9) ** np.arange(num_streams + 1), (64, 1, num_streams + 1)
    )
    for depth in (10, 1e5, 9.9e5):
        tau = np.full((64, 1), depth, np.float32)
        columns = [tau, np.ones_like(tau), moments.astype(np.float32), *beside]
        single = np.asarray(toa_brf(*columns, num_streams=num_streams))
        with jax.enable_x64(True):
            double = np.asarray(toa_brf(*as_double(columns), num_streams=num_streams))
        assert np.max(abs(single - double) / np.maximum(abs(double), 0.01)) < right


@pytest.mark.float32
def test_what_nothing_absorbs_comes_back():
    """White ground under layers of any depth: all sunlight leaves again."""
    tau, ssa, moments, albedo, mu0, *_ = conservative_columns(1e5)
    share = np.asarray(toa_albedo(tau, ssa, moments, albedo, mu0, num_streams=4))
    assert share.dtype == np.float32
    assert np.max(abs(share - 1)) < 2e-6  # some roundings of 6e-8, whatever the depth


@pytest.mark.float32
@pytest.mark.parametrize(("depth", "right"), [(1e3, 5e-6), (1e5, 1e-5), (9.9e5, 5e-4)])
def test_what_little_absorption_takes_through_deep_layers(depth, right):
    """Light of many scatterings: its slopes in ssa and albedo, of their largest.

    Quotients and the ground's matrix alone, as elimination and its entries leave them, have a
    hundredth at 1e5.
    """
    columns = conservative_columns(depth)
    whole = lambda *x: jnp.sum(toa_brf(*x, num_streams=4))  # noqa: E731
    derivative = jax.grad(whole, argnums=(1, 3))
    single = derivative(*columns)
    with jax.enable_x64(True):
        double = [np.asarray(x) for x in derivative(*as_double(columns))]
    for s, d in zip(single, double, strict=True):
        assert s.dtype == jnp.float32
        s, d = (np.asarray(x).reshape(len(d), -1) for x in (s, d))
        assert np.max(abs(s - d).max(axis=1) / abs(d).max(axis=1)) < right


@pytest.mark.parametrize("error_budget", [None, 1e-3])
def test_gradients_never_compute_in_float64(error_budget):
    columns = [jnp.asarray(x, jnp.float32) for x in simple_columns()]

    def total(*columns):
        how = {"num_doublings": 5, "error_budget": error_budget}
        return jnp.sum(toa_brf(*columns, num_streams=2, **how))

    derivative = jax.grad(total, argnums=tuple(range(7)))
    assert "f64" not in jax.jit(derivative).lower(*columns).as_text()
    # Which is what the word is for.
    assert "f64" in jax.jit(jnp.sum).lower(jnp.zeros(1, jnp.float64)).as_text()


@pytest.mark.float32
@pytest.mark.parametrize("error_budget", [None, 1e-3])
def test_thick_layers_under_a_grazing_view(error_budget):
    """A third of the light was wrong where doublings were those of double precision."""
    tau = np.float32(10) ** np.linspace(3, 5, 9, dtype=np.float32)[:, None]
    moments = np.float32(0.8) ** np.arange(3, dtype=np.float32)
    columns = [tau, np.float32([0.93]), moments[None], np.float32(0.26)]
    columns += [np.float32(x) for x in (0.35, 0.001, 0.95)]

    def light(*columns):
        return np.asarray(toa_brf(*columns, num_streams=2, error_budget=error_budget))

    single = light(*columns)
    with jax.enable_x64(True):
        double = light(*as_double(columns))
    np.testing.assert_allclose(single, double, rtol=2e-4)


# Long studies leave x64 on: float32 arguments alone decide the precision.
@pytest.mark.slow
@pytest.mark.parametrize(
    ("num_streams", "single_scattering"),
    [
        (2, "tms"),
        (4, None),
        (6, "tms"),
        (8, "tms"),
        (8, None),
        (12, None),
        (16, "tms"),
        (32, "tms"),
    ],
)
def test_values_of_thousands_of_columns(num_streams, single_scattering, scale):
    assert_values(SEED + 100 + num_streams, scale * 5000, num_streams, single_scattering)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("num_streams", "single_scattering"), [(2, None), (4, "tms"), (8, "tms"), (8, None)]
)
def test_gradients_of_thousands_of_columns(num_streams, single_scattering, scale):
    assert_gradients(SEED + 200 + num_streams, scale * 2000, num_streams, single_scattering)
