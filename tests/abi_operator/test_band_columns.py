"""Several bands at once against one after the other: layers, emission, ground and their slopes."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator import Fire, Geometry, Hydrometeor, LiquidCloud, State, smoke
from abi_operator.band_columns import columns_of_bands
from abi_operator.bands import BANDS, OneOf, by_band, constants, entry, several_bands
from abi_operator.optics import ALL_GASES, column_optics, mie_plume, num_terms
from abi_operator.planck import in_band_radiance
from abi_operator.solver import cos_scattering_angle
from abi_operator.standard_atmospheres import standard_atmosphere
from abi_operator.surface import RossLi, surface_emission

# Several terms and one, in sunlight alone and emitting; not in the order of their names.
NAMES = ("C04", "C02", "C07")
EMITTING = ("C07",)
NUM_MOMENTS = 4
ROUNDING = 1e-13
# Slopes add and subtract what is up to a thousand times as large.
SLOPES = 1e-10
HEIGHT = np.array([30e3, 8e3, 4e3, 1e3, 0.0])  # [m]


def state_with(liquid, plumes, hydrometeors):
    """A column of four layers with gases and a fire."""
    air = standard_atmosphere("midlatitude_summer", HEIGHT, plumes=plumes)
    air = dataclasses.replace(air, liquid=liquid, hydrometeors=hydrometeors)
    grounds = {name: 0.1 + 0.05 * k for k, name in enumerate(NAMES)}
    state = State(air, grounds, Geometry(0.6, 0.9, 1.3), 291.0, Fire(0.01, 950.0))
    return jax.tree.map(jnp.asarray, state), {"C07": jnp.asarray(9.6)}


def smoky():
    """Plumes of both kinds about a cloud of droplets."""
    mass = np.array([0, 0, 0.1, 0.02])
    plumes = {
        "smoke": smoke(0.4, base=500.0, top=3000.0, bands=NAMES),
        "ash": mie_plume("ash", 0.3, 2.2, base=5000.0, top=7500.0),
    }
    return state_with(LiquidCloud(mass, mass / 1.2e-11), plumes, {})


def cloudy():
    """Droplets by table, ice and rain."""
    mass = np.array([0, 0.02, 0.1, 0])
    particles = {
        "ice": Hydrometeor(mass, mass / 1e-10),
        "rain": Hydrometeor(mass, mass / 1e-8),
    }
    return state_with(LiquidCloud(mass, mass / 1.2e-11, optics="mie"), {}, particles)


def one_band(inputs, name):
    """Of one band: what the solver is given, from the functions of single bands, and weights."""
    state, sun = inputs
    geometry = state.geometry
    optics = column_optics(state.atmosphere, BANDS[name])
    angles = geometry.mu0, geometry.mu, geometry.relative_azimuth
    shared = {
        "moments": optics.moments(NUM_MOMENTS),
        "phase_function": optics.phase_function(cos_scattering_angle(*angles)),
        "albedo": state.albedo[name],
    } | dict(zip(("mu0", "mu", "relative_azimuth"), angles, strict=True))
    if name in EMITTING:
        hot, ground = (
            in_band_radiance(t, name) for t in (state.fire.temperature, state.surface_temperature)
        )
        shared["solar_irradiance"] = sun[name]
        shared["planck_levels"] = in_band_radiance(state.atmosphere.temperature, name)
        leaving = surface_emission(state.albedo[name], ground, hot, state.fire.fraction)
        shared["surface_emission"] = leaving
    count = optics.weight.shape[0]
    repeated = {k: jnp.broadcast_to(x, (count, *x.shape)) for k, x in shared.items()}
    return repeated | {"tau": optics.tau, "ssa": optics.ssa, "weight": optics.weight}


def all_bands(inputs, per_band=False):
    """The same of all bands, by one call."""
    state, sun = inputs
    groups = columns_of_bands(
        state,
        NAMES,
        ALL_GASES,
        NUM_MOMENTS,
        per_band=per_band,
        emitting=EMITTING,
        solar_irradiance=sun,
    )
    found = {}
    for group in groups:
        given = group.arguments | {"weight": group.weight}
        for place, name in enumerate(group.bands):
            own = np.flatnonzero(np.asarray(group.places) == place)
            found[name] = jax.tree.map(lambda x, own=own: x[own], given)
    return found


def contracted(outputs):
    """Weighted sum of all outputs, each in units of its largest value."""
    weights = np.random.default_rng(3)
    total = 0.0
    for _, x in sorted(outputs.items()):
        weight = jnp.asarray(weights.uniform(0.5, 1, x.shape))
        total = total + jnp.vdot(x, weight) / jax.lax.stop_gradient(jnp.max(jnp.abs(x)))
    return total


def of_all(inputs, per_band=False):
    """Weighted sum of the outputs of all bands, and these."""
    found = all_bands(inputs, per_band)
    return sum([contracted(found[name]) for name in NAMES[1:]], contracted(found[NAMES[0]])), found


@functools.cache
def slopes_of_copies():
    """Every array of the state copied, and pulled back at once: slopes of each band in its row."""
    copies = jax.tree.map(lambda x: jnp.stack([x] * len(NAMES)), smoky())
    pulled = jax.jit(jax.grad(functools.partial(of_all, per_band=True), has_aux=True))
    slopes, found = pulled(copies)
    return dict_of(slopes), found


def dict_of(tree):
    return {jax.tree_util.keystr(k): x for k, x in jax.tree_util.tree_leaves_with_path(tree)}


def test_values_and_slopes_are_those_of_one_band(name="C07"):
    def weighted(inputs):
        outputs = one_band(inputs, name)
        return contracted(outputs), outputs

    expected, outputs = jax.jit(jax.grad(weighted, has_aux=True))(smoky())
    slopes, found = slopes_of_copies()
    assert found[name].keys() == outputs.keys()
    for key, x in outputs.items():
        np.testing.assert_allclose(found[name][key], x, rtol=ROUNDING, err_msg=key)
    for label, x in dict_of(expected).items():
        own, atol = slopes[label][NAMES.index(name)], SLOPES * np.max(np.abs(x))
        np.testing.assert_allclose(own, x, rtol=SLOPES, atol=atol, err_msg=label)


def test_slopes_of_copies_are_finite_and_of_the_own_band():
    slopes, _ = slopes_of_copies()
    for label, x in slopes.items():
        assert np.all(np.isfinite(x)), label
        owner = [k for k, name in enumerate(NAMES) if f"['{name}']" in label]
        moved = np.flatnonzero(np.any(x.reshape(len(NAMES), -1), axis=1))
        assert not owner or moved.tolist() == owner, label


def test_forward_mode_equals_reverse():
    """Along one direction, of arrays that all bands share."""
    inputs, rng = smoky(), np.random.default_rng(7)
    direction = jax.tree.map(lambda x: x * rng.uniform(-1, 1), inputs)

    @jax.jit
    def forward(inputs, direction):
        return jax.jvp(lambda x: of_all(x)[0], (inputs,), (direction,))[1]

    slopes, _ = slopes_of_copies()
    along = sum(jnp.vdot(jnp.sum(slopes[k], axis=0), y) for k, y in dict_of(direction).items())
    np.testing.assert_allclose(forward(inputs, direction), along, rtol=1e-10)


@pytest.mark.parametrize("make", [smoky, cloudy])
def test_a_batch_behind_is_its_columns(make):
    """With axes of a batch behind those of every array, and of all layers where there are any."""
    state, sun = make()
    low = dataclasses.replace(state.geometry, spherical=True, solar_zenith=jnp.asarray(1.25))
    first = dataclasses.replace(state, geometry=low), sun
    second = jax.tree.map(lambda x: 0.97 * x, first)
    third = jax.tree.map(jnp.copy, first)
    empty = jnp.zeros_like(state.atmosphere.liquid.mass_path)
    dry = dataclasses.replace(state.atmosphere.liquid, mass_path=empty, number_path=empty)
    air = dataclasses.replace(state.atmosphere, liquid=dry)
    third = dataclasses.replace(third[0], atmosphere=air), sun
    columns = [first, second, third]
    batch = jax.tree.map(lambda *x: jnp.stack(x, axis=-1), *columns)
    alone = jax.jit(lambda columns: [all_bands(x) for x in columns])(columns)
    together = jax.jit(all_bands)(batch)
    for k, column in enumerate(alone):
        for name in NAMES:
            for key, x in column[name].items():
                own = together[name][key]
                own = own if key == "weight" else own[..., k]
                np.testing.assert_allclose(own, x, rtol=ROUNDING, err_msg=f"{name} {key}")


@pytest.mark.slow
def test_values_of_clouds():
    """Of arrays that all bands share."""
    inputs = cloudy()

    @jax.jit
    def both(inputs):
        return all_bands(inputs), {name: one_band(inputs, name) for name in NAMES}

    together, alone = both(inputs)
    for name in NAMES:
        for key, x in alone[name].items():
            found = together[name][key]
            np.testing.assert_allclose(found, x, rtol=ROUNDING, err_msg=f"{name} {key}")


def test_terms_are_summed_by_weight():
    state, _ = smoky()
    groups = jax.eval_shape(lambda s: columns_of_bands(s, NAMES, ALL_GASES, 3), state)
    (group,) = groups
    counts = [num_terms(name, ALL_GASES) for name in NAMES]
    assert [group.places.count(k) for k in range(len(NAMES))] == counts == [4, 1, 4]
    weight = jnp.arange(1.0, 10.0)
    group = dataclasses.replace(group, weight=weight)
    terms = jnp.stack([weight, 2 * weight], axis=1)
    found = group.summed(terms)
    for place, name in enumerate(NAMES):
        own = np.flatnonzero(np.asarray(group.places) == place)
        expected = np.sum(np.asarray(weight[:, None] * terms)[own], axis=0)
        np.testing.assert_allclose(found[name], expected, rtol=1e-15)


def test_kinds_of_ground_and_of_light_are_groups():
    """Traced only: names, and the shapes of arguments; also of bands out of order."""
    (state, sun) = smoky()
    kernels = RossLi(*(jnp.asarray(x) for x in (0.2, 0.1, 0.02)))
    state = dataclasses.replace(state, albedo=state.albedo | {"C02": kernels, "C07": kernels})

    def columns(inputs, per_band):
        return columns_of_bands(
            inputs[0],
            NAMES,
            (),
            3,
            per_band=per_band,
            emitting=EMITTING,
            solar_irradiance=inputs[1],
        )

    copies = jax.tree.map(lambda x: jnp.stack([x] * len(NAMES)), (state, sun))
    for inputs, per_band in (((state, sun), False), (copies, (True, True))):
        groups = jax.eval_shape(functools.partial(columns, per_band=per_band), inputs)
        assert [(x.bands, x.emit) for x in groups] == [
            (("C04",), False),
            (("C02",), False),
            (("C07",), True),
        ]
        for group in groups:
            assert group.arguments["tau"].shape == (1, 4)
            assert group.arguments["moments"].shape == (1, 4, 3)
            assert isinstance(group.arguments["albedo"], RossLi) == (group.bands[0] in "C02 C07")
            assert all(x.shape == (1,) for x in jax.tree.leaves(group.arguments["albedo"]))
            assert ("planck_levels" in group.arguments) == group.emit


def test_what_a_band_lacks_is_named():
    state, _ = smoky()
    plumes = state.atmosphere.plumes
    plume = dataclasses.replace(plumes["smoke"], ssa={"C02": jnp.asarray(0.9)})
    air = dataclasses.replace(state.atmosphere, plumes=plumes | {"smoke": plume})
    poor = dataclasses.replace(state, atmosphere=air)
    with pytest.raises(ValueError, match="ssa of plume 'smoke' is not specified in band 'C04'"):
        jax.eval_shape(lambda s: columns_of_bands(s, NAMES, (), 3), poor)
    air = dataclasses.replace(state.atmosphere, temperature=None)
    cold = dataclasses.replace(state, atmosphere=air)
    with pytest.raises(ValueError, match="needs atmosphere.temperature"):
        jax.eval_shape(lambda s: columns_of_bands(s, NAMES, ALL_GASES, 3), cold)
    jax.eval_shape(lambda s: columns_of_bands(s, ("C02",), ALL_GASES, 3), cold)


def test_constants_and_mappings_of_the_band_at_hand():
    table = {"C01": (1.0, 5.0), "C02": (2.0, 5.0)}
    found = jax.vmap(lambda band: jnp.stack(constants(table.__getitem__, band.name, float)))(
        several_bands(("C02", "C01"), float)
    )
    np.testing.assert_array_equal(found, [[2, 5], [1, 5]])
    assert constants(table.__getitem__, "C02", float) == (2.0, 5.0)
    with pytest.raises(ValueError, match="must be of one kind"):
        entry({"C01": 1, "C02": 2}, OneOf(("C01", "C02"), jnp.asarray(0)))
    assert entry({"C01": 1, "C02": 2}, OneOf(("C02",), jnp.asarray(0))) == 2
    given = {"a": {"C01": jnp.asarray([1.0, 2.0]), "C02": jnp.asarray([3.0, 4.0])}}
    tree, copied = by_band(given, {"a": {"C01": True, "C02": True}}, ("C02", "C01"))
    np.testing.assert_array_equal(tree["a"].own, [3, 2])
    assert copied["a"].own is True


@pytest.mark.float32
def test_float32_stays():
    """No operation of double precision, forwards or backwards."""
    inputs = jax.tree.map(lambda x: x.astype(jnp.float32), smoky())

    def slopes(inputs):
        found, pull_back = jax.vjp(all_bands, inputs)
        return pull_back(found)

    assert "f64" not in str(jax.make_jaxpr(slopes)(inputs))
