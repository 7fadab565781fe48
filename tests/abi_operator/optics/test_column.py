"""All of a column together: mixing, derivatives to every number of the state, float32."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

from abi_operator.atmosphere import Hydrometeor
from abi_operator.bands import BANDS, several_bands
from abi_operator.constants import STANDARD_PRESSURE
from abi_operator.optics import aerosol, column_optics, liquid_cloud, mixture, rayleigh
from abi_operator.optics.rayleigh import STANDARD_DEPTH

FLOAT32 = 3e-6
STEP = 1e-5  # of a central difference, relative to the state
DIFFERENCE = 2e-8  # its error: step squared and rounding / step


@functools.partial(jax.jit, static_argnums=1)
def outputs(atmosphere, band):
    """What adds, and what is derived from it, flat."""
    optics = column_optics(atmosphere, BANDS[band])
    scattering = optics.ssa[0] * optics.tau[0]
    forward = optics.phase_function(jnp.asarray(0.9, scattering.dtype))
    return jnp.concatenate([optics.tau[0], scattering, optics.moments(5).ravel(), forward])


# Compiled once for each dtype and band.
JACOBIANS = {mode: jax.jit(mode(outputs), static_argnums=1) for mode in (jax.jacfwd, jax.jacrev)}


def test_column_is_the_sum_of_its_parts(make_atmosphere):
    atmosphere, band = make_atmosphere(), BANDS["C01"]
    optics = column_optics(atmosphere, band)
    parts = [rayleigh(atmosphere, band), liquid_cloud(atmosphere, band)]
    parts += [aerosol(atmosphere, plume, band) for plume in atmosphere.plumes]
    np.testing.assert_allclose(optics.tau, sum(part.tau for part in parts), rtol=1e-15)
    np.testing.assert_allclose(
        optics.scattering, sum(part.scattering for part in parts), rtol=1e-15
    )
    assert len(optics.scatterers) == 4
    assert optics.weight.shape == (1,)


def test_a_mixture_is_its_column_evaluated(make_atmosphere):
    """Values, and slopes in both modes, of classes that are in some layers, in one and in none."""
    atmosphere = make_atmosphere()
    mass = np.zeros((3, atmosphere.height.size - 1))
    mass[0, 1:3], mass[1, -1] = 1e-2, 2e-3
    particles = zip(("ice", "rain", "snow"), jnp.asarray(mass), (1e10, 1e5, 1e5), strict=True)
    classes = {name: Hydrometeor(x, n * x) for name, x, n in particles}
    atmosphere = dataclasses.replace(atmosphere, hydrometeors=classes)
    flat, structure = ravel_pytree(atmosphere)
    band, angle = BANDS["C06"], jnp.asarray(0.9)

    def evaluated(x):
        return ravel_pytree(mixture(structure(x), band, (), 5, angle))[0]

    def by_parts(x):
        optics = column_optics(structure(x), band, ())
        parts = optics.tau, optics.ssa, optics.weight, optics.moments(5)
        return ravel_pytree((*parts, optics.phase_function(angle)))[0]

    @functools.partial(jax.jit, static_argnums=0)
    def all_of_it(function, x, weight, change):
        value, pull_back = jax.vjp(function, x)
        return value, pull_back(weight)[0], jax.jvp(function, (x,), (change,))[1]

    rng = np.random.default_rng(0)
    weight = rng.uniform(0.5, 1.5, by_parts(flat).shape)
    change = 1e-3 * np.asarray(flat) * rng.uniform(0.5, 1.5, flat.shape)
    found, right = (all_of_it(f, flat, weight, change) for f in (evaluated, by_parts))
    for x, y in zip(found, right, strict=True):
        np.testing.assert_allclose(x, y, rtol=1e-11, atol=1e-14)


def test_slopes_of_each_of_several_bands(make_atmosphere):
    """Of graupel, whose asymmetry is one number, and which each band has a copy of."""
    names, angle = ("C01", "C06"), jnp.asarray(0.9)
    mass = jnp.zeros(make_atmosphere().height.size - 1).at[1].set(1e-2)
    graupel = {"graupel": Hydrometeor(mass, 1e7 * mass)}
    atmosphere = dataclasses.replace(make_atmosphere(plumes={}), hydrometeors=graupel)

    def summed(atmosphere, band):
        found = mixture(atmosphere, band, (), 5, angle)
        return jnp.sum(found.moments) + jnp.sum(found.phase_function) + jnp.sum(found.tau)

    def of_all(copies):
        return jnp.sum(jax.vmap(summed)(copies, several_bands(names, angle.dtype)))

    copies = jax.tree.map(lambda x: jnp.broadcast_to(x, (len(names), *x.shape)), atmosphere)
    found = jax.grad(of_all)(copies)
    for k, name in enumerate(names):
        own = jax.grad(summed)(atmosphere, BANDS[name])
        for x, y in zip(jax.tree.leaves(found), jax.tree.leaves(own), strict=True):
            np.testing.assert_allclose(x[k], y, rtol=1e-11, atol=1e-14)


def test_no_plumes(make_atmosphere):
    atmosphere = make_atmosphere(plumes={})
    assert len(column_optics(atmosphere, BANDS["C03"]).scatterers) == 2


def test_columns_of_numpy(make_atmosphere):
    """What is read of files is given as it is."""
    atmosphere = make_atmosphere(plumes={})
    mass = jnp.zeros(atmosphere.height.size - 1).at[1].set(1e-3)
    crystals = {"ice": Hydrometeor(mass, 1e9 * mass)}
    atmosphere = dataclasses.replace(atmosphere, hydrometeors=crystals)

    def flat(given):
        optics = column_optics(given, BANDS["C06"])
        forward = optics.phase_function(jnp.asarray(0.9))
        return jnp.concatenate([optics.tau[0], optics.moments(5).ravel(), forward])

    found = flat(jax.tree.map(np.asarray, atmosphere))
    np.testing.assert_allclose(found, flat(atmosphere), rtol=1e-14)


def test_vmap_of_columns(make_atmosphere):
    atmosphere = make_atmosphere()
    batch = jax.tree.map(lambda leaf: jnp.stack([leaf, 0.9 * leaf]), atmosphere)
    one = outputs(jax.tree.map(lambda leaf: leaf[1], batch), "C06")
    both = jax.vmap(lambda column: outputs(column, "C06"))(batch)
    np.testing.assert_allclose(both[1], one, rtol=1e-13)


@pytest.mark.parametrize("band", ["C06"])  # bands differ in constants alone
def test_derivatives_to_every_number_against_differences(make_atmosphere, band):
    atmosphere = make_atmosphere()
    atmosphere = dataclasses.replace(atmosphere, plumes={"smoke": atmosphere.plumes["smoke"]})
    # A state in units of itself; zeros of the cloud in units of its largest value.
    scale = jax.tree.map(lambda leaf: jnp.where(leaf == 0, jnp.max(leaf), leaf), atmosphere)
    scale, _ = ravel_pytree(scale)
    state, unravel = ravel_pytree(atmosphere)

    def relative(x):
        return outputs(unravel(state + x * scale), band)

    @jax.jit
    @jax.vmap
    def along(x, direction):
        """Value and derivative, so that differences need no compilation of their own."""
        return jax.jvp(relative, (x,), (direction,))

    directions = jnp.eye(state.size)
    forward = along(jnp.zeros_like(directions), directions)[1].T
    ahead, behind = (along(sign * STEP * directions, directions)[0].T for sign in (1, -1))
    differences = (ahead - behind) / (2 * STEP)
    reverse = jax.jit(jax.jacrev(relative))(jnp.zeros_like(state))
    assert np.max(np.abs(differences)) > 1
    np.testing.assert_allclose(forward, reverse, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(forward, differences, rtol=1e-6, atol=DIFFERENCE)


def with_smoke(atmosphere, **changed):
    changed = jax.tree.map(lambda leaf: jnp.asarray(leaf, atmosphere.pressure.dtype), changed)
    plume = dataclasses.replace(atmosphere.plumes["smoke"], **changed)
    return dataclasses.replace(atmosphere, plumes=atmosphere.plumes | {"smoke": plume})


def zero_brightness(atmosphere):
    return with_smoke(atmosphere, brightness=0.0)


def edges_on_levels(atmosphere):
    above_ground = atmosphere.height - atmosphere.height[-1]
    return with_smoke(atmosphere, base=above_ground[-2], top=above_ground[-4])


def isotropic_and_black(atmosphere):
    black = {"C01": 0.0, "C06": 0.0}
    return with_smoke(atmosphere, ssa=black, asymmetry=black)


def no_air(atmosphere):
    return dataclasses.replace(atmosphere, pressure=jnp.zeros_like(atmosphere.pressure))


def no_cloud(atmosphere):
    empty = jax.tree.map(jnp.zeros_like, atmosphere.liquid)
    return dataclasses.replace(atmosphere, liquid=empty)


@pytest.mark.float32
@pytest.mark.parametrize("mode", JACOBIANS)
@pytest.mark.parametrize("band", ["C01", "C06"])
@pytest.mark.parametrize(
    "change", [zero_brightness, edges_on_levels, isotropic_and_black, no_air, no_cloud]
)
def test_derivatives_are_finite_at_the_edges_of_the_state(make_atmosphere, change, band, mode):
    for dtype in ("float32", "float64") if jax.config.jax_enable_x64 else ("float32",):
        atmosphere = change(make_atmosphere(dtype=dtype))
        jacobian = JACOBIANS[mode](atmosphere, band)
        assert all(leaf.dtype == dtype for leaf in jax.tree.leaves(jacobian))
        assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(jacobian))


@pytest.mark.float32
@pytest.mark.parametrize("band", ["C01", "C06"])
def test_float32_column(make_atmosphere, band):
    atmosphere = make_atmosphere(dtype=jnp.float32)
    optics = column_optics(atmosphere, BANDS[band])
    kinds = {leaf.dtype for leaf in jax.tree.leaves(optics)}  # numbers, and where there is any
    assert kinds == {jnp.dtype(jnp.float32), jnp.dtype(bool)}
    assert "f64" not in str(jax.make_jaxpr(outputs, static_argnums=1)(atmosphere, band))

    pressure = np.asarray(atmosphere.pressure, np.float64)
    air = STANDARD_DEPTH[band] * pressure[-1] / STANDARD_PRESSURE
    plumes = sum(
        float(plume.aod_550) * float(plume.relative_extinction[band])
        for plume in atmosphere.plumes.values()
    )
    cloud = float(liquid_cloud(atmosphere, BANDS[band]).tau.sum())
    np.testing.assert_allclose(optics.tau.sum(), air + plumes + cloud, rtol=FLOAT32)


@pytest.mark.parametrize("band", ["C06"])
def test_float32_is_close_to_float64(make_atmosphere, band):
    single = outputs(make_atmosphere(dtype=jnp.float32), band)
    double = outputs(make_atmosphere(), band)
    np.testing.assert_allclose(single, double, rtol=FLOAT32, atol=FLOAT32)
