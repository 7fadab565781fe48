"""Columns with sources, for tests of the solver's written-out derivatives."""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
from columns import simple_columns
from surfaces import Bowl

from abi_operator.solver.column import Column, Options

# Both ways sum some 1e4 products, in different orders; relative to a column's largest slope.
AGREE = 1e-11
# Central differences of step h err by h^2 / 6 times a third derivative and by rounding / h.
STEP, DIFFERENCES_AGREE = 1e-5, 1e-6


def tile(num_streams, general=False, batch=4, num_layers=4):
    """Columns with their batch last: an empty layer across which the Planck function jumps, layers
    that scatter nothing and that absorb nothing, and a sun whose secant differs by layer."""
    rng = np.random.default_rng(num_streams)
    tau = 10 ** rng.uniform(-3, 1.5, (num_layers, batch))
    ssa = rng.uniform(0.5, 1, tau.shape)
    tau[1], ssa[2, 0], ssa[2, 1] = 0, 0, 1
    g = rng.uniform(0.2, 0.85, (num_layers, 1, batch))
    mu0, mu = rng.uniform(0.2, 0.95, (2, batch))
    albedo = rng.uniform(0.1, 0.8, batch)
    arrays = {
        "tau": tau,
        "ssa": ssa,
        "moments": g ** np.arange(num_streams + 1)[:, None],
        "mu0": mu0,
        "mu": mu[None],
        "relative_azimuth": rng.uniform(0.1, 3, (1, batch)),
        "phase_function": rng.uniform(0.5, 1.5, (num_layers, 1, batch)),
        "secant": rng.uniform(0.9, 1.1, tau.shape) / mu0,
        "planck_levels": rng.uniform(1, 9, (num_layers + 1, batch)),
        "surface_emission": rng.uniform(1, 9, batch),
        "isotropic_top": rng.uniform(0, 2, batch),
        "solar_irradiance": rng.uniform(1, 9, batch),
    }
    arrays = {name: jnp.asarray(x) for name, x in arrays.items()}
    ground = jnp.asarray(albedo)
    return Column(albedo=Bowl(ground, 0.5 * ground) if general else ground, **arrays)


def options(num_streams, num_doublings, tms):
    return Options(num_streams, num_streams, True, tms, num_doublings)


@cache
def value_and_slopes_of(function, how):
    @jax.jit
    def run(column):
        value, pull_back = jax.vjp(lambda column: function(column, how), column)
        return value, pull_back(jnp.ones_like(value))[0]

    return run


@cache
def value_and_slopes_by_forward_mode(function, *how):
    """Of columns whose batch is last, one tangent for each entry of a column; by reverse mode a
    program without a derivative of its own would take twice as long to compile."""

    @jax.jit
    def run(column):
        leaves, tree = jax.tree.flatten(column)
        sizes = [x[..., 0].size if x.size else 0 for x in leaves]
        ends = np.cumsum(sizes)
        entries = np.split(np.eye(ends[-1]), ends[:-1], axis=1)
        tangents = [
            jnp.broadcast_to(e.reshape(-1, *x.shape[:-1], 1).astype(x.dtype), (ends[-1], *x.shape))
            for e, x in zip(entries, leaves, strict=True)
        ]

        def along(*tangents):
            return jax.jvp(
                lambda *x: function(jax.tree.unflatten(tree, x), *how), tuple(leaves), tangents
            )

        value, slopes = jax.vmap(along, out_axes=(None, 0))(*tangents)
        parts = zip(jnp.split(slopes, ends[:-1]), leaves, strict=True)
        return value, jax.tree.unflatten(tree, [s.reshape(x.shape) for s, x in parts])

    return run


def assert_slopes_agree(found, expected):
    """Relative to the largest slope of each column."""
    found, expected = (jax.tree.map(lambda x: x if x.size else None, y) for y in (found, expected))
    leaves = jax.tree.leaves(expected)
    largest = np.max([np.abs(x).reshape(-1, x.shape[-1]).max(axis=0) for x in leaves], axis=0)
    names = [jax.tree_util.keystr(path) for path, _ in jax.tree_util.tree_leaves_with_path(found)]
    for name, slope, right in zip(names, jax.tree.leaves(found), leaves, strict=True):
        assert np.isfinite(slope).all(), name
        assert np.max(np.abs(slope - right) / largest) < AGREE, name


def arguments(num_layers=3, count=3, dtype=float):
    """Columns and sources with the batch first; the second of several layers is empty."""
    rng = np.random.default_rng(7)
    columns = [np.array(x) for x in simple_columns(count, num_layers, num_moments=3)]
    columns[0][:, 1:2] = 0
    sources = [
        rng.uniform(1, 5, count),
        rng.uniform(1, 9, (count, num_layers + 1)),
        rng.uniform(1, 9, count),
        rng.uniform(0, 2, count),
    ]
    return [jnp.asarray(x, dtype) for x in (*columns, *sources)]


def direction(inputs, seed=1):
    """Of no change in layers that are empty."""
    rng = np.random.default_rng(seed)
    found = [jnp.asarray(rng.normal(size=x.shape)) for x in inputs]
    return [jnp.where(inputs[0] == 0, 0, found[0]), *found[1:]]


def differences(function, inputs, tangents):
    """Of a list of results, along a direction."""
    ahead, behind = (
        function(*(x + step * t for x, t in zip(inputs, tangents, strict=True)))
        for step in (STEP, -STEP)
    )
    return [(p - m) / (2 * STEP) for p, m in zip(ahead, behind, strict=True)]
