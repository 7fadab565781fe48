"""Slopes by the angles of sun and satellite, about the vertical."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from abi_operator import Geometry
from abi_operator.solver import cos_scattering_angle

# Angles up to which a cosine rounds to 1, and from which slopes are right to 1e-2.
ROUNDED = {"float32": (2e-4, 5e-3), "float64": (1e-8, 1e-7)}


@pytest.mark.parametrize("dtype", ROUNDED)
@pytest.mark.parametrize("which", ["solar_zenith", "view_zenith"])
def test_the_slope_by_a_zenith_angle_is_0_at_the_vertical_and_right_beside_it(which, dtype):
    small, right = ROUNDED[dtype]
    angles = dict.fromkeys(("solar_zenith", "view_zenith"), jnp.asarray(0.8, dtype))
    azimuth = jnp.asarray(0.5, dtype)

    def turned(zenith):
        there = Geometry(**angles | {which: zenith}, relative_azimuth=azimuth)
        return cos_scattering_angle(there.mu0, there.mu, there.relative_azimuth)

    slopes = jax.vmap(jax.grad(turned))(jnp.asarray([0.0, small, right], dtype))
    assert slopes.dtype == dtype and slopes[0] == 0
    # What is left is that of the cosines' product, as an average over all azimuths has it.
    np.testing.assert_allclose(slopes[1], np.cos(0.8) * small, rtol=1e-5)
    np.testing.assert_allclose(slopes[2], -np.sin(0.8) * np.cos(0.5), rtol=1e-2)
