"""Levels at the edges of plumes: what they keep, what they move, and their derivatives."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from states import stacked

from abi_operator import (
    BANDS,
    Geometry,
    Hydrometeor,
    LiquidCloud,
    State,
    brf,
    mie_plume,
    standard_atmosphere,
    with_plume_edges,
)
from abi_operator.optics import aerosol

# Rounding of some ten additions and of a telescoping sum.
ROUNDING = 1e-12
# One program for a number of levels, where there would be one for every step of it.
edged = jax.jit(with_plume_edges)


def make_air(num_levels=27, base=1130.0, top=2890.0, highest=20e3):
    """Standard air with smoke, ash, cloud and snow, on equal levels above ground at 200 m."""
    height = np.linspace(highest, 200.0, num_levels)
    layers = num_levels - 1
    cloud = jnp.zeros(layers).at[-3].set(0.02)
    snow = jnp.zeros(layers).at[layers // 2].set(0.01)
    return standard_atmosphere(
        "us_standard",
        height,
        liquid=LiquidCloud(cloud, 6e11 * cloud),
        plumes={
            "smoke": mie_plume("smoke", 0.8, effective_radius_um=0.2, base=base, top=top),
            "ash": mie_plume("ash", 0.5, effective_radius_um=2.0, base=8050.0, top=11060.0),
        },
        hydrometeors={"snow": Hydrometeor(snow, 1e6 * snow)},
    )


def with_smoke(air, base, top):
    edges = lambda a: (a.plumes["smoke"].base, a.plumes["smoke"].top)  # noqa: E731
    return eqx.tree_at(edges, air, (jnp.asarray(base), jnp.asarray(top)))


@jax.jit
def depths(air):
    """Optical depth of the smoke's layers in C01."""
    return aerosol(air, "smoke", BANDS["C01"]).tau[0]


def test_depth_is_extinction_times_thickness_on_any_levels():
    coefficient = depths(make_air(2)).sum()
    for air in (make_air(n) for n in (10, 27, 51)):
        for levels in (air, edged(air)):
            np.testing.assert_allclose(depths(levels).sum(), coefficient, rtol=ROUNDING)


def test_levels_are_at_the_edges_and_nothing_is_lost():
    air = make_air()
    new = edged(air)
    assert new.height.size == air.height.size + 4
    assert np.all(np.diff(new.height) < 0) and np.all(np.diff(new.pressure) > 0)
    for edge in (1130.0, 2890.0, 8050.0, 11060.0):
        assert np.min(np.abs(new.height - 200.0 - edge)) < 0.01
    for read in (
        lambda a: a.liquid.mass_path,
        lambda a: a.liquid.number_path,
        lambda a: a.hydrometeors["snow"].mass_path,
        lambda a: a.gases.vapour,
        lambda a: a.gases.ozone,
    ):
        np.testing.assert_allclose(read(new).sum(), read(air).sum(), rtol=ROUNDING)
    assert new.pressure[0] == air.pressure[0] and new.pressure[-1] == air.pressure[-1]
    # Layers are full of plume or free of it, but for the millimetres between edge and level.
    inside = np.asarray(depths(new) / -np.diff(new.height))
    full = inside.max()
    assert np.all(
        (inside < 1e-4 * full) | (inside > (1 - 1e-4) * full) | (np.diff(-new.height) < 1)
    )


def test_new_levels_lie_where_a_standard_atmosphere_has_them():
    """Temperature is linear between levels, pressure exponential to what a layer's warmth is."""
    air = make_air(51)
    new = edged(air)
    fine = standard_atmosphere("us_standard", new.height)
    np.testing.assert_allclose(new.pressure, fine.pressure, rtol=2e-4)
    np.testing.assert_allclose(new.temperature, fine.temperature, atol=0.5)


@jax.jit
def new_levels(air, base, top):
    """Air with levels at the edges of its smoke, and the slopes of its vapour to these."""

    def vapour(base, top):
        new = with_plume_edges(with_smoke(air, base, top))
        return new.gases.vapour, new

    slopes, new = jax.jacrev(vapour, argnums=(0, 1), has_aux=True)(base, top)
    return new, slopes


@pytest.mark.parametrize(
    "base, top",
    [(0.0, 3000.0), (792.0, 2376.0), (1000.0, 30e3), (25e3, 30e3), (1000.0, 1000.0005)],
    ids=["on the ground", "on levels", "out of the air", "above the air", "thinner than its edges"],
)
def test_edges_anywhere_are_harmless(base, top):
    air = with_smoke(make_air(26), base, top)
    new, slopes = new_levels(air, base, top)
    assert all(np.all(np.isfinite(x)) for x in jax.tree.leaves(new))
    assert np.all(np.diff(new.height) <= 0) and np.all(np.diff(new.pressure) >= 0)
    np.testing.assert_allclose(depths(new).sum(), depths(air).sum(), rtol=1e-9)
    np.testing.assert_allclose(new.gases.vapour.sum(), air.gases.vapour.sum(), rtol=ROUNDING)
    assert all(np.all(np.isfinite(x)) for x in slopes)


def test_batches_are_columns_and_air_without_plumes_stays():
    airs = [make_air(), with_smoke(make_air(), 400.0, 5000.0)]
    batch = jax.tree.map(lambda *x: jnp.stack(x), *airs)
    together = edged(batch)
    for k, air in enumerate(airs):
        for a, b in zip(jax.tree.leaves(together), jax.tree.leaves(edged(air)), strict=True):
            np.testing.assert_allclose(a[k], b, rtol=1e-14)
    clear = dataclasses.replace(make_air(), plumes={})
    assert with_plume_edges(clear) is clear


SIX = ("C01", "C02", "C03", "C04", "C05", "C06")
GEOMETRY = Geometry(jnp.asarray(0.7), jnp.asarray(0.5), jnp.asarray(2.0))


def seen(air, bands=SIX, **settings):
    """Reflectances of airs stacked."""
    count = air.height.shape[0]
    grounds = dict.fromkeys(bands, jnp.full(count, 0.15))
    geometry = jax.tree.map(lambda x: jnp.full(count, x), GEOMETRY)
    state = State(air, grounds, geometry)
    return brf(state, bands, num_streams=2, num_doublings=2, **settings)


def with_nothing_above(air, count=4):
    """As many levels as edges are inserted, in a void above: the same program solves both."""

    def levels(x):
        return jnp.pad(x, (count, 0), mode="edge")

    def layers(x):
        return jnp.pad(x, (count, 0))

    return dataclasses.replace(
        air,
        pressure=levels(air.pressure),
        height=levels(air.height).at[:count].add(jnp.arange(count, 0.0, -1.0)),
        temperature=levels(air.temperature),
        gases=dataclasses.replace(
            air.gases, vapour=layers(air.gases.vapour), ozone=layers(air.gases.ozone)
        ),
        liquid=jax.tree.map(layers, air.liquid),
        hydrometeors=jax.tree.map(layers, air.hydrometeors),
    )


@pytest.mark.slow
def test_reflectances_hardly_move():
    """By under 1e-4 in C01 to C06, of levels 400 m apart that a plume's edges do not meet.

    The smoke lies above the cloud: an edge in a cloud's own layer, where it says how much smoke is
    above droplets, moves C01 by 4e-4.
    """
    air = make_air(51, base=1300.0)
    new = edged(air)
    before, after = seen(stacked([with_nothing_above(air), new]))
    np.testing.assert_allclose(after, before, atol=1e-4)


def test_derivatives_in_height():
    """Not 0, equal to differences, and on a level to the difference of a shrinking plume."""
    air = make_air(51)  # every 396 m above the ground

    @jax.jit
    @jax.vmap
    def of_edges(edges):
        return with_plume_edges(with_smoke(air, edges[0], edges[1]))

    # Up for the base and down for the top, into the plume. [m] Levels keep some mm off.
    step = np.diag([0.5, -0.5])
    places = np.array([[1130.0, 2890.0], [792.0, 2376.0]])
    slopes = jax.grad(lambda edges: jnp.sum(seen(of_edges(edges), ("C01",))))(places)
    moved = [np.concatenate([x[None], x + step, x + 2 * step]) for x in places]
    each = np.asarray(seen(of_edges(np.concatenate(moved))))[:, 0].reshape(len(places), 5)
    for edges, found, values in zip(places, slopes, each, strict=True):
        # One-sided, to second order.
        one, two = values[1:3] - values[0], values[3:] - values[0]
        difference = (4 * one - two) / (2 * np.diag(step))
        np.testing.assert_allclose(found, difference, rtol=1e-4, err_msg=str(edges))
        assert np.abs(found).min() > 1e-8


def test_the_operator_puts_them_in_where_it_is_asked_to():
    air = stacked([make_air(51), make_air(51, base=900.0)])
    by_hand = seen(edged(air))
    np.testing.assert_allclose(seen(air, plume_edges=True), by_hand, rtol=ROUNDING)
