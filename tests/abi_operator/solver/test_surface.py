"""Grounds: an albedo, a surface object, and what they must have in common."""

import jax
import jax.numpy as jnp
import numpy as np
from columns import standard_columns
from surfaces import Bowl, Constant

from abi_operator.solver import Lambertian, toa_albedo, toa_brf, toa_radiance

# Two ways through the same algebra: one closed form, one inverse of 1 + R.
SAME_GROUND = 1e-12
# The inverse of a few hundred well-conditioned matrices.
ROUNDING = 1e-11
# Grounds at four streams are in `test_judge`.
OPTIONS = {"num_streams": 2, "num_doublings": 4}


def bowl(count=4):
    rng = np.random.default_rng(5)
    return Bowl(jnp.asarray(rng.uniform(0.1, 0.6, count)), jnp.asarray(rng.uniform(0, 0.8, count)))


def test_a_constant_surface_is_lambertian():
    """Without the exact single scattering; `test_judge` has it with."""
    tau, ssa, moments, albedo, *angles = standard_columns()
    options = OPTIONS | {"single_scattering": None}
    plain = toa_brf(tau, ssa, moments, albedo, *angles, **options)
    for surface in (Constant(jnp.asarray(albedo)), Lambertian(jnp.asarray(albedo))):
        result = toa_brf(tau, ssa, moments, surface, *angles, **options)
        np.testing.assert_allclose(result, plain, rtol=SAME_GROUND)


def test_without_atmosphere_it_is_the_surface():
    tau, ssa, moments, _, mu0, mu, azimuth = standard_columns()
    surface = bowl()
    result = toa_brf(0 * tau, ssa, moments, surface, mu0, mu, azimuth, **OPTIONS)
    expected = surface.brdf(*(jnp.asarray(x) for x in (mu, mu0, azimuth)))
    np.testing.assert_allclose(result, expected, rtol=ROUNDING)


def test_few_modes_leave_the_direct_reflection_alone():
    tau, ssa, moments, _, *angles = standard_columns()
    arguments = (1e-9 * tau, ssa, moments, bowl(), *angles)
    few, all_modes = (toa_brf(*arguments, num_modes=m, **OPTIONS) for m in (1, None))
    # What meets both ground and air is smaller by the optical depth.
    np.testing.assert_allclose(few, all_modes, rtol=1e-7)


def test_swapping_sun_and_satellite_over_a_reciprocal_surface():
    tau, ssa, moments, _, mu0, mu, azimuth = standard_columns()
    there = toa_brf(tau, ssa, moments, bowl(), mu0, mu, azimuth, **OPTIONS)
    back = toa_brf(tau, ssa, moments, bowl(), mu, mu0, azimuth, **OPTIONS)
    np.testing.assert_allclose(there, back, rtol=ROUNDING)


def test_modes_add_up_to_the_surface_and_their_error_is_the_alias():
    surface = bowl()
    mu_out, mu_in = np.full(4, 0.7), np.full(4, 0.4)
    azimuth = np.asarray([0.0, 0.4, 2.0, np.pi])
    orders = np.arange(33)

    @jax.jit
    def modes_and_brdf(orders, mu_out, mu_in, azimuth):
        modes = jax.vmap(lambda m: surface.modes(m, mu_out, mu_in))(orders)
        return modes, surface.brdf(mu_out, mu_in, azimuth)

    modes, brdf = map(np.asarray, modes_and_brdf(orders, mu_out, mu_in, azimuth))
    weight = np.where(orders == 0, 1.0, 2.0)[:, None] * np.cos(orders[:, None] * azimuth)
    # 33 modes that fall as 0.4^m leave 1e-13 out; each is exact to 0.4^(2 * 64 - m).
    np.testing.assert_allclose(np.sum(weight * modes, axis=0), brdf, rtol=1e-9)
    ratio = modes[1:20] / modes[2:21]
    np.testing.assert_allclose(ratio, np.broadcast_to(ratio[0], ratio.shape), rtol=1e-6)


def test_surface_parameters_broadcast_and_have_derivatives():
    tau, ssa, moments, _, *angles = standard_columns()

    def total(surface):
        return jnp.sum(toa_brf(tau, ssa, moments, surface, *angles, **OPTIONS))

    both = jax.value_and_grad(total)
    surface = Bowl(jnp.asarray([0.3]), jnp.asarray([0.5]))
    value, slope = both(surface)
    step = 1e-6
    for name in ("albedo", "backscatter"):
        plus, minus = (
            Bowl(**{"albedo": surface.albedo, "backscatter": surface.backscatter}
                 | {name: getattr(surface, name) + sign * step})
            for sign in (1, -1)
        )  # fmt: skip
        difference = (both(plus)[0] - both(minus)[0]) / (2 * step)
        # Rounding of a sum of four reflectances over the step.
        np.testing.assert_allclose(getattr(slope, name)[0], difference, rtol=1e-8)
    assert np.isfinite(value)


def test_a_ground_that_sends_everything_back_under_white_air_loses_nothing():
    tau, ssa, moments, _, mu0, *_ = standard_columns()
    white = Constant(jnp.ones(4))
    albedo = toa_albedo(tau, np.ones_like(ssa), moments, white, mu0, **OPTIONS)
    np.testing.assert_allclose(albedo, 1, rtol=SAME_GROUND)


def test_emission_over_a_surface_obeys_kirchhoff():
    """Under air at B everywhere a Lambertian ground of emission (1 - a) B shows B, by any name.

    By the name of an albedo it is in `test_toa_radiance`.
    """
    tau, ssa, moments, albedo, *angles = standard_columns()
    result = toa_radiance(
        tau, ssa, moments, Constant(jnp.asarray(albedo)), *angles, solar_irradiance=0.0,
        planck_levels=np.full((4, 6), 3.0), surface_emission=3 * (1 - albedo),
        isotropic_top=3.0, **OPTIONS,
    )  # fmt: skip
    np.testing.assert_allclose(result, 3, rtol=1e-14)
