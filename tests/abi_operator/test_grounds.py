"""Grounds other than Lambertian in a state, against the solver called by hand."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from states import stacked

from abi_operator import BANDS, Geometry, State, brf, radiance, standard_atmosphere
from abi_operator.optics import ALL_GASES, column_optics
from abi_operator.planck import in_band_radiance
from abi_operator.solver import cos_scattering_angle, toa_brf, toa_radiance
from abi_operator.surface import Lambertian, RossLi, directional_albedo, ocean, surface_emission

SEEN = ("C01", "C02", "C03", "C06")
OPTIONS = {"num_streams": 2, "num_doublings": 4}
LEVELS = np.linspace(20e3, 0.0, 5)


def make_state():
    """Air over land in C02, sea in C01 and C07, and Lambertian grounds given in both ways."""
    air = standard_atmosphere("us_standard", LEVELS)
    wind = jnp.asarray(6.0)
    grounds = {
        "C01": ocean(wind, "C01"),
        "C02": RossLi(*map(jnp.asarray, (0.2, 0.1, 0.03))),
        "C03": 0.3,
        "C06": Lambertian(jnp.asarray(0.25)),
        "C07": ocean(wind, "C07"),
    }
    geometry = Geometry(jnp.asarray(0.5), jnp.asarray(0.6), jnp.asarray(2.5))
    return State(air, grounds, geometry, surface_temperature=jnp.asarray(290.0))


@partial(jax.jit, static_argnums=(1, 2))
def made(state, band, gases):
    """What the solver is given of a band, and the weights of its terms."""
    geometry = state.geometry
    optics = column_optics(state.atmosphere, BANDS[band], gases)
    angles = geometry.mu0, geometry.mu, geometry.relative_azimuth
    phase_function = optics.phase_function(cos_scattering_angle(*angles))
    layers = optics.tau, optics.ssa, optics.moments(3)
    return layers, angles, phase_function, optics.weight


def by_hand(state, band, gases=ALL_GASES, **emission):
    """Reflectance, or radiance where emission is given, from the solver's own doors."""
    (tau, ssa, moments), angles, phase_function, weight = made(state, band, gases)
    door = toa_radiance if emission else toa_brf
    how = {"phase_function": phase_function} | emission | OPTIONS
    terms = door(tau, ssa, moments, state.albedo[band], *angles, **how)
    return np.sum(np.asarray(weight * terms))


def expected(gases, bands=SEEN):
    """Reflectances of the state in the bands that are seen."""
    return [by_hand(make_state(), band, gases) for band in bands]


@pytest.mark.slow
def test_equals_the_solver_called_by_hand():
    state = make_state()
    found = brf(stacked([state, state]), SEEN, **OPTIONS)
    np.testing.assert_allclose(found, [expected(ALL_GASES)] * 2, rtol=1e-12)


@pytest.mark.slow
def test_sea_shines_by_what_it_does_not_reflect():
    state = make_state()
    sea = state.albedo["C07"]
    mu, weight = np.polynomial.legendre.leggauss(48)
    mu = jnp.asarray((1 + mu) / 2)
    albedo = jnp.sum(jnp.asarray(weight) * mu * directional_albedo(sea, mu))
    # The means of 16 directions and of 48.
    np.testing.assert_allclose(sea.white_sky_albedo(), albedo, rtol=1e-7)
    ground = surface_emission(albedo, in_band_radiance(jnp.asarray(290.0), "C07"))
    levels = in_band_radiance(state.atmosphere.temperature, "C07")
    expected = by_hand(
        state, "C07", solar_irradiance=9.69, planck_levels=levels, surface_emission=ground
    )
    np.testing.assert_allclose(radiance(state, ("C07",), **OPTIONS)[0], expected, rtol=1e-7)


@pytest.mark.slow
def test_derivatives_to_weights_and_wind():
    state = make_state()

    @jax.jit
    def of(wind, f_vol, f_geo):
        changed = eqx.tree_at(
            lambda s: (s.albedo["C01"].wind_speed, s.albedo["C02"].f_vol, s.albedo["C02"].f_geo),
            state,
            (wind, f_vol, f_geo),
        )
        return brf(changed, ("C01", "C02"), **OPTIONS)

    point, step = [jnp.asarray(x) for x in (6.0, 0.1, 0.03)], 1e-4
    slopes = np.stack(jax.jit(jax.jacrev(of, argnums=(0, 1, 2)))(*point))
    for k in range(3):
        plus, minus = ([x + s * step * (i == k) for i, x in enumerate(point)] for s in (1, -1))
        difference = (of(*plus) - of(*minus)) / (2 * step)
        np.testing.assert_allclose(slopes[k], difference, rtol=1e-6, atol=1e-10)
    assert slopes[0, 1] == slopes[1, 0] == slopes[2, 0] == 0  # each band has a ground of its own


def test_batches_repeat_what_is_one_number():
    batch = stacked([make_state(), make_state()])
    batch = eqx.tree_at(lambda s: s.albedo["C02"].f_geo, batch, jnp.asarray(0.03))
    rough = SEEN[:2]  # all of them by `test_equals_the_solver_called_by_hand`
    found = brf(batch, rough, gases=(), **OPTIONS)
    np.testing.assert_allclose(found, [expected((), rough)] * 2, rtol=1e-12)
