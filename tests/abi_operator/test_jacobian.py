"""Jacobians of the operator in every floating leaf of a state that holds all there is.

Called outside `jax.jit`, forward and reverse mode share one program, whatever the state of these:
the rich one, and that in which all that may be empty is. Few layers and streams are enough for all
that the chain of derivatives goes through; how good they are for a radiance is asked elsewhere.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator import (
    BANDS,
    Fire,
    Geometry,
    Hydrometeor,
    LiquidCloud,
    State,
    ash,
    mie_plume,
    radiance,
    standard_atmosphere,
)
from abi_operator.surface import RossLi, ocean

# The band of the quick test: sunlight, and emission with it, over land.
FEW = ("C07",)
# Rounding, relative to the largest entry of a leaf in any band.
MODES_AGREE = 1e-8
# Of Richardson's differences, whose own error is of the fourth order in the step.
DIFFERENCES_AGREE = 1e-5


def rich_state(bands=FEW, num_layers=3):
    """Gases, droplets, rain, snow, both kinds of plume, a fire, and a ground of each kind."""
    height = np.linspace(15e3, 100.0, num_layers + 1)
    cloud = jnp.zeros(num_layers).at[-1].set(0.03)
    rain = jnp.zeros(num_layers).at[-1].set(0.01)
    snow = jnp.zeros(num_layers).at[num_layers // 2].set(0.01)
    specified = ash(0.4, base=4000.0, top=7000.0)
    plume = dataclasses.replace(
        specified,
        relative_extinction=dict.fromkeys(bands, jnp.asarray(0.5)),
        ssa=dict.fromkeys(bands, jnp.asarray(0.9)),
        asymmetry=dict.fromkeys(bands, jnp.asarray(0.6)),
    )
    air = standard_atmosphere(
        "us_standard",
        height,
        liquid=LiquidCloud(cloud, 5e11 * cloud),
        plumes={
            "ash": plume,
            "smoke": mie_plume("smoke", 0.6, effective_radius_um=0.2, base=900.0, top=2900.0),
        },
        hydrometeors={"rain": Hydrometeor(rain, 1e6 * rain), "snow": Hydrometeor(snow, 1e7 * snow)},
    )
    grounds = {band: 0.2 for band in bands}
    if "C06" in bands:
        grounds["C06"] = ocean(jnp.asarray(5.0), "C06")
    grounds["C07"] = RossLi(*map(jnp.asarray, (0.3, 0.1, 0.02)))
    state = State(
        air,
        grounds,
        Geometry(*map(jnp.asarray, (0.6, 0.4, 2.0))),
        surface_temperature=jnp.asarray(300.0),
        fire=Fire(jnp.asarray(0.01), jnp.asarray(800.0)),
    )
    # Below 1, which is the most that there may be.
    brightness = lambda s: [p.brightness for p in s.atmosphere.plumes.values()]  # noqa: E731
    state = eqx.tree_at(brightness, state, [0.8, 0.8])
    return jax.tree.map(lambda x: jnp.asarray(x, jnp.float64), state)


def emptied(state):
    """The same without cloud, rain, plumes and fire, whose leaves stay in the state."""
    zeroed = lambda s: (  # noqa: E731
        s.atmosphere.liquid.mass_path,
        s.atmosphere.liquid.number_path,
        s.atmosphere.hydrometeors["rain"].mass_path,
        s.atmosphere.hydrometeors["rain"].number_path,
        s.atmosphere.plumes["smoke"].brightness,
        s.atmosphere.plumes["ash"].extinction_550,
        s.atmosphere.gases.ozone,
        s.fire.fraction,
    )
    return eqx.tree_at(zeroed, state, replace_fn=jnp.zeros_like)


def check(state, bands, **options):
    def value(state):
        return radiance(state, bands, **options)

    forward, reverse = jax.jacfwd(value), jax.jacrev(value)
    for case in (emptied(state), state):
        ahead, back = forward(case), reverse(case)
        for (path, a), b in zip(
            jax.tree_util.tree_leaves_with_path(ahead), jax.tree.leaves(back), strict=True
        ):
            name = jax.tree_util.keystr(path)
            assert np.all(np.isfinite(a)), name
            scale = np.max(np.abs(a)) + 1e-300
            np.testing.assert_allclose(a / scale, b / scale, atol=MODES_AGREE, err_msg=name)
    slopes = jax.tree.leaves(ahead)
    leaves, structure = jax.tree.flatten(state)
    paths = [jax.tree_util.keystr(p) for p, _ in jax.tree_util.tree_leaves_with_path(state)]
    rng = np.random.default_rng(4)
    moved, found = [], []
    step = 1e-3
    for k, leaf in enumerate(leaves):
        # Entries that are 0 stay: derivatives there are one-sided.
        direction = np.asarray(leaf) * rng.uniform(0.2, 1, leaf.shape)
        found.append(np.sum(slopes[k] * direction, axis=tuple(range(1, slopes[k].ndim))))
        for size in (step, -step, step / 2, -step / 2):
            changed = list(leaves)
            changed[k] = leaf + size * direction
            moved.append(jax.tree.unflatten(structure, changed))
    *ends, size = np.asarray(value(jax.tree.map(lambda *x: jnp.stack(x), *moved, state)))
    values = np.reshape(ends, (len(found), 4, -1))
    one = (values[:, 0] - values[:, 1]) / (2 * step)
    half = (values[:, 2] - values[:, 3]) / step
    found, expected = np.asarray(found), (4 * half - one) / 3
    # Relative to the entry, but for those that are 0 beside the radiance itself.
    bound = DIFFERENCES_AGREE * np.maximum(np.abs(expected), 1e-5 * size)
    wrong = np.any(np.abs(found - expected) > bound, axis=1)
    assert not wrong.any(), [(paths[k], found[k], expected[k]) for k in np.flatnonzero(wrong)]


@pytest.mark.slow
def test_every_leaf():
    check(rich_state(), FEW, num_streams=2, num_modes=2, num_doublings=1)


@pytest.mark.slow
def test_every_leaf_in_all_bands(scale):
    """At full scale; a sample takes those of the most exponential terms and of none."""
    bands = tuple(BANDS) if scale == 1 else ("green", "C06")
    check(rich_state(bands, max(3, round(10 * scale))), bands, num_streams=4, num_doublings=4)
