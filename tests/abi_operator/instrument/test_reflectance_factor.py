"""Radiance and reflectance factor."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator.bands import BANDS
from abi_operator.instrument import (
    radiance_from_reflectance_factor,
    reflectance_factor_from_radiance,
)
from abi_operator.satellites import solar_irradiance


@pytest.mark.parametrize("band", BANDS)
def test_one_is_a_white_surface_under_the_sun(band):
    distance = 0.9949
    irradiance = solar_irradiance(band, "GOES-17") / distance**2
    rho = reflectance_factor_from_radiance(
        jnp.asarray(irradiance / np.pi), band, "GOES-17", distance
    )
    np.testing.assert_allclose(rho, 1, rtol=1e-14)
    radiance = radiance_from_reflectance_factor(rho, band, "GOES-17", distance)
    np.testing.assert_allclose(radiance, irradiance / np.pi, rtol=1e-14)


def test_noise_of_300_to_1_in_c06():
    # 76.9 / pi / 300 = 0.08 W m-2 sr-1 um-1 is a reflectance factor of 0.0033.
    rho = reflectance_factor_from_radiance(jnp.asarray(0.0816), "C06")
    np.testing.assert_allclose(rho, 1 / 300, rtol=1e-3)


@pytest.mark.float32
def test_distance_may_be_an_array_and_float32_stays():
    distance = jnp.array([0.983, 1.0, 1.017], jnp.float32)
    rho = reflectance_factor_from_radiance(
        jnp.full(3, 50.0, jnp.float32), "C03", "GOES-16", distance
    )
    assert rho.dtype == jnp.float32
    np.testing.assert_allclose(rho / rho[1], distance**2, rtol=1e-6)
    slope = jax.grad(reflectance_factor_from_radiance, 3)(
        jnp.float32(50), "C03", "GOES-16", distance[0]
    )
    np.testing.assert_allclose(slope, 2 * rho[0] / distance[0], rtol=1e-5)
