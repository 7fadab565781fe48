"""Radiances of sun, ground and fires against Planck, Beer and the reflectances."""

import dataclasses
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from states import stacked

import abi_operator
from abi_operator import (
    Fire,
    Geometry,
    State,
    radiance,
    reflectance_factor,
    standard_atmosphere,
)
from abi_operator.bands import BANDS
from abi_operator.instrument import range_ceiling
from abi_operator.optics import gas_absorption, rayleigh, transmittance
from abi_operator.planck import brightness_temperature, in_band_radiance
from abi_operator.radiance import sunlight
from abi_operator.satellites import solar_irradiance

LEVELS = np.linspace(30e3, 0.0, 9)
OPTIONS = {"num_streams": 2, "num_modes": 1, "num_doublings": 1}
NIGHT = Geometry(jnp.asarray(2.0), jnp.asarray(0.5), jnp.asarray(1.0))
SEEN = ("C02", "C06", "C07")
DAY = Geometry(jnp.asarray(0.6), jnp.asarray(0.5), jnp.asarray(1.0))


def make_state(geometry=DAY, albedo=0.2, **changes):
    air = standard_atmosphere("us_standard", LEVELS)
    albedos = {band: jnp.asarray(albedo) for band in BANDS}
    state = State(air, albedos, geometry, surface_temperature=jnp.asarray(300.0))
    return dataclasses.replace(state, **changes)


def without_gases(state):
    """With none of those that it could lack; it keeps its oxygen and nitrogen."""
    nothing = jax.tree.map(jnp.zeros_like, state.atmosphere.gases)
    return dataclasses.replace(
        state, atmosphere=dataclasses.replace(state.atmosphere, gases=nothing)
    )


def seen(*states):
    """Radiances of columns by band.

    Every test asks for the same bands of a batch, so that there are two programs: with fires and
    without.
    """
    return dict(zip(SEEN, np.asarray(radiance(stacked(states), SEEN, **OPTIONS)).T, strict=True))


@cache
def reflected():
    """Reflectance factors of all bands: over two grounds, and of the first without gases."""
    states = make_state(), make_state(albedo=0.5), without_gases(make_state())
    factors = reflectance_factor(stacked(states), tuple(BANDS), **OPTIONS)
    return dict(zip(BANDS, np.asarray(factors).T, strict=True))


def test_without_emission_it_is_the_reflectance():
    found = seen(make_state(), make_state(albedo=0.5))
    for band in ("C02", "C06"):
        expected = reflected()[band][:2] * solar_irradiance(band, "GOES-16") / np.pi
        np.testing.assert_allclose(found[band], expected, rtol=1e-13)


def test_isothermal_air_over_a_black_ground_is_a_black_body():
    state = make_state(NIGHT, albedo=0.0)
    warm = jnp.full(len(LEVELS), 300.0)
    state = dataclasses.replace(
        state, atmosphere=dataclasses.replace(state.atmosphere, temperature=warm)
    )
    temperature = brightness_temperature(jnp.asarray(seen(state, state)["C07"]), "C07")
    # Nothing shines on its top, so it lacks what scattering sends back of that: 1e-5 of it.
    np.testing.assert_allclose(temperature, 300.0, atol=1e-3)


def test_a_ground_shines_through_thin_air():
    clear = without_gases(make_state(NIGHT))
    clear = dataclasses.replace(
        clear, atmosphere=dataclasses.replace(clear.atmosphere, pressure=1e-3 * LEVELS[::-1])
    )
    expected = 0.8 * in_band_radiance(jnp.asarray(300.0), "C07")
    np.testing.assert_allclose(seen(clear, clear)["C07"], expected, rtol=1e-5)


def test_gases_dim_a_fire_by_their_transmittance():
    hot = make_state(NIGHT, albedo=0.0, fire=Fire(jnp.asarray(0.04), jnp.asarray(900.0)))
    cold = dataclasses.replace(hot, fire=Fire(jnp.asarray(0.0), jnp.asarray(900.0)))
    found = seen(hot, cold)
    assert np.all(found["C02"] == 0)

    @jax.jit
    def clear_air(air):
        each = {name: BANDS[name] for name in ("C06", "C07")}
        absorbed = {name: gas_absorption(air, x) + rayleigh(air, x) for name, x in each.items()}
        return {name: transmittance(x, 1 / hot.geometry.mu) for name, x in absorbed.items()}

    for name, clear in clear_air(hot.atmosphere).items():
        flames, ground = (in_band_radiance(jnp.asarray(t), name) for t in (900.0, 300.0))
        more = found[name][0] - found[name][1]
        # What air scatters, 3e-4 of it at most, is not in the transmittance.
        np.testing.assert_allclose(more, clear * 0.04 * (flames - ground), rtol=1e-3)


def test_a_small_fire_saturates_c07_and_not_c06():
    fire = Fire(jnp.asarray(0.04), jnp.asarray(750.0))
    found = seen(*[make_state(albedo=0.1, fire=fire)] * 2)
    assert np.all(found["C07"] > range_ceiling("C07", "GOES-16"))
    assert np.all(found["C06"] < range_ceiling("C06", "GOES-16"))


def test_batches_are_columns_and_night_is_dark():
    """In the band that emits; those of sunlight alone are in `test_reflectance`."""
    states = [make_state(DAY), make_state(NIGHT)]
    found = np.stack(list(seen(*states).values()), axis=1)
    for k, state in enumerate(states):
        alone = radiance(state, ("C07",), **OPTIONS)
        np.testing.assert_allclose(found[k, 2:], alone, rtol=1e-12, atol=1e-15)
    assert found[1, 0] == found[1, 1] == 0
    assert found[1, 2] > 0
    nowhere = dataclasses.replace(states[0].geometry, solar_zenith=jnp.asarray(np.nan))
    lost = dataclasses.replace(states[0], geometry=nowhere)
    traced = jax.jit(lambda s: radiance(s, ("C07",), **OPTIONS))(lost)
    assert np.isnan(traced).all()  # a sun that is nowhere is not below the horizon


@pytest.mark.slow
def test_derivatives_in_temperatures_and_fire():
    state = make_state(fire=Fire(jnp.asarray(0.01), jnp.asarray(800.0)))
    moved = (
        (lambda s: s.fire.temperature, 1e-2),
        (lambda s: s.fire.fraction, 1e-5),
        (lambda s: s.surface_temperature, 1e-2),
        (lambda s: s.albedo["C07"], 1e-4),
    )

    def total(batch):
        return jnp.sum(radiance(batch, SEEN[1:], **OPTIONS))

    slopes = jax.grad(total)(jax.tree.map(jnp.asarray, stacked([state, state])))
    assert all(jnp.all(jnp.isfinite(x)) for x in jax.tree.leaves(slopes))
    ends = []
    for read, step in moved:
        for sign in (1, -1):
            leaves, tree = jax.tree.flatten(state)
            leaves = [x + sign * step if x is read(state) else x for x in leaves]
            ends.append(jax.tree.unflatten(tree, leaves))
    found = seen(*ends)
    totals = (found["C06"] + found["C07"]).reshape(-1, 2)
    for (read, step), (above, below) in zip(moved, totals, strict=True):
        difference = (above - below) / (2 * step)
        np.testing.assert_allclose(read(slopes), difference, rtol=1e-5)


def test_brightness_temperature_of_a_state_is_that_of_its_radiance():
    state = make_state()
    expected = brightness_temperature(jnp.asarray(seen(state, state)["C07"][0]), "C07")
    found = abi_operator.brightness_temperature(state, **OPTIONS)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_refused():
    cold = make_state(surface_temperature=None)
    with pytest.raises(ValueError, match="C07.* needs surface_temperature"):
        radiance(cold, ("C07",))
    with pytest.raises(ValueError, match="gas absorption of C04 is not that of GOES-19"):
        radiance(make_state(), ("C04",), satellite="GOES-19")
    with pytest.raises(ValueError, match="GOES-20"):
        radiance(make_state(), ("C01",), satellite="GOES-20")


@pytest.mark.parametrize(
    ("distance", "message"),
    [
        (
            np.ones((2, 1)),
            r"has shape \(2, 1\), but solar_zenith has \(2,\): allowed is one number",
        ),
        (np.ones(3), r"has shape \(3,\), but"),
        (1.496e8, r"is 149600000\.0; allowed is 0\.9 to 1\.1 AU"),
        (np.array([1.0, 0.0]), r"is 0\.0; allowed"),
        (jnp.asarray([jnp.nan, 1.0]), "is nan; allowed"),
    ],
)
def test_distances_of_the_sun_are_checked(distance, message):
    with pytest.raises(ValueError, match="^sun_distance " + message):
        radiance(stacked([make_state()] * 2), SEEN, sun_distance=distance, **OPTIONS)


def test_each_column_has_its_own_sun():
    mu0, distance = np.array([0.5, 0.8, -0.1]), np.array([0.983, 1.017, 1.0])
    expected = solar_irradiance("C01", "GOES-16") * np.array([0.983**-2, 1.017**-2, 0.0])
    for one in (distance, jnp.asarray(distance)):
        found = sunlight(jnp.asarray(mu0), ("C01",), "GOES-16", one)["C01"]
        np.testing.assert_allclose(found, expected, rtol=1e-14)
    for one in (1.0, np.ones(1)):
        assert sunlight(jnp.asarray(mu0), ("C01",), "GOES-16", one)["C01"].shape == (3,)


def test_a_hot_ground_needs_a_fire_to_shine_in_c06():
    hot = make_state(surface_temperature=jnp.asarray(800.0))
    message = r"is 800 K, and without a fire .* in \['C06'\]: allowed is 350 K .* Fire\(fraction=0"
    with pytest.raises(ValueError, match=message):
        radiance(stacked([make_state(), hot]), SEEN, **OPTIONS)
    told = dataclasses.replace(hot, fire=Fire(jnp.asarray(0.0), jnp.asarray(900.0)))
    assert np.all(seen(told, told)["C06"] > 100 * seen(make_state(), make_state())["C06"])


def test_eight_bands_and_their_gases():
    dimmed, _, clear = ({band: x[k] for band, x in reflected().items()} for k in range(3))
    assert all(dimmed[band] < clear[band] for band in BANDS)
    assert dimmed["C04"] < 0.01 < clear["C04"]  # vapour hides the ground
