"""Meaning of x, and the prior."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator import (
    Atmosphere,
    Fire,
    Geometry,
    LiquidCloud,
    State,
    ash,
    mie_plume,
    smoke,
)
from abi_operator.optics import effective_radius, mie_optics
from retrievals import Bounded, Prior, Quantity, StateVector, Unbounded
from retrievals.declarations import (
    albedo,
    aod_550,
    assumed_of_plume,
    fire,
    liquid_cloud,
    plume,
)
from retrievals.kinds import BANDS
from retrievals.quantities import part, replaced, scaled

AOD_550 = np.array([1e-4, 0.05, 0.7, 3.0, 9.9])
ROUNDING = 1e-12


def shifted(ssa, shift):
    """Single-scattering albedo with `shift` added to its logit."""
    return 1 / (1 + (1 - ssa) / ssa * np.exp(-shift))


@pytest.fixture(scope="module")
def state():
    """One column with a plume of each kind, cloud in two of three layers, and a fire."""
    mass, number = np.array([0.0, 0.02, 0.06]), np.array([0.0, 3e10, 4e10])
    plumes = {
        "smoke": smoke(0.2, brightness=0.3, bands=BANDS),
        "ash": ash(0.5, bands=BANDS),
        "dust": mie_plume("dust", 0.3, 1.5, base=0.0, top=2e3),
    }
    air = Atmosphere(
        jnp.array([0.0, 3e4, 8e4, 1e5]),
        jnp.array([3e4, 9e3, 2e3, 0.0]),
        LiquidCloud(jnp.asarray(mass), jnp.asarray(number)),
        plumes,
    )
    albedo = {band: jnp.asarray(0.1) for band in BANDS}
    return State(
        air,
        albedo,
        Geometry(*(jnp.asarray(angle) for angle in (0.6, 0.8, 1.2))),
        jnp.asarray(300.0),
        Fire(jnp.asarray(0.01), jnp.asarray(700.0)),
    )


@pytest.mark.parametrize(
    ("transform", "values"),
    [
        (Bounded(0.0, 10.0), AOD_550),
        (Bounded(350.0, 1800.0), np.array([351.0, 900.0, 1799.0])),
        (Bounded(0.043, 0.56, logarithmic=True), np.array([0.05, 0.1, 0.5])),
        (Unbounded(), np.array([-2.0, 0.0, 2.0])),
    ],
)
def test_transforms_are_smooth_and_have_an_inverse(transform, values):
    x = transform.x(jnp.asarray(values))
    np.testing.assert_allclose(transform.value(x), values, rtol=ROUNDING)
    _, slope = jax.jvp(transform.value, (x,), (jnp.ones_like(x),))
    np.testing.assert_allclose(transform.slope(x), slope, rtol=ROUNDING)
    wild = jnp.array([-500.0, 500.0, 0.0])
    value, slope = jax.jvp(transform.value, (wild,), (jnp.ones_like(wild),))
    assert np.isfinite(value).all() and np.isfinite(slope).all()
    if isinstance(transform, Bounded):
        assert (value >= transform.lower).all() and (value <= transform.upper * 1.000001).all()


def test_mass_loading_is_that_of_another_reckoning():
    """0.216 m2 g-1 of ash of 3 um, ln 2 wide, at 2.6 g cm-3, by Mie theory at 555 nm."""
    (item,) = plume("ash", effective_radius=True).derived
    assert item.name == "mass_loading" and item.needs == ("aod_550", "effective_radius_um")

    def mass(radius_um):
        return item.read(None, jnp.asarray(0.5), radius_um)

    np.testing.assert_allclose(mass(jnp.asarray(3.0)), 0.5 / 0.216, rtol=5e-3)
    slope = jax.grad(mass)(jnp.asarray(3.0))
    low, high = (mass(jnp.asarray(r)) for r in (2.999, 3.001))
    np.testing.assert_allclose(slope, (high - low) / 0.002, rtol=1e-6)


def test_mass_loading_has_the_error_of_what_it_is_made_of(state):
    vector = plume("dust", effective_radius=True)
    x, covariance = vector.x(0.5, 3.0), jnp.asarray([[0.04, -0.01], [-0.01, 0.09]])
    found = vector.report(x, state, covariance)
    (item,) = vector.derived

    def mass(x):
        return float(item.read(None, *vector.values(jnp.asarray(x)).values()))

    step = 1e-6
    slopes = [(mass(x + step * unit) - mass(x - step * unit)) / (2 * step) for unit in np.eye(2)]
    np.testing.assert_allclose(found["mass_loading"], mass(x), rtol=ROUNDING)
    expected = np.sqrt(slopes @ np.asarray(covariance) @ slopes)
    np.testing.assert_allclose(found["mass_loading_sigma"], expected, rtol=1e-6)


def test_limits_are_in_order():
    for limits in ((1.0, 1.0), (2.0, 1.0), (0.0, np.inf)):
        with pytest.raises(ValueError, match="lower < upper"):
            Bounded(*limits)
    with pytest.raises(ValueError, match="0 < lower"):
        Bounded(0.0, 1.0, logarithmic=True)
    with pytest.raises(ValueError, match="aod_limit must be positive; got 0"):
        plume("smoke", aod_limit=0.0)


def test_x0_is_the_logarithm_of_thin_smoke():
    vector = plume("smoke")
    np.testing.assert_allclose(vector.x(2e-4) - vector.x(1e-4), np.log(2), rtol=2e-5)


def test_a_plume_gets_optical_depth_and_albedo_and_keeps_the_rest(state):
    vector, before = plume("smoke", ssa=True), state.atmosphere.plumes["smoke"]
    x = vector.x(1.7, -0.6)
    assert vector.names == ("aod_550", "ssa_shift") and x.shape == (2,)
    found = vector.state(x, state)
    after = found.atmosphere.plumes["smoke"]
    np.testing.assert_allclose(after.aod_550, 1.7, rtol=ROUNDING)
    np.testing.assert_allclose(vector.held(found, "aod_550"), 1.7, rtol=ROUNDING)
    for band in BANDS:
        np.testing.assert_allclose(after.ssa[band], shifted(before.ssa[band], -0.6), rtol=ROUNDING)
    assert (after.base, after.top) == (before.base, before.top)
    assert after.relative_extinction == before.relative_extinction
    assert found.albedo == state.albedo and found.atmosphere.plumes["ash"].aod_550 == 0.5


def test_an_effective_radius_sets_what_a_shift_refines(state):
    vector = plume("ash", ssa=True, effective_radius=True)
    found = vector.state(vector.x(0.8, 0.5, 2.0), state).atmosphere.plumes["ash"]
    for band in BANDS:
        spheres = mie_optics("ash", jnp.asarray(2.0), band)
        expected = shifted(1 - spheres.coalbedo, 0.5)
        np.testing.assert_allclose(found.ssa[band], expected, rtol=ROUNDING)
        np.testing.assert_allclose(found.asymmetry[band], spheres.asymmetry, rtol=ROUNDING)
    mie = plume("dust", effective_radius=True)
    found = mie.state(mie.x(0.8, 4.0), state)
    np.testing.assert_allclose(mie.held(found, "effective_radius_um"), 4.0, rtol=ROUNDING)
    np.testing.assert_allclose(mie.held(found, "aod_550"), 0.8, rtol=ROUNDING)


def test_of_what_a_radius_sets_nothing_is_assumed(state):
    """A shift of the asymmetry factor would be lost under that of the radius, without an error."""
    radius = StateVector(plume("ash", effective_radius=True).quantities[1:])
    bare = jax.tree.map(jnp.asarray, state)

    def seen(assumed, by):
        shifted = assumed.state(assumed.prior(bare).x_prior + by, bare)
        return radius.state(radius.x(2.0), shifted)

    for retrieved, lost in ((False, ["asymmetry_shift"]), (True, [])):
        assumed = assumed_of_plume("ash", BANDS, effective_radius=retrieved)
        same = [
            name
            for name, by in zip(assumed.names, 0.1 * np.eye(assumed.size), strict=True)
            if eqx.tree_equal(seen(assumed, by), seen(assumed, 0 * by))
        ]
        assert same == lost


def test_a_cloud_gets_optical_thickness_and_radius(state):
    vector = liquid_cloud()
    found = vector.state(vector.x(12.0, 8.0), state)
    np.testing.assert_allclose(vector.held(found, "cloud_optical_thickness"), 12, rtol=ROUNDING)
    np.testing.assert_allclose(effective_radius(found.atmosphere.liquid)[1:], 8e-6, rtol=ROUNDING)
    np.testing.assert_allclose(vector.held(found, "cloud_effective_radius_um"), 8, rtol=ROUNDING)
    mass = found.atmosphere.liquid.mass_path
    assert mass[0] == 0
    np.testing.assert_allclose(mass.sum(), 12 * 8e-6 * 1000 / 1.5, rtol=ROUNDING)


def test_fire_and_ground_are_leaves(state):
    vector = StateVector((*fire().quantities, albedo("C02")))
    found = vector.state(vector.x(900.0, 1e-3, 0.3), state)
    np.testing.assert_allclose(found.fire.temperature, 900, rtol=ROUNDING)
    np.testing.assert_allclose(found.fire.fraction, 1e-3, rtol=ROUNDING)
    np.testing.assert_allclose(found.albedo["C02"], 0.3, rtol=ROUNDING)
    assert found.albedo["C01"] == state.albedo["C01"]


def test_a_quantity_of_ones_own_is_a_declaration(state):
    """The height of the plume's top, and a factor of the mass of all cloud, in a few lines."""
    top = Quantity(
        "plume_top", "m", "upper edge", "atmosphere.plumes.smoke.top",
        Bounded(1200.0, 9000.0), replaced, sigma=0.5, mean=3000.0,
    )  # fmt: skip
    thicker = Quantity(
        "cloud_factor", "1", "factor of the cloud", "atmosphere.liquid", Unbounded(), scaled,
        sigma=0.1, mean=1.0,
    )  # fmt: skip
    vector = StateVector((top, thicker))
    found = vector.state(vector.x(2500.0, 1.1), state)
    np.testing.assert_allclose(found.atmosphere.plumes["smoke"].top, 2500, rtol=ROUNDING)
    np.testing.assert_allclose(found.atmosphere.liquid.mass_path[2], 0.066, rtol=ROUNDING)
    np.testing.assert_allclose(vector.prior().S_prior, np.diag([0.25, 0.01]))
    np.testing.assert_allclose(vector.values(vector.prior().x_prior)["plume_top"], 3000)


def test_what_a_state_lacks_is_named(state):
    with pytest.raises(ValueError, match="has no atmosphere.plumes.fog.*smoke.*ash.*dust"):
        vector = StateVector((aod_550("fog"),))
        vector.state(vector.x(0.3), state)
    with pytest.raises(ValueError, match="has no albedo.C07.*C01"):
        part(state, "albedo.C07")
    with pytest.raises(ValueError, match="value each of aod_550, ssa_shift; got 1"):
        plume("smoke", ssa=True).x(0.3)
    with pytest.raises(ValueError, match="aod_550.*twice"):
        StateVector((aod_550("smoke"), aod_550("ash")))
    with pytest.raises(ValueError, match="no Mie table of 'fog'"):
        plume("fog", effective_radius=True)


def test_reported_errors_are_propagated(state):
    vector = plume("smoke", ssa=True)
    x, covariance = vector.x(0.8, 0.3), jnp.array([[0.04, 0.01], [0.01, 0.09]])
    found = vector.report(x, state, covariance)
    for band in BANDS:
        ssa = shifted(state.atmosphere.plumes["smoke"].ssa[band], 0.3)
        np.testing.assert_allclose(found["ssa"][band], ssa, rtol=ROUNDING)
        np.testing.assert_allclose(found["ssa_sigma"][band], 0.3 * ssa * (1 - ssa), rtol=1e-9)


def test_priors_are_those_of_the_declarations_or_of_the_states(state):
    vector = StateVector((aod_550("smoke"), albedo("C01"), albedo("C02")))
    three = jax.tree.map(lambda x: jnp.broadcast_to(x, (3, *jnp.shape(x))), state)
    three = replace_albedo(three, jnp.array([0.1, 0.2, 0.3]))
    prior = vector.prior(three)
    assert prior.x_prior.shape == (3, 3)
    values = vector.values(jnp.asarray(prior.x_prior))
    np.testing.assert_allclose(values["albedo_C01"], [0.1, 0.2, 0.3], rtol=ROUNDING)
    np.testing.assert_allclose(values["aod_550"], 0.4, rtol=ROUNDING)
    with pytest.raises(ValueError, match="prior of albedo_C01 is that of states"):
        vector.prior()


def test_an_albedo_is_known_as_well_wherever_it_is(state):
    """Its error in x grows towards the limits, at which x has no number."""
    vector = StateVector((aod_550("smoke"), albedo("C01", 0.001)))
    four = jax.tree.map(lambda x: jnp.broadcast_to(x, (4, *jnp.shape(x))), state)
    means = np.array([0.0, 0.03, 0.3, np.nan])
    four.albedo["C01"] = jnp.asarray(means)
    prior = vector.prior(four).of_pixels(4, vector.names)
    assert np.isfinite(prior.x_prior).all(axis=1).tolist() == [True, True, True, False]
    np.testing.assert_allclose(np.sqrt(prior.S_prior[:, 0, 0])[:3], vector.quantities[0].sigma)
    values = vector.values(jnp.asarray(prior.x_prior))["albedo_C01"]
    np.testing.assert_allclose(values[:3], means[:3], atol=1.001e-4, rtol=0)
    np.testing.assert_allclose(values[1:3], means[1:3], rtol=ROUNDING)
    one = np.array([0.0, 1.0]) * np.sqrt(prior.S_prior[:, 1, 1])[:, None]
    low, high = (vector.values(jnp.asarray(prior.x_prior + k * one)) for k in (-1e-3, 1e-3))
    sigma = np.asarray(high["albedo_C01"] - low["albedo_C01"]) / 2e-3
    np.testing.assert_allclose(sigma[:3], 0.001, rtol=1e-4)


def replace_albedo(state, values):
    return StateVector((albedo("C01"),)).state(Bounded(0.0, 1.0).x(values)[:, None], state)


def test_the_whitened_prior_measures_departures_by_their_covariance():
    covariance = np.array([[0.5, 0.2], [0.2, 0.3]])
    x_prior, x = np.array([-2.0, 0.1]), np.array([-1.0, 0.4])
    residual = Prior(jnp.asarray(x_prior), jnp.asarray(covariance)).residual(jnp.asarray(x))
    expected = (x - x_prior) @ np.linalg.solve(covariance, x - x_prior)
    np.testing.assert_allclose(np.sum(residual**2), expected, rtol=ROUNDING)


def test_a_prior_fits_its_state_vector():
    names = plume("smoke", ssa=True).names
    fine = Prior(np.zeros(2), np.eye(2)).of_pixels(5, names)
    assert fine.x_prior.shape == (5, 2) and fine.S_prior.shape == (5, 2, 2)
    fine = Prior(np.zeros((5, 2)), np.eye(2)).of_pixels(5, names)
    assert fine.x_prior.shape == (5, 2)
    with pytest.raises(ValueError, match=r"x_prior has the shape \(1,\).*aod_550, ssa_shift"):
        Prior(np.zeros(1), np.eye(2)).of_pixels(5, names)
    with pytest.raises(ValueError, match=r"S_prior has the shape \(2,\)"):
        Prior(np.zeros(2), np.ones(2)).of_pixels(5, names)
    with pytest.raises(ValueError, match=r"x_prior has the shape \(4, 2\)"):
        Prior(np.zeros((4, 2)), np.eye(2)).of_pixels(5, names)
    with pytest.raises(ValueError, match="not symmetric"):
        Prior(np.zeros(2), np.array([[1.0, 0.5], [0.0, 1.0]])).of_pixels(5, names)
    unknown = np.stack([np.eye(2), np.full((2, 2), np.nan), 3 * np.eye(2)])
    own = Prior(np.zeros(2), unknown).of_pixels(3, names)
    assert np.isfinite(own.x_prior).all(axis=1).tolist() == [True, False, True]
    assert np.isfinite(own.S_prior).all() and (own.S_prior[2] == unknown[2]).all()
    with pytest.raises(ValueError, match="not finite"):
        Prior(np.zeros(2), unknown[1]).of_pixels(5, names)
    with pytest.raises(ValueError, match="eigenvalue of -1"):
        Prior(np.zeros(2), np.diag([1.0, -1.0])).of_pixels(5, names)
