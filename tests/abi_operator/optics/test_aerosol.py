"""Plumes on the layers of a column."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.bands import BANDS, several_bands
from abi_operator.optics import aerosol, ash, smoke
from abi_operator.optics.aerosol import overlap
from abi_operator.optics.mie_aerosol import mie_optics
from abi_operator.optics.species import mie_plume

ROUNDING = 1e-12
LEVELS = jnp.array([4.0, 3.0, 2.0, 1.0, 0.0])


@pytest.mark.parametrize(
    ("base", "top", "expected"),
    [
        (0.5, 2.25, [0, 0.25, 1, 0.5]),
        (1.0, 3.0, [0, 1, 1, 0]),
        (2.2, 2.7, [0, 0.5, 0, 0]),
        (2.0, 2.0, [0, 0, 0, 0]),
        (-1.0, 0.5, [0, 0, 0, 0.5]),
        (3.5, 9.0, [0.5, 0, 0, 0]),
    ],
)
def test_overlap(base, top, expected):
    np.testing.assert_allclose(overlap(LEVELS, jnp.asarray(base), jnp.asarray(top)), expected)


@pytest.mark.parametrize(("base", "top"), [(1.0, np.nan), (np.nan, 3.0), (np.nan, np.nan)])
def test_an_edge_that_is_no_number_is_nowhere(base, top):
    """It would leave all of the column above or below it to the plume."""
    assert np.isnan(overlap(LEVELS, jnp.asarray(base), jnp.asarray(top))).all()


@pytest.mark.parametrize("mode", [jax.jacfwd, jax.jacrev])
def test_derivative_on_a_level_belongs_to_the_layer_inside(mode):
    derivatives = jax.jit(mode(overlap, argnums=(1, 2)))
    to_base, to_top = derivatives(LEVELS, jnp.asarray(1.0), jnp.asarray(3.0))
    np.testing.assert_array_equal(to_base, [0, 0, -1, 0])
    np.testing.assert_array_equal(to_top, [0, 1, 0, 0])


def layers_of(atmosphere, name, band):
    """Optical depth of the layers, ssa and asymmetry of a plume."""
    optics = aerosol(atmosphere, name, band)
    return optics.tau[0], optics.ssa[0], optics.moments(3)[:, 1]


@pytest.mark.parametrize("num_layers", [10, 27])
@pytest.mark.parametrize("species", ["smoke", "ash"])
def test_optical_depth_does_not_depend_on_the_levels(make_atmosphere, num_layers, species):
    plumes = {
        "smoke": smoke(0.8, brightness=0.7, bands=tuple(BANDS)),
        "ash": ash(0.5, brightness=0.4, bands=tuple(BANDS)),
    }
    plume = plumes[species]
    atmosphere = make_atmosphere(num_layers, plumes=plumes)
    in_bands = jax.jit(lambda: [layers_of(atmosphere, species, band) for band in BANDS.values()])
    for band, layers in zip(BANDS, in_bands(), strict=True):
        tau, ssa, asymmetry = (np.asarray(x) for x in layers)
        expected = plume.aod_550 * plume.relative_extinction[band]
        np.testing.assert_allclose(tau.sum(), expected, rtol=ROUNDING)
        inside = tau > 0
        np.testing.assert_allclose(ssa[inside], plume.ssa[band], rtol=ROUNDING)
        np.testing.assert_array_equal(ssa[~inside], 0)
        np.testing.assert_allclose(asymmetry[inside], plume.asymmetry[band], rtol=ROUNDING)


@pytest.mark.parametrize("num_layers", [10, 27])
@pytest.mark.parametrize(("species", "radius"), [("smoke", 0.14), ("ash", 2.5), ("dust", 1.2)])
def test_spheres_fill_their_extent_on_any_levels(make_atmosphere, num_layers, species, radius):
    plume = mie_plume(species, 0.8, radius, base=1130.0, top=5270.0, brightness=0.7)
    atmosphere = make_atmosphere(num_layers, plumes={"any": plume})

    @jax.jit
    @jax.vmap
    def in_bands(band):
        spheres = mie_optics(species, plume.effective_radius_um, band.name)
        return spheres, layers_of(atmosphere, "any", band)

    found = jax.tree.map(np.asarray, in_bands(several_bands(tuple(BANDS), float)))
    for k in range(len(BANDS)):
        spheres, (tau, ssa, asymmetry) = jax.tree.map(lambda x, k=k: x[k], found)
        expected = 0.8 * 0.7 * spheres.relative_extinction
        np.testing.assert_allclose(tau.sum(), expected, rtol=ROUNDING)
        inside = tau > 0
        np.testing.assert_allclose(1 - ssa[inside], spheres.coalbedo, rtol=ROUNDING)
        np.testing.assert_allclose(asymmetry[inside], spheres.asymmetry, rtol=ROUNDING)
        np.testing.assert_array_equal(ssa[~inside], 0)


def by_edges(atmosphere, name, band):
    """Optical depth of the layers as a function of base and top of a plume."""

    def tau(edges):
        plume = dataclasses.replace(atmosphere.plumes[name], base=edges[0], top=edges[1])
        moved = dataclasses.replace(atmosphere, plumes={name: plume})
        return aerosol(moved, name, BANDS[band]).tau[0]

    return jax.jit(tau)


def both_modes(function, x):
    """Jacobian in forward and in reverse mode."""
    return jax.jit(lambda x: (jax.jacfwd(function)(x), jax.jacrev(function)(x)))(x)


PLUMES = {
    "specified": smoke(0.8, base=1130.0, top=3170.0),
    "spheres": mie_plume("ash", 0.8, 3.0, base=1130.0, top=3170.0),
}


@pytest.mark.parametrize("name", PLUMES)
def test_derivative_to_the_edges_against_differences(make_atmosphere, name):
    tau = by_edges(make_atmosphere(plumes={name: PLUMES[name]}), name, "C01")
    edges, step = np.array([1130.0, 3170.0]), 1.0
    steps = step * np.eye(2)
    columns = [np.asarray(tau(edges + h)) - np.asarray(tau(edges - h)) for h in steps]
    differences = np.stack(columns, axis=1) / (2 * step)
    np.testing.assert_array_equal(np.count_nonzero(differences, axis=0), [1, 1])
    # Extinction is linear in the edge: what is left is rounding of depth / step.
    for derivative in both_modes(tau, edges):
        np.testing.assert_allclose(derivative, differences, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("name", PLUMES)
def test_derivative_to_edges_on_levels_is_that_of_a_shrinking_plume(make_atmosphere, name):
    tau = by_edges(make_atmosphere(plumes={name: PLUMES[name]}), name, "C02")
    edges, step = np.array([2000.0, 6000.0]), 1.0  # levels are 2 km apart
    shrinking = [(step, 0.0), (0.0, -step)]
    on_levels = np.asarray(tau(edges))
    differences = [(np.asarray(tau(edges + np.array(h))) - on_levels) / sum(h) for h in shrinking]
    expected = np.stack(differences, axis=1)
    assert np.all(np.any(expected != 0, axis=0))
    for derivative in both_modes(tau, edges):
        np.testing.assert_allclose(derivative, expected, rtol=1e-9, atol=1e-15)


def test_derivative_to_the_effective_radius_against_differences(make_atmosphere):
    atmosphere = make_atmosphere(plumes={"spheres": PLUMES["spheres"]})

    @jax.jit
    def optics(radius):
        plume = dataclasses.replace(PLUMES["spheres"], effective_radius_um=radius)
        changed = dataclasses.replace(atmosphere, plumes={"spheres": plume})
        value = aerosol(changed, "spheres", BANDS["C06"])
        return jnp.stack([value.tau[0], value.scattering, value.moments(2)[:, 1]])

    radius, step = jnp.asarray(3.1), 1e-5
    differences = (optics(radius + step) - optics(radius - step)) / (2 * step)
    assert np.count_nonzero(differences) == 6
    for derivative in both_modes(optics, radius):
        np.testing.assert_allclose(derivative, differences, rtol=1e-6, atol=1e-12)


def test_a_batch_of_plumes_of_spheres_is_a_loop(make_atmosphere):
    radii, tops = np.array([0.5, 2.0, 7.0]), np.array([3e3, 4e3, 5e3])
    plumes = mie_plume("ash", 0.5, radii, base=1e3, top=tops)
    atmosphere = make_atmosphere(plumes={})

    @jax.jit
    def tau(plume):
        column = dataclasses.replace(atmosphere, plumes={"ash": plume})
        return aerosol(column, "ash", BANDS["C05"]).tau

    loop = [tau(jax.tree.map(lambda leaf, i=i: leaf[i], plumes)) for i in range(3)]
    np.testing.assert_allclose(jax.vmap(tau)(plumes), np.stack(loop), rtol=ROUNDING)


@pytest.mark.float32
@pytest.mark.parametrize("name", PLUMES)
def test_float32_stays(make_atmosphere, name):
    atmosphere = make_atmosphere(dtype=jnp.float32, plumes={name: PLUMES[name]})
    optics = aerosol(atmosphere, name, BANDS["C01"])
    kinds = {leaf.dtype for leaf in jax.tree.leaves(optics)}  # numbers, and where it is
    assert kinds == {jnp.dtype(jnp.float32), jnp.dtype(bool)}


def test_plume_counts_from_the_ground(make_atmosphere):
    atmosphere = make_atmosphere()
    raised = dataclasses.replace(atmosphere, height=atmosphere.height + 1500.0)
    np.testing.assert_allclose(
        aerosol(raised, "ash", BANDS["C01"]).tau,
        aerosol(atmosphere, "ash", BANDS["C01"]).tau,
        rtol=ROUNDING,
    )


def test_missing_band_and_plume_are_named(make_atmosphere):
    atmosphere = make_atmosphere()
    with pytest.raises(ValueError, match=r"plume 'ash'.*band 'C03'.*\['C01', 'C06'\]"):
        aerosol(atmosphere, "ash", BANDS["C03"])
    with pytest.raises(ValueError, match=r"no plume 'fog'.*\['ash', 'smoke'\]"):
        aerosol(atmosphere, "fog", BANDS["C01"])
